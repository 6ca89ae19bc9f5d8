"""Rotations as unit quaternions (w, x, y, z), as on the wire, and as rotation vectors (rad)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: No rotation.
IDENTITY: Array = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(a: Array, b: Array) -> Array:
    """The rotation `b` followed by the rotation `a`."""
    aw, ax, ay, az = a.tolist()
    bw, bx, by, bz = b.tolist()
    return np.array(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ]
    )


def inverse(a: Array) -> Array:
    """The inverse rotation."""
    w, x, y, z = a.tolist()
    return np.array([w, -x, -y, -z])


def matrix(a: Array) -> Array:
    """The matrix (3, 3) of a rotation."""
    w, x, y, z = (a / np.linalg.norm(a)).tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def from_vector(vector: Array) -> Array:
    """The rotation by |vector| (rad) about its direction."""
    x, y, z = vector.tolist()
    angle = math.sqrt(x * x + y * y + z * z)
    # sin(angle / 2) / angle, also at 0.
    share = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    return np.array([math.cos(0.5 * angle), x * share, y * share, z * share])


def to_vector(a: Array) -> Array:
    """The rotation vector (rad), of at most half a turn."""
    w, x, y, z = a.tolist()
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    share = 2.0 if sine < 1e-9 else 2.0 * math.atan2(sine, w) / sine
    return np.array([x * share, y * share, z * share])


def between(a: Array, b: Array) -> Array:
    """The rotation vector (rad) that leads from `a` to `b`."""
    return to_vector(multiply(b, inverse(a)))
