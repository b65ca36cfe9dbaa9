"""The receiver's picture: curves in a frame that looks at a patch, and what may be in its way.

Control vectors H are turned into a right-handed frame whose third axis looks at the patch; the
picture of H is (H₁/H₃, H₂/H₃). As seen from the receiver the second axis runs down when the first
runs to the right, so that the left of a curve is on the other side than on paper.
"""

import math

import numpy as np

from .compiled import kernel, lean
from .crossings import picture_point
from .quadric import restrict_cubic

#: Halvings of a curve of which a part is behind the receiver.
HALVINGS = 10
#: Curves no longer than this in the picture are points.
_POINT = 1e-13


@lean
def frame_at(s, frame):
    """Rows: two directions, and third that to the middle of the corners of ``s``; ok."""
    ax = ay = az = 0.0
    for i in (0, 3):
        for j in (0, 3):
            x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
            size = math.sqrt(x * x + y * y + z * z)
            if size == 0.0:
                return False
            ax, ay, az = ax + x / size, ay + y / size, az + z / size
    size = math.sqrt(ax * ax + ay * ay + az * az)
    if size < 0.4:
        return False
    ax, ay, az = ax / size, ay / size, az / size
    for i in range(4):
        for j in range(4):
            x, y, z = s[i, j, 0], s[i, j, 1], s[i, j, 2]
            if ax * x + ay * y + az * z <= 0.1 * math.sqrt(x * x + y * y + z * z):
                return False
    k = 0
    if abs(ay) < abs(ax):
        k = 1
    if abs(az) < min(abs(ax), abs(ay)):
        k = 2
    ex, ey, ez = 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2)
    fx, fy, fz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
    size = math.sqrt(fx * fx + fy * fy + fz * fz)
    fx, fy, fz = fx / size, fy / size, fz / size
    frame[0, 0], frame[0, 1], frame[0, 2] = fx, fy, fz
    # Right-handed: f, a × f, a.
    frame[1, 0], frame[1, 1], frame[1, 2] = ay * fz - az * fy, az * fx - ax * fz, ax * fy - ay * fx
    frame[2, 0], frame[2, 1], frame[2, 2] = ax, ay, az
    return True


@lean
def turn_into(frame, c, out):
    """Control vectors ``c`` (4, 3) in the frame."""
    for i in range(4):
        for k in range(3):
            out[i, k] = frame[k, 0] * c[i, 0] + frame[k, 1] * c[i, 1] + frame[k, 2] * c[i, 2]


@lean
def mean_normal(s, normal):
    """Normal of the diagonals of ``s``, away from the receiver; False where there is none."""
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        ua = s[3, 3, a] / s[3, 3, 3] - s[0, 0, a] / s[0, 0, 3]
        ub = s[3, 3, b] / s[3, 3, 3] - s[0, 0, b] / s[0, 0, 3]
        va = s[0, 3, a] / s[0, 3, 3] - s[3, 0, a] / s[3, 0, 3]
        vb = s[0, 3, b] / s[0, 3, 3] - s[3, 0, b] / s[3, 0, 3]
        normal[k] = ua * vb - ub * va
    size = math.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if size == 0.0:
        return False
    up = 0.0
    for k in range(3):
        up += normal[k] * (s[0, 0, k] / s[0, 0, 3] + s[3, 3, k] / s[3, 3, 3])
    if up < 0.0:
        size = -size
    for k in range(3):
        normal[k] /= size
    return True


@lean
def heights_along(s, normal, reach):
    """Least and largest height of a net over the receiver along ``normal`` into ``reach`` (2,)."""
    low, high = 1e300, -1e300
    for i in range(4):
        for j in range(4):
            d = normal[0] * s[i, j, 0] + normal[1] * s[i, j, 1] + normal[2] * s[i, j, 2]
            d /= s[i, j, 3]
            low, high = min(low, d), max(high, d)
    reach[0], reach[1] = low, high


@lean
def _order(low, high, reach):
    """1 where what reaches from ``low`` to ``high`` is beyond the patch, −1 before it, or 0."""
    tolerance = 1e-9 * max(abs(reach[0]), abs(reach[1]))
    # The receiver is at height 0: a plane beyond the patch has to be beyond the receiver too.
    if low >= max(reach[1], 0.0) - tolerance:
        return 1
    if reach[0] > 0.0 and high <= reach[0] + tolerance:
        return -1
    return 0


@kernel
def order(b, normal, reach):
    """1 where net ``b`` is beyond a patch, −1 where it is before it, 0 where neither is sure.

    ``normal`` is the mean normal of the patch, turned away from the receiver, and ``reach`` are its
    `heights_along` it.
    """
    own = np.empty(2)
    heights_along(b, normal, own)
    return _order(own[0], own[1], reach)


@lean
def order_of_sphere(sphere, x, normal, reach):
    """The same for all that is in a ``sphere`` (4,) seen from receiver ``x``."""
    d = normal[0] * (sphere[0] - x[0]) + normal[1] * (sphere[1] - x[1])
    d += normal[2] * (sphere[2] - x[2])
    return _order(d - sphere[3], d + sphere[3], reach)


@lean
def order_by_plane(s, b, axis):
    """The same for a flat net ``b`` with normal ``axis``, by its own plane: 1, −1, or 0.

    Patches on the receiver's side of it are never hidden by it, those on the other side are beyond.
    """
    w = b[0, 0, 3]
    own = -(axis[0] * b[0, 0, 0] + axis[1] * b[0, 0, 1] + axis[2] * b[0, 0, 2]) / w
    sign = 1.0 if own > 0.0 else -1.0
    low, high, size = 1e300, -1e300, abs(own)
    for i in range(4):
        for j in range(4):
            w = s[i, j, 3]
            d = (axis[0] * s[i, j, 0] + axis[1] * s[i, j, 1] + axis[2] * s[i, j, 2]) / w
            size = max(size, abs(d))
            low, high = min(low, sign * (d + own)), max(high, sign * (d + own))
    if low >= -1e-9 * size:
        return 1
    return -1 if high <= 1e-9 * size else 0


@lean
def is_point(c):
    """Whether a curve has no length in the picture: a pole, or an edge along the view."""
    size = 0.0
    for i in range(1, 4):
        for k in range(2):
            size = max(size, abs(c[i, k] / c[i, 2] - c[0, k] / c[0, 2]))
    return size <= _POINT


@lean
def add_outline(c, frame, box, curves, count, level, stack):
    """Add what of a curve may lie in the picture of the patch; −1 where there is no more room."""
    turn_into(frame, c, stack[0])
    level[0] = 0
    top = 1
    while top > 0:
        top -= 1
        own = stack[top]
        left = right = below = above = True
        ahead = True
        for i in range(4):
            px, py, w = own[i, 0], own[i, 1], own[i, 2]
            left = left and px <= box[0] * w
            right = right and px >= box[1] * w
            below = below and py <= box[2] * w
            above = above and py >= box[3] * w
            ahead = ahead and w > 1e-3 * (abs(px) + abs(py))
        if left or right or below or above:
            continue
        if ahead:
            if is_point(own):
                continue
            if count >= curves.shape[0]:
                return -1
            for i in range(4):
                for k in range(3):
                    curves[count, i, k] = own[i, k]
            count += 1
            continue
        behind = True
        for i in range(4):
            behind = behind and own[i, 2] <= 0.0
        if behind:
            continue
        if level[top] == HALVINGS:
            return -1
        level[top] += 1
        level[top + 1] = level[top]
        for i in range(4):
            for k in range(3):
                stack[top + 1, i, k] = own[i, k]
        restrict_cubic(own, 0.0, 0.5)
        restrict_cubic(stack[top + 1], 0.5, 1.0)
        top += 2
    return count


@lean
def add_horizon(n, box, curves, count):
    """Add the horizon, directed so that what is below is on its left, where it is in the picture.

    ``n``: the receiver's normal in the frame. The line n · (X, Y, 1) = 0 in the picture.
    """
    size2 = n[0] * n[0] + n[1] * n[1]
    if size2 < 1e-12 or count >= curves.shape[0]:
        return -1
    mx, my = 0.5 * (box[0] + box[1]), 0.5 * (box[2] + box[3])
    reach = (box[1] - box[0]) + (box[3] - box[2])
    off = (n[0] * mx + n[1] * my + n[2]) / size2
    fx, fy = mx - off * n[0], my - off * n[1]
    size = math.sqrt(size2)
    # On its left, seen from the receiver: to the side where n · H < 0.
    tx, ty = n[1] / size, -n[0] / size
    for i in range(4):
        t = reach * (2.0 * i / 3.0 - 1.0)
        curves[count, i, 0], curves[count, i, 1], curves[count, i, 2] = (
            fx + t * tx,
            fy + t * ty,
            1.0,
        )
    return count + 1


@lean
def beside(c, t, left, frame, at, d):
    """Direction ``d`` a little beside the curve at ``t``, in the coordinates of the scene.

    ``at`` (4,) is scratch. False where the curve has no direction.
    """
    picture_point(c, t, at)
    size = math.sqrt(at[2] * at[2] + at[3] * at[3])
    if size == 0.0:
        return False
    px, py = at[0] + left * at[3] / size, at[1] - left * at[2] / size
    for k in range(3):
        d[k] = px * frame[0, k] + py * frame[1, k] + frame[2, k]
    return True
