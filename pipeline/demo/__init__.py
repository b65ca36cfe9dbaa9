"""Demo scenes, built in CadQuery and run from the STEP file they write."""

from __future__ import annotations

from pathlib import Path

from patchlight.solver.errors import InputError

#: What `patchlight demo NAME` offers.
DEMOS = {
    "office": "side-lit office with a curved wall, a dome, furniture and two lamps",
    "conference": "conference room without daylight: 24 lamps, a curved table, chairs and pots",
    "outdoors": "a ring and a ball on a hill, with their shadows of sun and sky",
}


def demo_files(name: str) -> tuple[str, ...]:
    """Names of the files that a demo writes: the model and the scene file."""
    if name not in DEMOS:
        raise InputError(f"demo {name!r}: there is no such demo; demos: {', '.join(DEMOS)}")
    return (f"{name}.step", f"{name}.toml")


def write_demo(name: str, folder: Path) -> Path:
    """Write STEP file and scene file of a demo into ``folder``; return the scene file."""
    demo_files(name)
    if name == "conference":
        from . import conference

        return conference.write(folder)
    if name == "outdoors":
        from . import outdoors

        return outdoors.write(folder)
    from . import office

    return office.write(folder)
