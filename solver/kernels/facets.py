"""What shares are found with: flat pieces of all surfaces, points of bright elements."""

from typing import NamedTuple

import numpy as np


class Facets(NamedTuple):
    """Flat pieces of the elements and of what else hides them, for visible shares only.

    Panels hide; straight lines part those that belong to several elements into cells, u first. A
    unit is one side of one patch, as `rows.Sources.group`.

    Attributes
    ----------
    panel_points : (3, w) array
        Points of the true surfaces. [m]
    panel_corners : (p, 4) int array
        Points of each panel, counter-clockwise about its lit side.
    panel_planes : (4, p) array
        Unit normals and their products with the panels' middles.
    panel_element : (p,) int array
        Element the panel belongs to, −1 if there are several or none.
    panel_solid : (p,) int array
        Solid it belongs to.
    panel_grid : (p,) int array
        Row of the panel's grid of cells, −1 where there is none.
    unit_ranges : (g + 1, 2) int array
        First and end of the panels of each unit, and of the backs of one-sided patches, which
        belong to none.
    unit_points : (g, 2) int array
        First and end of the points of each unit's panels.
    unit_joined : (g,) bool array
        Whether any of its panels belongs to several elements.
    grid_size : (k, 4) int array
        Cells along u and v, and rows of the first line and the first cell.
    grid_lines : (l, 2, 3) array
        A point and a direction of every line, those between columns first. Seen from the front at
        x, columns and rows are counted towards (point − x) × direction. [m]
    grid_element : (c,) int array
        Element of each cell.
    sight_units : (k,) int array
        Units whose elements are told by lines of sight: they are flat or convex.
    sight_clusters, sight_spheres : (c, 2) int array, (c, 4) array
        First and end of the rows of ``sight_units`` of one solid, and a sphere about them. [m]
    sight_start : (n + 1,) int array
        First point of each element.
    sight_points, sight_areas : (3, s) array
        Points of these elements [m], and normals times the area each stands for. [m²]
    """

    panel_points: np.ndarray
    panel_corners: np.ndarray
    panel_planes: np.ndarray
    panel_element: np.ndarray
    panel_solid: np.ndarray
    panel_grid: np.ndarray
    unit_ranges: np.ndarray
    unit_points: np.ndarray
    unit_joined: np.ndarray
    grid_size: np.ndarray
    grid_lines: np.ndarray
    grid_element: np.ndarray
    sight_units: np.ndarray
    sight_clusters: np.ndarray
    sight_spheres: np.ndarray
    sight_start: np.ndarray
    sight_points: np.ndarray
    sight_areas: np.ndarray
