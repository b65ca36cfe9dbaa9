"""Child process that draws one still with VTK: ``python -m patchlight.reports.render_child``.

VTK can end the process when OpenGL is broken, so it never runs in the process that holds results.
Reads an .npz written by `patchlight.reports.still` and writes pixels to a .npy file.
"""

from __future__ import annotations

import sys

import numpy as np


def main(source: str, target: str) -> int:
    """Draw the scene of file ``source`` and store (h, w, 3) uint8 in ``target``."""
    import pyvista as pv

    data = np.load(source)
    width, height = (int(s) for s in data["size"])
    # The window is as large as the picture: no scaling by the library.
    plotter = pv.Plotter(off_screen=True, window_size=[width, height])
    plotter.renderer.SetBackground(1.0, 1.0, 1.0)
    plotter.enable_anti_aliasing("ssaa")
    colors, lines = data["colors"], data["lines"]
    triangles = data["triangles"]
    if len(triangles):
        faces = np.column_stack([np.full(len(triangles), 3), triangles]).ravel()
        mesh = pv.PolyData(data["points"], faces)
        mesh.point_data["t"] = data["t"]
        table = pv.LookupTable(values=np.column_stack([colors, np.full(len(colors), 255)]))
        table.scalar_range = (0.0, 1.0)
        plotter.add_mesh(
            mesh, scalars="t", cmap=table, clim=(0.0, 1.0), lighting=False, show_scalar_bar=False,
            interpolate_before_map=True,
        )  # fmt: skip
    if len(data["lamps"]):
        faces = np.column_stack([np.full(len(data["lamps"]), 3), data["lamps"]]).ravel()
        lamps = pv.PolyData(data["points"], faces)
        plotter.add_mesh(lamps, color=tuple(int(c) for c in data["lamp_color"]), lighting=False)
    if len(lines):
        cells = np.column_stack([np.full(len(lines), 2), np.arange(2 * len(lines)).reshape(-1, 2)])
        plotter.add_mesh(
            pv.PolyData(lines.reshape(-1, 3), lines=cells.ravel()), color="#1d2530", line_width=1.6,
            lighting=False,
        )  # fmt: skip
    camera = plotter.camera
    camera.position, camera.focal_point = tuple(data["eye"]), tuple(data["target"])
    camera.up, camera.view_angle = (0.0, 0.0, 1.0), float(data["fov_deg"])
    plotter.renderer.ResetCameraClippingRange()
    pixels = plotter.screenshot(return_img=True)
    np.save(target, np.asarray(pixels)[..., :3])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2]))
