"""Grounds and rovers on which settled poses are held against MuJoCo at rest, and the comparison itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import rockerbogie as rb
from support.rigid_drop import DropTower, Rest

CELLS = 3200  # across a ground of solid shapes: so finely that bilinear ground stands for them within 0.03 mm
NUDGE = (1e-3, 1e-3, np.radians(0.1))  # m, m, rad
SUNK = 0.6  # of a rock's half height lies below the plane


@dataclass(frozen=True)
class Ground:
    """A terrain, and the geoms MuJoCo is given for it (None: the terrain itself as a height field)."""

    name: str
    terrain: rb.Terrain
    geoms: Sequence[Mapping[str, Any]] | None = None


def solids(size: float, seed: int) -> Ground:
    """A plane with boxes on it and ellipsoid rocks sunk into it, `size` m across; sizes grow with it.

    Both sides are given the same surface: a height field's wall leans by one cell, so the boxes' walls do; and rocks
    are sunk so far that their flanks are no steeper than 47 deg, lest the grid's steps make notches in them.
    """
    rng = np.random.default_rng(seed)
    cell = size / CELLS
    axis = cell * np.arange(CELLS + 1) - size / 2
    x, y = np.meshgrid(axis, axis)
    z = np.zeros_like(x)
    geoms: list[dict[str, Any]] = [{"type": "plane", "size": [0, 0, 1], "pos": [0, 0, 0]}]
    for _ in range(60):
        at = rng.uniform(-0.45, 0.45, 2) * size
        half = rng.uniform(0.015, 0.05, 2) * size
        high = rng.uniform(0.3, 0.8) * half.min()
        inside = 1 - ((x - at[0]) / half[0]) ** 2 - ((y - at[1]) / half[1]) ** 2
        z = np.maximum(z, high * (np.sqrt(np.maximum(inside, 0)) - SUNK))
        geoms.append({"type": "ellipsoid", "size": [*half, high], "pos": [*at, -SUNK * high]})
    for _ in range(25):  # edges on grid lines, so that the sampled edge is the solid one
        at = cell * np.round(rng.uniform(-0.45, 0.45, 2) * size / cell)
        half = cell * np.round(rng.uniform(0.01, 0.05, 2) * size / cell)
        height = rng.uniform(0.002, 0.012) * size
        over = (np.abs(x - at[0]) <= half[0] + 1e-9) & (np.abs(y - at[1]) <= half[1] + 1e-9)
        z = np.where(over, np.maximum(z, height), z)
        foot = half + cell
        corners = [[sx * h[0], sy * h[1], up] for h, up in ((foot, 0.0), (half, height)) for sx in (-1, 1) for sy in (-1, 1)]
        geoms.append({"type": "mesh", "vertices": corners, "pos": [*at, 0.0]})
    terrain = rb.Terrain.from_array(z, cell, (-size / 2, -size / 2), interpolation="linear", name="planes, boxes, ellipsoids")
    return Ground(terrain.name, terrain, geoms)


def field(size: float, seed: int) -> Ground:
    """A field of rocks by the size-frequency law, k = 10 %."""
    terrain = rb.surfaces.rocks(0.1, seed, size=size, spacing=0.05, interpolation="linear")
    return Ground("rock field", terrain)


def load(name: str) -> rb.Rover:
    """A preset. MuJoCo has no wheel without width, so the paper's thin discs are given 5 cm, here and there alike."""
    rover = rb.load_rover(name)
    return rover if rover.wheel_width.any() else rover.replace(wheel_width=np.full(6, 0.05))


def stiff(rover: rb.Rover) -> rb.Rover:
    """The rover with close stops, so that joints come to rest on them and wheels hang."""
    return rover.replace(rocker_limits=np.radians([-3.0, 3.0]), bogie_limits=np.radians([-5.0, 5.0]))


@dataclass(frozen=True)
class Agreement:
    """Differences where both are at rest with the same wheels lifted and the same stops reached; and the other poses."""

    z: np.ndarray  # (n,) m
    angles: np.ndarray  # (n, 5) roll, pitch, rocker, bogies, rad
    poses: int
    lifted: int  # poses in which a wheel hangs
    stopped: int  # poses in which a joint lies on a stop
    marginal: int  # of the others: by a hair, or one that a nudge turns into the other's (`_is_marginal`)
    held: int  # of the others: MuJoCo, started at our pose, stays there, so that both are rests
    unlike: list[str]  # each pose that differs, in a line

    @property
    def share(self) -> float:
        """Of the poses, how many have the same wheels lifted and stops reached when let down from above."""
        return len(self.z) / self.poses

    @property
    def share_of_rests(self) -> float:
        """Of the poses, how many are rests of MuJoCo's too."""
        return (len(self.z) + self.held) / self.poses


def compare(rover: rb.Rover, ground: Ground, poses: int, seed: int) -> Agreement:
    """Settle by equilibrium and drop in MuJoCo at seeded places."""
    rng = np.random.default_rng(seed)
    x0, y0, x1, y1 = ground.terrain.bounds
    edge = 1.2 * rover.wheelbase
    x, y, yaw = (
        rng.uniform(x0 + edge, x1 - edge, poses),
        rng.uniform(y0 + edge, y1 - edge, poses),
        rng.uniform(-np.pi, np.pi, poses),
    )
    ours = rb.settle(rover, ground.terrain, x, y, yaw, mode="equilibrium")
    tower = DropTower(rover, ground.geoms if ground.geoms is not None else ground.terrain)
    heights, angles, unlike = [], [], []
    lifted = stopped = marginal = held = 0
    for k in range(poses):
        rest, own = tower.drop(x[k], y[k], yaw[k]), _of(ours, k)
        lifted += bool(rest.lifted.any())
        stopped += bool(rest.on_stop.any())
        if rest.at_rest and _alike(rest, own):
            heights.append(rest.z - own.z)
            angles.append(_angles(rest) - _angles(own))
            continue
        again = tower.drop(x[k], y[k], yaw[k], start=ours.q[k]) if np.isfinite(own.z) else None
        stays = again is not None and again.at_rest and _alike(again, own)
        hair = _is_marginal(rover, ground.terrain, tower, (x[k], y[k], yaw[k]), rest, own)
        held += stays
        marginal += hair
        unlike.append(
            f"pose {k}: {rb.Status(int(ours.status[k])).name}, {'marginal' if hair else 'not marginal'}, "
            f"{'holds' if stays else 'does not hold'} in MuJoCo; its own is "
            f"{np.degrees(np.abs(_angles(rest) - _angles(own)).max()):.2f} deg and {1e3 * (rest.z - own.z):.2f} mm away, "
            f"lifted {rest.lifted.astype(int)} / {own.lifted.astype(int)}, "
            f"stops {rest.on_stop.astype(int)} / {own.on_stop.astype(int)}, at rest {rest.at_rest}"
        )
    return Agreement(np.array(heights), np.array(angles), poses, lifted, stopped, marginal, held, unlike)


@dataclass(frozen=True)
class Own:
    """Of a pose of ours what a `Rest` has too."""

    z: float
    roll: float
    pitch: float
    rocker: float
    bogie: np.ndarray
    lifted: np.ndarray
    on_stop: np.ndarray
    gap: np.ndarray


def _of(pose: rb.Pose, k: int) -> Own:
    z, roll, pitch, rocker, *bogie = pose.q[k]
    return Own(z, roll, pitch, rocker, np.array(bogie), pose.wheel_lifted[k], pose.joint_stop[k] != 0, pose.gap[k])


def _angles(rest: Rest | Own) -> np.ndarray:
    return np.array([rest.roll, rest.pitch, rest.rocker, *rest.bogie])


def _alike(one: Rest | Own, other: Rest | Own) -> bool:
    """The same wheels in the air, the same stops reached, and no joint 2 deg elsewhere."""
    same = np.array_equal(one.lifted, other.lifted) and np.array_equal(one.on_stop, other.on_stop)
    return bool(same and np.abs(_angles(one) - _angles(other)).max() < np.radians(2))


def _is_marginal(
    rover: rb.Rover, terrain: rb.Terrain, tower: DropTower, place: tuple[float, float, float], rest: Rest, own: Own
) -> bool:
    """Whether two rests differ by a hair, or which of them it comes to hangs on one.

    By a hair: the poses agree within 0.1 deg and 0.2 mm, and only whether a wheel within 0.2 mm of the ground touches, or a
    joint within 0.1 deg of its stop lies on it, is told differently. Hanging on one: moved by 1 mm to any side or turned
    by 0.1 deg to either, our rover comes to MuJoCo's rest or MuJoCo's to ours.
    """
    if np.isfinite(own.z) and np.abs(_angles(rest) - _angles(own)).max() < np.radians(0.1) and abs(rest.z - own.z) < 2e-4:
        return bool((own.gap[rest.lifted != own.lifted] < 2e-4).all())
    for nudge in np.vstack([np.diag(NUDGE), -np.diag(NUDGE)]):
        there = np.add(place, nudge)
        ours = rb.settle(rover, terrain, *there[:, None], mode="equilibrium")
        if rest.at_rest and _alike(_of(ours, 0), rest):
            return True
        theirs = tower.drop(*there)
        if theirs.at_rest and _alike(theirs, own):
            return True
    return False
