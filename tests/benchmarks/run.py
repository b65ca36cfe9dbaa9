"""Error against CPU time of Patchlight, Radiance and Mitsuba on cases of known truth.

    python tests/benchmarks/run.py [--case A1 B ...] [--tool patchlight ...] -o FOLDER

writes ``benchmarks.json``, ``benchmarks.png`` and prints a table. Tools run one after the other in
the same run; a missing one is said and skipped. See README.md beside this file.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from cases import CASES
from measure import measure, worth_trying
from report import CaseReport, plot, table, write_json
from tools import Missing
from tools.mitsuba import MitsubaTool
from tools.ours import Ours
from tools.radiance import RadianceTool

TOOLS = (Ours, RadianceTool, MitsubaTool)


def main(arguments: list[str] | None = None) -> int:
    """Run the cases asked for; exit status 2 for a name that is none."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--case", nargs="+", help="names, or how names begin; all when not given")
    parser.add_argument("--tool", nargs="+", choices=[t.name for t in TOOLS], help="default: all")
    parser.add_argument("--settings", type=int, help="only so many settings a tool, quickest first")
    parser.add_argument(
        "--repeats", type=int, default=3, help="runs a setting, default %(default)s"
    )
    parser.add_argument(
        "--limit", type=float, default=60.0, help="CPU seconds of one run, default %(default)g"
    )
    parser.add_argument("-o", "--output", type=Path, required=True, help="folder for the results")
    options = parser.parse_args(arguments)
    cases = [c for c in CASES if not options.case or c.name.startswith(tuple(options.case))]
    if not cases:
        names = ", ".join(c.name for c in CASES)
        print(f"no case is called {' or '.join(options.case)}; there are {names}", file=sys.stderr)
        return 2
    # Threads that wait for the next loop would otherwise spin, and count as CPU time under load.
    os.environ.setdefault("OMP_WAIT_POLICY", "passive")
    options.output.mkdir(parents=True, exist_ok=True)

    said: dict[str, str] = {}
    tools = []
    for kind in TOOLS:
        if options.tool and kind.name not in options.tool:
            continue
        tool = kind()
        try:
            said[tool.name] = tool.version()
            tools.append(tool)
        except Missing as error:
            said[tool.name] = f"missing: {error}"
        print(f"{tool.name}: {said[tool.name]}", flush=True)

    reports: list[CaseReport] = []
    for case in cases:
        report = CaseReport(case)
        reports.append(report)
        truth = case.truth()
        print(f"{case.name}: {case.title}; {len(truth)} sensors, {case.how}", flush=True)
        for tool in tools:
            for setting in tool.settings(case)[: options.settings]:
                if not worth_trying(report.of(tool.name), options.limit):
                    print(f"  {tool.name:10s} {setting}: skipped, above {options.limit:g} CPU s")
                    break
                point, ready = measure(tool, case, setting, truth, options.repeats)
                report.points.append(point)
                report.ready_s[tool.name] = report.ready_s.get(tool.name, 0.0) + ready
                print(
                    f"  {tool.name:10s} {point.cpu_s:9.4f} s  rms {point.rms:.2e}  "
                    f"max {point.largest:.2e}  {point.setting}",
                    flush=True,
                )
        write_json(options.output / "benchmarks.json", reports, said)
    plot(options.output / "benchmarks.png", reports)
    print(table(reports))
    return 0


if __name__ == "__main__":
    sys.exit(main())
