"""What panes leave of light on the rays of lobes and mirrors."""

from .bvh import trace_ray
from .compiled import lean
from .panes import MOST_CROSSED, transmittance
from .paths import frame_at
from .ray_patch import MISS


@lean
def next_pane(panes, x, y, z, dx, dy, dz, t_min, t_max, walk, place):
    """Next pane that dims a ray of unit direction: its row or −1, where, and what it leaves.

    ``place`` (6,) receives point and normal. Patches side by side that are met at the same place
    count once, and leaving a solid costs nothing: see `panes.through`.

    Returns
    -------
    (int, float, float, float, int, float)
        Row, distance [m], u, v, side (0 for +, 1 for −) and share left.
    """
    both = panes.nets.shape[0] * 0  # not literals: they would compile the callee anew
    for _ in range(MOST_CROSSED):
        status, p, t, u, v, facing = trace_ray(
            panes.bounds, panes.links, panes.piece_patch, panes.piece_box, panes.nets, panes.kinds,
            x, y, z, dx, dy, dz, t_min, t_max, both, both != 0, walk.stack, walk.work,
        )  # fmt: skip
        if status == MISS:
            break
        t_min = t + 1e-9 * max(abs(t), 1e-3)
        if panes.solid[p] and facing <= 0:
            continue
        frame_at(panes.nets[p], u, v, place)
        cosine = abs(dx * place[3] + dy * place[4] + dz * place[5])
        left = transmittance(panes, panes.law[p], cosine)
        return p, t_min, u, v, 1 if facing < 0 else 0, left
    return -1, t_max, 0.0, 0.0, 0, 1.0


@lean
def left_on_ray(panes, x, y, z, dx, dy, dz, t_min, t_max, walk, place):
    """Share of light that panes leave on a part of a ray of unit direction."""
    share = 1.0
    if panes.nets.shape[0] == 0:
        return share
    for _ in range(MOST_CROSSED):
        p, t_min, _, _, _, left = next_pane(panes, x, y, z, dx, dy, dz, t_min, t_max, walk, place)
        if p < 0:
            break
        share *= left
    return share
