"""Shafts from points to what they see, and whether balls reach into them."""

import math

from .compiled import kernel


@kernel
def find_touched(nodes, normals, factors, spheres, planes, balls, open_rows, touched):
    """Mark receivers whose sight of anything may pass through a ball.

    Parameters
    ----------
    nodes, normals : (m, q, 3) array
        Receiver nodes [m] and unit normals.
    factors : (m, n) array
        Form factors: what a receiver sees is what has one above 0.
    spheres : (n, 4) array
        About the elements.
    planes : (n, 4) array
        Unit normal and offset of flat elements: nothing behind them is on the way. Others have a
        normal of 0 and an offset of −∞. [m]
    balls : (b, 4) array
        What matters; those wholly behind a receiver do not.
    open_rows : (m,) bool array
        Receivers that see something besides the elements: any ball before them matters.
    touched : (m,) bool array
        Set where it is so.
    """
    for i in range(nodes.shape[0]):
        for q in range(nodes.shape[1]):
            for b in range(balls.shape[0]):
                if touched[i]:
                    break
                x, y, z = nodes[i, q, 0], nodes[i, q, 1], nodes[i, q, 2]
                bx, by, bz, radius = (
                    balls[b, 0] - x, balls[b, 1] - y, balls[b, 2] - z, balls[b, 3],
                )  # fmt: skip
                n = normals[i, q]
                if n[0] * bx + n[1] * by + n[2] * bz + radius <= 0.0:
                    continue
                if open_rows[i]:
                    touched[i] = True
                    break
                for j in range(spheres.shape[0]):
                    if factors[i, j] <= 0.0:
                        continue
                    before = radius - planes[j, 3]
                    for k in range(3):
                        before += planes[j, k] * balls[b, k]
                    if before <= 0.0:
                        continue
                    sx, sy, sz = spheres[j, 0] - x, spheres[j, 1] - y, spheres[j, 2] - z
                    length2 = sx * sx + sy * sy + sz * sz
                    along = (bx * sx + by * sy + bz * sz) / max(length2, 1e-300)
                    # The shaft lies in a cone with a cap: as wide at t as t times the sphere.
                    reach = (radius + spheres[j, 3]) / math.sqrt(max(length2, 1e-300))
                    t = min(max(along, 0.0), 1.0)
                    dx, dy, dz = bx - t * sx, by - t * sy, bz - t * sz
                    wide = radius + min(1.0, max(0.0, along) + reach) * spheres[j, 3]
                    if dx * dx + dy * dy + dz * dz < wide * wide:
                        touched[i] = True
                        break
