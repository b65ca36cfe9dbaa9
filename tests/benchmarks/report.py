"""What was measured as JSON, as a table and as a plot of error against CPU time."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
from dataclasses import dataclass, field
from pathlib import Path

from case import Case
from measure import Point, cost

TARGETS = {"1 %": 1e-2, "0.1 %": 1e-3}
#: Symbol and colour of each tool.
LOOK = {
    "patchlight": ("o-", "#c2410c"),
    "radiance": ("s--", "#1d4ed8"),
    "mitsuba": ("^:", "#15803d"),
}


@dataclass
class CaseReport:
    """Points of one case, and CPU seconds each tool took to get ready."""

    case: Case
    points: list[Point] = field(default_factory=list)
    ready_s: dict[str, float] = field(default_factory=dict)

    def of(self, tool: str) -> list[Point]:
        return [point for point in self.points if point.tool == tool]

    def costs(self) -> dict[str, dict[str, dict[str, object]]]:
        """CPU seconds of each tool to each target."""
        out: dict[str, dict[str, dict[str, object]]] = {}
        for tool in dict.fromkeys(point.tool for point in self.points):
            for name, target in TARGETS.items():
                found = cost(self.of(tool), target)
                if found is not None:
                    out.setdefault(tool, {})[name] = {"cpu_s": found[0], "known": found[1]}
        return out


def machine() -> dict[str, object]:
    """Where it was measured."""
    return {
        "processors": os.cpu_count(),
        "load_average": list(os.getloadavg()),
        "machine": platform.machine(),
        "python": platform.python_version(),
    }


def write_json(path: Path, reports: list[CaseReport], tools: dict[str, str]) -> None:
    """All reports; ``tools`` says each tool's version, or why it is missing."""
    data = {
        "machine": machine(),
        "tools": tools,
        "errors": "value / truth - 1 over sensors above 1e-3 of the largest truth",
        "cases": [
            {
                "name": report.case.name,
                "title": report.case.title,
                "truth": report.case.how,
                "sensors": len(report.case.points),
                "ready_cpu_s": report.ready_s,
                "points": [dataclasses.asdict(point) for point in report.points],
                "costs": report.costs(),
            }
            for report in reports
        ],
    }
    path.write_text(json.dumps(data, indent=1), encoding="utf-8")


def _seconds(entry: dict | None) -> str:
    if entry is None:
        return "-"
    mark = {"measured": "", "at most": "<", "extrapolated": "~"}[entry["known"]]
    return f"{mark}{entry['cpu_s']:.3g}"


def table(reports: list[CaseReport]) -> str:
    """CPU seconds to each target and the best error of each tool, as Markdown."""
    lines = [
        "| case | tool | CPU s to 1 % | CPU s to 0.1 % | best rms | max | at CPU s | setting |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for report in reports:
        for tool, costs in report.costs().items():
            best = min(report.of(tool), key=lambda p: p.rms)
            lines.append(
                f"| {report.case.name} | {tool} | "
                + " | ".join(_seconds(costs.get(name)) for name in TARGETS)
                + f" | {best.rms:.1e} | {best.largest:.1e} | {best.cpu_s:.3g} | {best.setting} |"
            )
    return "\n".join(lines)


def plot(path: Path, reports: list[CaseReport]) -> None:
    """Root mean square error over CPU seconds, both logarithmic, a panel a case."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = min(len(reports), 4)
    rows = math.ceil(len(reports) / columns)
    figure, axes = plt.subplots(
        rows, columns, figsize=(4.2 * columns, 3.4 * rows), layout="constrained", squeeze=False
    )
    for axis in axes.ravel()[len(reports) :]:
        axis.set_visible(False)
    for axis, report in zip(axes.ravel(), reports, strict=False):
        for tool, (style, color) in LOOK.items():
            own = sorted(report.of(tool), key=lambda p: p.cpu_s)
            if own:
                errors = [max(p.rms, 1e-16) for p in own]
                axis.plot([p.cpu_s for p in own], errors, style, color=color, ms=4, label=tool)
        for target in TARGETS.values():
            axis.axhline(target, color="0.8", lw=0.8, zorder=0)
        axis.set(xscale="log", yscale="log", xlabel="CPU time [s]", ylabel="rms error")
        axis.set_title(report.case.name, fontsize="medium")
        axis.legend(fontsize="x-small")
    figure.savefig(path, dpi=120)
    plt.close(figure)
