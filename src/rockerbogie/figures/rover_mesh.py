"""Triangles of rovers: body, rockers, bogies, wheels; left blue, right vermilion."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgb
from numpy.typing import ArrayLike, NDArray

from ..rotations import rotation_y
from ..rover.frames import ON_BOGIE, WHEEL_SIDE, wheel_frames
from ..rover.model import Rover
from .render import Mesh
from .style import LEFT, RIGHT

Array = NDArray[np.float64]

_ROCKER = (np.array(to_rgb(LEFT)), np.array(to_rgb(RIGHT)))
_BOGIE = tuple(0.45 * c + 0.55 for c in _ROCKER)  # the same, paler
_BODY, _JOINT, _TYRE, _TREAD, _PLATE, _MARK = (
    np.array(to_rgb(c)) for c in ("#e9e4d6", "#303236", "#3a3c40", "#54575c", "#b9bcc0", "#f4d35e")
)
_SEGMENTS = 48


def rover_mesh(
    rover: Rover,
    T_world_body: ArrayLike,
    rocker: float,
    bogie: ArrayLike,
    steering: ArrayLike | None = None,
    wheel_turn: ArrayLike = 0.0,
) -> Mesh:
    """Return the rover in the world frame.

    A wheel of width 0 is drawn with some width, and links are drawn inboard of their wheels.

    Args:
        rover: the rover.
        T_world_body: (4, 4) pose of the body.
        rocker: angle of the left rocker, rad.
        bogie: (2,) angles of the bogies, rad.
        steering: (6,) rad; None: 0.
        wheel_turn: (6,) or one angle by which the wheels have turned, rad.

    Returns:
        The mesh, m.
    """
    T = np.asarray(T_world_body, dtype=float)
    axles = wheel_frames(rover, rocker, bogie, steering)
    turned = np.broadcast_to(np.asarray(wheel_turn, dtype=float), (6,))
    arm = np.array([rocker, float(rover.right_rocker(rocker))])
    hang = np.asarray(bogie, dtype=float)
    thick = 0.16 * float(rover.wheel_radius.mean())
    pivots = [rover.rocker_pivot[s] + rotation_y(arm[s]) @ (rover.bogie_pivot[s] - rover.rocker_pivot[s]) for s in (0, 1)]

    parts = [_box(rover.body_box, 0.15 * thick), _tube(rover.rocker_pivot[0], rover.rocker_pivot[1], 0.8 * thick, _JOINT)]
    for s in (0, 1):
        across = np.array([0.0, 1.5 * thick, 0.0])
        parts.append(_tube(rover.rocker_pivot[s], pivots[s], thick, _ROCKER[s]))
        parts += [_tube(p - across, p + across, 1.5 * thick, _JOINT) for p in (rover.rocker_pivot[s], pivots[s])]
    for i in range(6):
        s = WHEEL_SIDE[i]
        pivot = rover.rocker_pivot[s]
        start, rest, tilt, colour = (
            (pivots[s], rover.bogie_pivot[s], arm[s] + hang[s], _BOGIE[s]) if ON_BOGIE[i] else (pivot, pivot, arm[s], _ROCKER[s])
        )
        width = max(float(rover.wheel_width[i]), 0.35 * float(rover.wheel_radius[i]))
        inboard = np.array([0.0, (-1.0 if s == 0 else 1.0) * (width / 2 + thick), 0.0])
        axle = axles[i]
        foot = axle[:3, :3] @ inboard + axle[:3, 3]
        if rover.steers[i]:  # an upright above the wheel, and a bracket down to the axle
            top = rover.hubs[i] + np.append(rover.steering_offset[i], 1.3 * rover.wheel_radius[i])
            elbow = start + rotation_y(tilt) @ (top - rest)
            inner = elbow + axle[:3, :3] @ inboard
            parts += [_tube(start, elbow, thick, colour), _tube(elbow, inner, thick, _JOINT)]
            parts.append(_tube(inner, foot, 0.8 * thick, _JOINT))
        else:
            parts.append(_tube(start, foot, thick, colour))
        parts.append(_tube(foot, axle[:3, 3], 0.8 * thick, _JOINT))
        parts.append(_wheel(axle, float(rover.wheel_radius[i]), width, float(turned[i])))
    mesh = Mesh.join(parts)
    return Mesh(mesh.corners @ T[:3, :3].T + T[:3, 3], mesh.normals @ T[:3, :3].T, mesh.colours, mesh.ruled)


def _fan(quads: Array) -> Array:
    """Return triangles (2n, 3, ...) of quadrilaterals (n, 4, ...)."""
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _box(box: Array, edge: float) -> Mesh:
    corner = np.array([[box[i, 0], box[j, 1], box[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    rims = [_tube(corner[i], corner[i + step], edge, _JOINT, 6) for step in (1, 2, 4) for i in range(8) if not i & step]
    return Mesh.join([Mesh.flat(_fan(corner[np.array(faces)]), _BODY), *rims])


def _tube(start: Array, end: Array, radius: float, colour: Array, sides: int = 14) -> Mesh:
    along = end - start
    length = float(np.linalg.norm(along))
    along = along / max(length, 1e-12)
    first = np.cross(along, np.eye(3)[int(np.argmin(np.abs(along)))])
    first /= np.linalg.norm(first)
    turn = np.linspace(0, 2 * np.pi, sides + 1)[:, None]
    ring = np.cos(turn) * first + np.sin(turn) * np.cross(along, first)
    near, far = start + radius * ring, end + radius * ring
    side = _fan(np.stack([near[:-1], near[1:], far[1:], far[:-1]], axis=1))
    normal = _fan(np.stack([ring[:-1], ring[1:], ring[1:], ring[:-1]], axis=1))
    caps = [np.stack([np.broadcast_to(p, ring[1:].shape), r[:-1], r[1:]], axis=1) for p, r in ((start, near), (end, far))]
    return Mesh.join([Mesh.smooth(side, normal, colour), Mesh.flat(np.concatenate(caps), colour)])


def _wheel(T: Array, radius: float, width: float, turned: float) -> Mesh:
    """Return a tyre with cleats and a marked plate, which show its rotation."""
    angle = np.linspace(0, 2 * np.pi, _SEGMENTS + 1) + turned
    spoke = np.stack([np.sin(angle), np.zeros_like(angle), np.cos(angle)], axis=1)
    half = np.array([0.0, width / 2, 0.0])
    cleat = np.where(np.arange(_SEGMENTS) % 3 == 0, 0, 1)
    tread = np.stack([_TREAD, _TYRE])[cleat]
    rim = radius * spoke
    parts = [
        Mesh.smooth(
            _fan(np.stack([rim[:-1] - half, rim[1:] - half, rim[1:] + half, rim[:-1] + half], axis=1)),
            _fan(np.stack([spoke[:-1], spoke[1:], spoke[1:], spoke[:-1]], axis=1)),
            np.concatenate([tread, tread]),
        )
    ]
    plate = np.where((np.arange(_SEGMENTS) < 4)[:, None], _MARK, _PLATE)
    for side in (-half, half):
        for outer, inner, colour in ((1.0, 0.8, _TYRE), (0.8, 0.25, np.concatenate([plate, plate])), (0.25, 0.0, _JOINT)):
            a, b = rim * outer + side, rim * inner + side
            parts.append(Mesh.flat(_fan(np.stack([a[:-1], a[1:], b[1:], b[:-1]], axis=1)), colour))
    mesh = Mesh.join(parts)
    return Mesh(mesh.corners @ T[:3, :3].T + T[:3, 3], mesh.normals @ T[:3, :3].T, mesh.colours, mesh.ruled)
