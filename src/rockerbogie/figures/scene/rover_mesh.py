"""Meshes of rovers: parts in the frames of their links, and the frames of a pose.

Left is blue and right vermilion, as in the charts. Sizes that a rover does not give (tube diameters, the differential bar, the
height of the steering) are shares of its wheel radius and of its body box. A wheel of width 0 is drawn with some width.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Array
from ...rover.frames import ON_BOGIE, WHEEL_SIDE, wheel_frames
from ...rover.model import Rover
from ...rover.rotations import rotation_y, rotation_z
from .mesh import Part, Solid, aim, box, colour_of, convex, join, lathe, tube

SIDES = ("left", "right")
#: Links of a rover; a part's transform is `link_transforms(...)[..., LINKS.index(part.link), :, :]`.
LINKS = (
    *("body", "differential_bar", "rod_left", "rod_right", "rocker_left", "rocker_right", "bogie_left", "bogie_right"),
    *(f"fork_{i}" for i in range(6)),
    *(f"wheel_{i}" for i in range(6)),
)
LEFT, RIGHT = colour_of("#0072B2"), colour_of("#D55E00")
_ROCKER = (LEFT, RIGHT)
_BOGIE = (colour_of("#8CBFDD"), colour_of("#EDB68C"))
_BODY, _DECK, _JOINT, _BAR = (colour_of(code) for code in ("#e9e4d6", "#4a4e57", "#303236", "#a9adb3"))
_TYRE, _GROUSER, _SPOKE, _MARK, _LENS = (colour_of(code) for code in ("#46494e", "#6d7177", "#b9bcc0", "#f4d35e", "#15171a"))
_GROUSERS, _SPOKES, _SEGMENTS = 24, 8, 48
#: Ratios of the differential, right over −left, at which a bar is drawn; else a shaft joins the rockers.
_BAR_RATIOS = (0.3, 3.0)


@lru_cache(maxsize=32)
def rover_parts(rover: Rover, light: bool = False) -> tuple[Part, ...]:
    """Return the parts of a rover.

    Args:
        rover: the rover.
        light: half as many triangles: wheels without grousers.

    Returns:
        Parts in the frames of their links (`LINKS`). At rest a link's frame is parallel to the body's; its origin is the body's
        (body), the joint (bar, rockers, bogies) or the hub (forks, wheels). A rod's y axis points from bar to rocker.
    """
    parts = [*_body(rover), *_differential(rover)]
    for s in (0, 1):
        parts += _rocker(rover, s) + _bogie(rover, s)
    for i in range(6):
        parts += _fork(rover, i) + _wheel(rover, i, light)
    return tuple(parts)


def link_transforms(
    rover: Rover,
    T_world_body: ArrayLike,
    rocker: ArrayLike,
    bogie: ArrayLike,
    steering: ArrayLike | None = None,
    wheel_turn: ArrayLike = 0.0,
) -> Array:
    """Return the frames of a rover's links in the world.

    Args:
        rover: the rover.
        T_world_body: (..., 4, 4) pose of the body.
        rocker: (...) angle of the left rocker, rad.
        bogie: (..., 2) angles of the bogies, rad.
        steering: (..., 6) rad; None: 0.
        wheel_turn: (..., 6) or one angle by which the wheels have turned, forward positive, rad.

    Returns:
        (..., 20, 4, 4) T_world_link in the order of `LINKS`.

    Raises:
        RockerbogieError: a shape that does not fit, or steering on a wheel that does not steer.
    """
    q, swing = np.asarray(rocker, dtype=float), np.asarray(bogie, dtype=float)
    axles = wheel_frames(rover, q, swing, steering)
    batch = axles.shape[:-3]
    q, swing = np.broadcast_to(q, batch), np.broadcast_to(swing, (*batch, 2))
    arm = np.stack([q, rover.right_rocker(q)], axis=-1)
    T = np.zeros((*batch, len(LINKS), 4, 4))
    T[..., 3, 3] = 1.0
    T[..., 0, :3, :3] = np.eye(3)
    T[..., 4:6, :3, :3] = rotation_y(arm)
    T[..., 4:6, :3, 3] = rover.rocker_pivot
    T[..., 6:8, :3, :3] = rotation_y(arm + swing)
    T[..., 6:8, :3, 3] = rover.rocker_pivot + np.einsum(
        "...ij,...j->...i", rotation_y(arm), rover.bogie_pivot - rover.rocker_pivot
    )
    T[..., 8:14, :, :] = axles
    turn = np.zeros((*batch, 6, 4, 4))
    turn[..., :3, :3] = rotation_y(np.broadcast_to(np.asarray(wheel_turn, dtype=float), (*batch, 6)))
    turn[..., 3, 3] = 1.0
    T[..., 14:20, :, :] = axles @ turn
    _place_differential(rover, arm, T)
    return np.asarray(np.asarray(T_world_body, dtype=float)[..., None, :, :] @ T)


def tube_radius(rover: Rover) -> float:
    """Return the radius with which the tubes of a rover are drawn.

    Args:
        rover: the rover.

    Returns:
        m.
    """
    return 0.16 * float(rover.wheel_radius.mean())


def drawn_width(rover: Rover, wheel: int) -> float:
    """Return the width with which a wheel is drawn.

    Args:
        rover: the rover.
        wheel: its index.

    Returns:
        Its width, at least 0.35 of its radius, m.
    """
    return max(float(rover.wheel_width[wheel]), 0.35 * float(rover.wheel_radius[wheel]))


def _outward(side: int) -> float:
    """Return the sign of y on a side."""
    return 1.0 if side == 0 else -1.0


def _shoulder(rover: Rover, side: int) -> float:
    """Return the y of a rocker's arm at its pivot: outside the body's box, m."""
    pivot = float(rover.rocker_pivot[side, 1])
    wall = float(rover.body_box[1 - side, 1]) + _outward(side) * 1.5 * tube_radius(rover)
    return max(pivot, wall) if side == 0 else min(pivot, wall)


def _body(rover: Rover) -> list[Part]:
    """Return the body: its box, a deck, two lenses at the front, the shaft of the rockers."""
    low, high = rover.body_box
    size = high - low
    thin, edge = 0.1 * float(size[2]), 0.06 * float(size.min())
    eye = 0.07 * float(min(size[1], size[2]))
    centre, above = float(low[1] + high[1]) / 2, float(low[2]) + 0.72 * float(size[2])
    lenses = [
        tube((high[0] - eye, centre + y, above), (high[0] + 0.6 * eye, centre + y, above), eye) for y in (-2.2 * eye, 2.2 * eye)
    ]
    shaft = [np.array([rover.rocker_pivot[s, 0], _shoulder(rover, s), rover.rocker_pivot[s, 2]]) for s in (0, 1)]
    deck = box(low + (edge, edge, size[2] - 1.2 * thin), high - (edge, edge, 0.0), 0.3 * thin)
    return [
        _part("body", "body", [box(low, high - (0, 0, 0.4 * thin), edge)], _BODY),
        _part("deck", "body", [deck], _DECK),
        _part("lenses", "body", lenses, _LENS),
        _part("shaft", "body", [tube(shaft[0], shaft[1], 0.8 * tube_radius(rover))], _JOINT),
    ]


def _bar_points(rover: Rover) -> tuple[Array, Array, Array] | None:
    """Return pivot (3,) and ends (2, 3) of the bar, and the horns (2, 3), at rest, m.

    None is returned for a rover that is drawn without a bar.
    """
    slope = float(rover.differential[1]) if len(rover.differential) > 1 else 0.0
    if not _BAR_RATIOS[0] <= -slope <= _BAR_RATIOS[1]:
        return None
    t = tube_radius(rover)
    low, high = rover.body_box
    pivot = rover.rocker_pivot
    y = np.array([_shoulder(rover, s) for s in (0, 1)])
    top = max(float(high[2]), float(pivot[:, 2].max()) + 1.5 * t) + 1.2 * t
    height = top - pivot[:, 2]
    height[1] = height[0] / -slope  # both horns then move the bar's ends alike
    horns = np.stack([pivot[:, 0], y, pivot[:, 2] + height], axis=1)
    centre = float(low[0] + high[0]) / 2
    towards = -1.0 if centre <= float(pivot[0, 0]) else 1.0
    rod = 0.25 * float(high[0] - low[0])
    middle = np.array([float(pivot[:, 0].mean()) + towards * rod, float(y.mean()), top])
    ends = np.stack([np.full(2, middle[0]), y, np.full(2, top)], axis=1)
    return middle, ends, horns


def _differential(rover: Rover) -> list[Part]:
    """Return the bar across the deck, its post and its rods; no part without a bar."""
    points = _bar_points(rover)
    if points is None:
        return []
    middle, ends, horns = points
    t = tube_radius(rover)
    deck = min(float(rover.body_box[1, 2]), float(middle[2])) - middle[2]
    left, right = ends - middle
    bar = [tube((0, 0, 0), end, 0.9 * t, 0.55 * t) for end in (left, right)]
    out = [
        _part("differential_bar", "differential_bar", bar, _BAR),
        _part("differential_post", "differential_bar", [tube((0, 0, deck - t), (0, 0, 0.9 * t), 1.2 * t)], _JOINT),
        _part("bar_joints", "differential_bar", [tube(e - (0, 0, t), e + (0, 0, t), 0.8 * t) for e in (left, right)], _JOINT),
    ]
    for s, side in enumerate(SIDES):
        length = float(np.linalg.norm(horns[s] - ends[s]))
        out.append(_part(f"rod_{side}", f"rod_{side}", [tube((0, 0, 0), (0, length, 0), 0.4 * t)], _BAR))
    return out


def _place_differential(rover: Rover, arm: Array, T: Array) -> None:
    """Write the frames of bar and rods in the body; identities without a bar."""
    points = _bar_points(rover)
    if points is None:
        T[..., 1:4, :3, :3] = np.eye(3)
        return
    middle, ends, horns = points
    horn = rover.rocker_pivot + np.einsum("...sij,sj->...si", rotation_y(arm), horns - rover.rocker_pivot)
    push = (horn - horns)[..., 0]  # (..., 2) forward motion of the horns
    half = float(ends[0, 1] - ends[1, 1]) / 2
    yaw = -np.arcsin(np.clip((push[..., 0] - push[..., 1]) / (2 * half), -0.9, 0.9))
    T[..., 1, :3, :3] = rotation_z(yaw)
    T[..., 1, :3, 3] = middle
    end = middle + np.einsum("...ij,kj->...ki", rotation_z(yaw), ends - middle)
    T[..., 2:4, :3, :3] = aim(horn - end)
    T[..., 2:4, :3, 3] = end


def _rocker(rover: Rover, side: int) -> list[Part]:
    """Return a rocker: arms to its wheel and to the bogie, joints, and the horn."""
    t, pivot = tube_radius(rover), rover.rocker_pivot[side]
    link, outward = f"rocker_{SIDES[side]}", _outward(side)
    shoulder = np.array([0.0, _shoulder(rover, side) - pivot[1], 0.0])
    knuckle = rover.bogie_pivot[side] - pivot
    arms, metal = _leg(rover, side, shoulder, pivot)
    arms.append(tube(shoulder, knuckle, t))
    across = np.array([0.0, 1.5 * t, 0.0])
    metal += [tube(shoulder - across, shoulder + across, 1.7 * t), tube(knuckle - across, knuckle + across, 1.5 * t)]
    points = _bar_points(rover)
    if points is not None:
        horn = points[2][side] - pivot
        arms.append(tube(shoulder + (0, -0.2 * outward * t, 0), horn, 0.7 * t, 0.5 * t))
        metal.append(tube(horn - 0.6 * across, horn + 0.6 * across, 0.8 * t))
    return [_part(link, link, arms, _ROCKER[side]), _part(f"{link}_joints", link, metal, _JOINT)]


def _bogie(rover: Rover, side: int) -> list[Part]:
    """Return a bogie: arms to its two wheels, and joints."""
    link, pivot = f"bogie_{SIDES[side]}", rover.bogie_pivot[side]
    arms: list[Solid] = []
    metal: list[Solid] = []
    for i in (2 + side, 4 + side):
        more, joints = _leg(rover, i, np.zeros(3), pivot)
        arms += more
        metal += joints
    return [_part(link, link, arms, _BOGIE[side]), _part(f"{link}_joints", link, metal, _JOINT)]


def _leg(rover: Rover, wheel: int, start: Array, pivot: Array) -> tuple[list[Solid], list[Solid]]:
    """Return the arm from a joint to a wheel and its joints, relative to the pivot.

    If the wheel steers, the arm ends at the steering drive above it; else at a stub axle on its inner side.

    Args:
        rover: the rover.
        wheel: index of the wheel.
        start: (3,) start of the arm relative to the pivot, m.
        pivot: (3,) m.

    Returns:
        Solids of the arm, and of its other parts: steering drive, or stub axle and elbow.
    """
    t, hub = tube_radius(rover), rover.hubs[wheel] - pivot
    if rover.steers[wheel]:
        low = hub + np.append(rover.steering_offset[wheel], _crown(rover, wheel))
        top = low + (0.0, 0.0, 3.2 * t)
        return [tube(start, (low + top) / 2, t, 0.85 * t)], [tube(low, top, 1.35 * t)]
    foot = hub + (0.0, _inboard(rover, wheel), 0.0)
    near = 1.1 * float(rover.wheel_radius[wheel]) / max(float(np.hypot(*(foot - start)[[0, 2]])), 1e-9)
    beside = abs(float((foot + min(near, 1.0) * (start - foot) - hub)[1]))
    metal = [tube(foot + (0, _outward(WHEEL_SIDE[wheel]) * -t, 0), hub, 0.8 * t)]
    if beside < drawn_width(rover, wheel) / 2 + 0.9 * t:  # the arm would cut the wheel: it starts on the wheel's inner side
        inner = np.array([start[0], foot[1], start[2]])
        metal.append(tube(start, inner, 1.5 * t))
        metal.append(tube(inner - (0, 1.3 * t, 0), inner + (0, 1.3 * t, 0), 1.5 * t))
        start = inner
    return [tube(start, foot, t)], metal


def _crown(rover: Rover, wheel: int) -> float:
    """Return the height of a steering drive's lower end above the hub, m."""
    return 1.2 * float(rover.wheel_radius[wheel]) + 0.5 * tube_radius(rover)


def _inboard(rover: Rover, wheel: int) -> float:
    """Return the y, from the hub, of the middle of the arm beside a wheel, m."""
    return -_outward(WHEEL_SIDE[wheel]) * (drawn_width(rover, wheel) / 2 + tube_radius(rover))


def _fork(rover: Rover, wheel: int) -> list[Part]:
    """Return the part between steering axis and axle; no part if the wheel does not steer."""
    if not rover.steers[wheel]:
        return []
    t, radius = tube_radius(rover), float(rover.wheel_radius[wheel])
    ox, oy = (float(v) for v in rover.steering_offset[wheel])
    top, y = _crown(rover, wheel), _inboard(rover, wheel)
    thick, long = 0.45 * t, 1.1 * t
    crown = [(ox + a * 1.2 * t, oy + b * 1.2 * t) for a in (-1, 1) for b in (-1, 1)]
    crown += [(a * long, y + b * thick) for a in (-1, 1) for b in (-1, 1)]
    plate = convex([(px, py, top + dz) for px, py in crown for dz in (-1.2 * t, 0.0)])
    arm = convex(
        [(a * long, y + b * thick, top) for a in (-1, 1) for b in (-1, 1)]
        + [(a * 0.9 * t, y + b * thick, -0.9 * t) for a in (-1, 1) for b in (-1, 1)]
    )
    axle = tube((0, y - _outward(WHEEL_SIDE[wheel]) * thick * 1.6, 0), (0, 0, 0), min(1.1 * t, 0.3 * radius))
    link = f"fork_{wheel}"
    side = WHEEL_SIDE[wheel]
    colour = _BOGIE[side] if ON_BOGIE[wheel] else _ROCKER[side]
    return [_part(link, link, [plate, arm], colour), _part(f"{link}_axle", link, [axle], _JOINT)]


def _wheel(rover: Rover, wheel: int, light: bool) -> list[Part]:
    """Return a wheel: rim, grousers that reach its radius, hub and spokes.

    Without grousers, the rim reaches the radius. One spoke has another colour, to show the rotation.
    """
    link, radius, width = f"wheel_{wheel}", float(rover.wheel_radius[wheel]), drawn_width(rover, wheel)
    half, outer, inner, hub = width / 2, (1.0 if light else 0.95) * radius, 0.84 * radius, 0.24 * radius
    segments, sides, count = (20, 10, 4) if light else (_SEGMENTS, 24, _SPOKES)
    rim = lathe([(inner, -half), (outer, -half), (outer, half), (inner, half), (inner, -half)], segments)
    core = lathe([(0.0, -0.6 * half), (hub, -0.6 * half), (hub, 0.8 * half), (0.0, 0.8 * half)], sides)
    core = Solid(core.vertices * (1.0, _outward(WHEEL_SIDE[wheel]), 1.0), core.faces)
    if WHEEL_SIDE[wheel]:
        core = Solid(core.vertices, core.faces[:, ::-1])
    grousers = []
    for k in range(0 if light else _GROUSERS):
        wide = 0.018 * radius
        points = [(a * wide * f, y, z) for a in (-1, 1) for y in (-half, half) for z, f in ((0.93 * radius, 1.6), (radius, 1.0))]
        grousers.append(_turned(convex(points), 2 * np.pi * k / _GROUSERS))
    spokes = []
    for k in range(count):
        points = [
            (a * w, y, z)
            for a in (-1, 1)
            for z, w, deep in ((0.9 * hub, 0.09 * radius, 0.5), (0.86 * radius, 0.05 * radius, 0.22))
            for y in (-deep * half, deep * half)
        ]
        spokes.append(_turned(convex(points), 2 * np.pi * k / count))
    return [
        _part("rim", link, [rim], _TYRE),
        *([_part("grousers", link, grousers, _GROUSER)] if grousers else []),
        _part("spokes", link, spokes[1:], _SPOKE),
        _part("marked_spoke", link, spokes[:1], _MARK),
        _part("hub", link, [core], _JOINT),
    ]


def _turned(solid: Solid, angle: float) -> Solid:
    """Return a solid turned about the y axis."""
    return Solid(solid.vertices @ rotation_y(angle).T, solid.faces)


def _part(name: str, link: str, solids: list[Solid], colour: tuple[float, float, float]) -> Part:
    """Return a part of several solids."""
    return Part(name, link, *join(solids), colour)
