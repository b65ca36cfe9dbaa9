"""Writers of small photometric files of known content."""

from __future__ import annotations

import numpy as np


def ies_text(
    candela,
    gamma,
    c,
    *,
    header="IESNA:LM-63-2002",
    keywords=("[TEST] own", "[MANUFAC] nobody", "[LUMINAIRE] disc", "[LAMP] one"),
    tilt="TILT=NONE",
    lumens=-1.0,
    multiplier=1.0,
    kind=1,
    unit=2,
    size=(0.2, 0.4, 0.0),
    ballast=1.0,
    second=1.0,
    watts=12.5,
) -> str:
    """An IES file of intensities (k, g), numbers broken into short lines."""
    lines = [*([header] if header else []), *keywords, tilt]
    lines.append(f"1 {lumens:g} {multiplier:g} {len(gamma)} {len(c)} {kind} {unit} ")
    lines.append(" ".join(f"{s:g}" for s in size))
    lines.append(f"{ballast:g} {second:g} {watts:g}")
    for values in (gamma, c, *np.asarray(candela)):
        words = [f"{v:.10g}" for v in values]
        lines += [" ".join(words[k : k + 7]) for k in range(0, len(words), 7)]
    return "\r\n".join(lines) + "\r\n"


def ldt_text(
    per_klm,
    gamma,
    c,
    symmetry,
    *,
    flux=2000.0,
    output=100.0,
    downward=100.0,
    conversion=1.0,
    lamps="1",
    sets=1,
    tilt=0.0,
) -> str:
    """A EULUMDAT file: all half-planes ``c`` are listed, ``per_klm`` holds the stored ones."""
    step = c[1] - c[0] if len(c) > 1 else 0.0
    lines = ["nobody", "2", str(symmetry), str(len(c)), f"{step:g}", str(len(gamma))]
    lines += [f"{gamma[1] - gamma[0]:g}", "no. 1", "panel", "", "own.ldt", "today"]
    lines += ["620", "310", "50", "600", "300", "0", "0", "0", "0"]
    lines += [f"{downward:g}", f"{output:g}", f"{conversion:g}", f"{tilt:g}", str(sets)]
    for k in range(sets):
        lines += [lamps, "LED", f"{flux * (k + 1):g}", "4000", "80", "17,5"]
    lines += ["0.5"] * 10
    for values in (c, gamma, *np.asarray(per_klm)):
        lines += [f"{v:.10g}" for v in values]
    return "\r\n".join(lines) + "\r\n"
