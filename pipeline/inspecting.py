"""A STEP file in words: parts, names, colours, layers, faces and the certificate."""

from __future__ import annotations

from itertools import groupby

from patchlight.solver.model import Face, Model

#: Failed or approximated faces listed one by one.
MOST_FACES = 20
#: Faces with free edges listed one by one.
MOST_LOOSE = 5


def inspection_text(model: Model) -> str:
    """Part tree with the faces by number, then what the conversion did."""
    lines = [f"{model.name}: {len(model.parts)} parts, {len(model.faces)} faces, unit {model.unit}"]
    by_part: list[list[Face]] = [[] for _ in model.parts]
    for face in model.faces:
        by_part[face.part].append(face)
    for row, part in enumerate(model.parts):
        facts = [part.kind]
        if part.color is not None:
            facts.append(hex_color(part.color))
        if part.layer:
            facts.append(f"layer {part.layer}")
        if part.material:
            facts.append(f"material {part.material}")
        if part.instance_of not in (-1, row):
            facts.append(f"same shape as {model.parts[part.instance_of].path}")
        lines.append(f"{part.path}  ({', '.join(facts)})")
        lines.append(f"    {_kinds(by_part[row])}")
        if model.certificate.part_edges:
            lines.append(f"    edges: {_counts(model.certificate.part_edges[row])}")
        for face in by_part[row]:
            if face.name or (face.color is not None and face.color != part.color):
                named = f" {face.name}" if face.name else ""
                color = f" {hex_color(face.color)}" if face.color else ""
                lines.append(f"    #{face.number}{named}{color}")
    return "\n".join([*lines, *certificate_lines(model)])


def _kinds(faces: list[Face]) -> str:
    """``#1-#6 plane, #7 cylinder``."""
    texts = []
    for kind, run in groupby(faces, key=lambda f: f.kind):
        numbers = [f.number for f in run]
        ends = f"#{numbers[0]}" if len(numbers) == 1 else f"#{numbers[0]}-#{numbers[-1]}"
        texts.append(f"{ends} {kind}")
    return ", ".join(texts) or "no faces"


def _counts(edges: dict[str, int]) -> str:
    """``12 sharp, 1 smooth``."""
    return ", ".join(f"{n} {kind}" for kind, n in edges.items()) or "none"


def certificate_lines(model: Model) -> list[str]:
    """Totals of the conversion and the faces that are not exact."""
    c = model.certificate
    lines = [
        f"faces: {c.faces_total}, exact {c.faces_exact}, approximated {c.faces_approximated}, "
        f"failed {c.faces_failed}; patches {c.patches}; {c.seconds:.2f} s",
        f"largest deviation {c.max_deviation_m:.2g} m, angle {c.max_angle_deg:.2g} degrees, "
        f"area error {c.max_area_error:.2g}, gap {c.max_gap_m:.2g} m",
    ]
    if c.normals_left_out:
        faces = sum(f.normals_left_out > 0 for f in c.faces)
        lines.append(
            f"normals at {c.normals_left_out} points of {faces} faces do not count: folds or cusps"
        )
    if c.part_edges:
        lines.append(f"edges: {_counts(c.edges)}")
    inexact = [f for f in c.faces if f.failed] + [
        f for f in c.faces if not f.failed and not f.exact
    ]
    for face in inexact[:MOST_FACES]:
        state = "failed" if face.failed else f"within {face.deviation_m:.2g} m"
        lines.append(
            f"  {c.part_paths[face.part]} #{face.number} {face.kind}: {state} {face.reason}"
        )
    if len(inexact) > MOST_FACES:
        lines.append(f"  and {len(inexact) - MOST_FACES} more (all with --json)")
    loose = sorted((f for f in c.faces if f.free_edge_m > 0.0), key=lambda f: -f.free_edge_m)
    if loose:
        lines.append(f"free edges, where no other face begins: {c.free_edge_m:.3g} m, the longest")
    for face in loose[:MOST_LOOSE]:
        lines.append(
            f"  {c.part_paths[face.part]} #{face.number} {face.kind}: {face.free_edge_m:.3g} m"
        )
    return [*lines, *c.notes]


def hex_color(linear: tuple[float, float, float]) -> str:
    """``#rrggbb`` of linear sRGB (IEC 61966-2-1)."""
    encoded = [
        12.92 * c if c <= 0.0031308 else 1.055 * c ** (1.0 / 2.4) - 0.055
        for c in (min(1.0, max(0.0, float(x))) for x in linear)
    ]
    return "#" + "".join(f"{round(255.0 * c):02x}" for c in encoded)
