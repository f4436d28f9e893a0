"""Grounds and rovers on which settled poses are held against MuJoCo at rest, and the comparison itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import rockerbogie as rb
from rigid_drop import DropTower, Rest

CELL = 0.005  # m: solid shapes are sampled so finely that bilinear ground stands for them within 0.02 mm


@dataclass(frozen=True)
class Ground:
    """A terrain, and the geoms MuJoCo is given for it (None: the terrain itself as a height field)."""

    name: str
    terrain: rb.Terrain
    geoms: Sequence[Mapping[str, Any]] | None = None


def solids(size: float, seed: int) -> Ground:
    """A plane with ellipsoid rocks half sunk in it and boxes on it, `size` m across; sizes grow with it."""
    rng = np.random.default_rng(seed)
    nodes = round(size / CELL) + 1
    axis = CELL * np.arange(nodes) - size / 2
    x, y = np.meshgrid(axis, axis)
    z = np.zeros_like(x)
    geoms: list[dict[str, Any]] = [{"type": "plane", "size": [0, 0, 1], "pos": [0, 0, 0]}]
    for _ in range(60):
        at = rng.uniform(-0.45, 0.45, 2) * size
        half = rng.uniform(0.01, 0.04, 3) * size * (1, 1, 0.6)
        inside = 1 - ((x - at[0]) / half[0]) ** 2 - ((y - at[1]) / half[1]) ** 2
        z = np.maximum(z, np.where(inside > 0, half[2] * np.sqrt(np.maximum(inside, 0)), 0))
        geoms.append({"type": "ellipsoid", "size": half.tolist(), "pos": [*at, 0.0]})
    for _ in range(25):  # edges on grid lines, so that the sampled edge is the solid one
        at = CELL * np.round(rng.uniform(-0.45, 0.45, 2) * size / CELL)
        half = CELL * np.round(rng.uniform(0.01, 0.05, 2) * size / CELL)
        height = rng.uniform(0.002, 0.012) * size
        over = (np.abs(x - at[0]) <= half[0] + 1e-9) & (np.abs(y - at[1]) <= half[1] + 1e-9)
        z = np.where(over, np.maximum(z, height), z)
        geoms.append({"type": "box", "size": [*half, height], "pos": [*at, 0.0]})
    terrain = rb.Terrain.from_array(z, CELL, (-size / 2, -size / 2), interpolation="linear", name="planes, boxes, ellipsoids")
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
    alike: int
    lifted: int  # poses in which a wheel hangs
    stopped: int  # poses in which a joint lies on a stop
    held: int  # of the others: MuJoCo, started at our pose, stays there, so that both are rests and the way down decides
    unlike: list[str]  # each pose that differs, in a line

    @property
    def share(self) -> float:
        """Of the poses, how many have the same wheels lifted and stops reached when let down from above."""
        return self.alike / self.poses

    @property
    def share_of_rests(self) -> float:
        """Of the poses, how many are rests of MuJoCo's too."""
        return (self.alike + self.held) / self.poses


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
    lifted = stopped = held = 0
    for k in range(poses):
        rest = tower.drop(x[k], y[k], yaw[k])
        lifted += bool(rest.lifted.any())
        stopped += bool(rest.on_stop.any())
        if _alike(rest, ours, k):
            heights.append(rest.z - ours.z[k])
            angles.append(_apart(rest, ours, k))
            continue
        again = tower.drop(x[k], y[k], yaw[k], start=ours.q[k]) if np.isfinite(ours.z[k]) else None
        stays = again is not None and _alike(again, ours, k)
        held += stays
        unlike.append(
            f"pose {k}: {rb.Status(int(ours.status[k])).name}, {'holds' if stays else 'does not hold'} in MuJoCo; its own is "
            f"{np.degrees(np.abs(_apart(rest, ours, k)).max()):.2f} deg and {1e3 * (rest.z - ours.z[k]):.2f} mm away, "
            f"lifted {rest.lifted.astype(int)} / {ours.wheel_lifted[k].astype(int)}, "
            f"stops {rest.on_stop.astype(int)} / {np.abs(ours.joint_stop[k])}, at rest {rest.at_rest}"
        )
    return Agreement(np.array(heights), np.array(angles), poses, len(heights), lifted, stopped, held, unlike)


def _apart(rest: Rest, ours: rb.Pose, k: int) -> np.ndarray:
    return np.array([rest.roll, rest.pitch, rest.rocker, *rest.bogie]) - ours.q[k, 1:]


def _alike(rest: Rest, ours: rb.Pose, k: int) -> bool:
    """The same wheels in the air, the same stops reached, and no joint 2 deg elsewhere."""
    same = np.array_equal(rest.lifted, ours.wheel_lifted[k]) and np.array_equal(rest.on_stop, ours.joint_stop[k] != 0)
    return bool(rest.at_rest and same and np.abs(_apart(rest, ours, k)).max() < np.radians(2))
