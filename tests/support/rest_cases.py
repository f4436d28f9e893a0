"""Terrains and rovers for the comparison of equilibria with MuJoCo, and the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

import rockerbogie as rb
from support.rigid_drop import DropTower, Rest

CELLS = 3200  # across a terrain of solid shapes: bilinear interpolation is within 0.03 mm of them
NUDGE = (1e-3, 1e-3, np.radians(0.1))  # m, m, rad
SUNK = 0.6  # share of a rock's half height that lies below the plane


@dataclass(frozen=True)
class Ground:
    """A terrain, and the same surface as MuJoCo geoms (None: a height field of the terrain)."""

    name: str
    terrain: rb.Terrain
    geoms: Sequence[Mapping[str, Any]] | None = None


def solids(size: float, seed: int) -> Ground:
    """Return a plane with boxes and partly sunk ellipsoids, `size` m across.

    All lengths scale with `size`.

    Both simulations use the same surface. A wall of a height field is inclined by one cell, and so are the walls of
    the boxes. Ellipsoids are sunk until their flanks are at most 47 deg steep, so that grid steps do not notch them.
    """
    rng = np.random.default_rng(seed)
    cell = size / CELLS
    axis = cell * np.arange(CELLS + 1) - size / 2
    z = np.zeros((CELLS + 1, CELLS + 1))

    def patch(at: np.ndarray, half: np.ndarray) -> tuple[tuple[slice, slice], np.ndarray, np.ndarray]:
        """Return the nodes of `z` within `half` and a cell of `at`, and their x (1, n) and y (m, 1)."""
        i, j = (slice(*np.searchsorted(axis, (low, high))) for low, high in zip(at - half - cell, at + half + cell, strict=True))
        return (j, i), axis[None, i], axis[j, None]

    geoms: list[dict[str, Any]] = [{"type": "plane", "size": [0, 0, 1], "pos": [0, 0, 0]}]
    for _ in range(60):
        at = rng.uniform(-0.45, 0.45, 2) * size
        half = rng.uniform(0.015, 0.05, 2) * size
        high = rng.uniform(0.3, 0.8) * half.min()
        nodes, x, y = patch(at, half)
        inside = 1 - ((x - at[0]) / half[0]) ** 2 - ((y - at[1]) / half[1]) ** 2
        z[nodes] = np.maximum(z[nodes], high * (np.sqrt(np.maximum(inside, 0)) - SUNK))
        geoms.append({"type": "ellipsoid", "size": [*half, high], "pos": [*at, -SUNK * high]})
    for _ in range(25):  # edges lie on grid lines, so that the sampled edge equals the solid one
        at = cell * np.round(rng.uniform(-0.45, 0.45, 2) * size / cell)
        half = cell * np.round(rng.uniform(0.01, 0.05, 2) * size / cell)
        height = rng.uniform(0.002, 0.012) * size
        nodes, x, y = patch(at, half)
        over = (np.abs(x - at[0]) <= half[0] + 1e-9) & (np.abs(y - at[1]) <= half[1] + 1e-9)
        z[nodes] = np.where(over, np.maximum(z[nodes], height), z[nodes])
        foot = half + cell
        corners = [[sx * h[0], sy * h[1], up] for h, up in ((foot, 0.0), (half, height)) for sx in (-1, 1) for sy in (-1, 1)]
        geoms.append({"type": "mesh", "vertices": corners, "pos": [*at, 0.0]})
    terrain = rb.Terrain.from_array(z, cell, (-size / 2, -size / 2), interpolation="linear", name="planes, boxes, ellipsoids")
    return Ground(terrain.name, terrain, geoms)


def field(size: float, seed: int) -> Ground:
    """Return a field of rocks by the size-frequency law, k = 10 %, `size` m across."""
    terrain = rb.surfaces.rocks(0.1, seed, size=size, spacing=0.05, interpolation="linear")
    return Ground("rock field", terrain)


def load(name: str) -> rb.Rover:
    """Return a preset; discs get a width of 5 cm, because MuJoCo has no wheel without width."""
    rover = rb.load_rover(name)
    return rover if rover.wheel_width.any() else rover.replace(wheel_width=np.full(6, 0.05))


def stiff(rover: rb.Rover) -> rb.Rover:
    """Return the rover with close joint limits, so that joints reach them."""
    return rover.replace(rocker_limits=np.radians([-3.0, 3.0]), bogie_limits=np.radians([-5.0, 5.0]))


@dataclass(frozen=True)
class Agreement:
    """Differences of poses that are alike in `settle` and MuJoCo, and counts of the others."""

    z: np.ndarray  # (n,) m, of poses that are alike
    angles: np.ndarray  # (n, 5) roll, pitch, rocker, bogies, rad, of poses that are alike
    poses: int
    lifted: int  # poses with a wheel off the ground in MuJoCo
    stopped: int  # poses with a joint at its limit in MuJoCo
    marginal: int  # poses that are not alike, but marginal (`_is_marginal`)
    held: int  # poses that are not alike, but at which MuJoCo stays when it starts there: equilibria of both
    unlike: list[str]  # one line for each pose that differs

    @property
    def share(self) -> float:
        """Share of poses that are alike when lowered from above."""
        return len(self.z) / self.poses

    @property
    def share_of_equilibria(self) -> float:
        """Share of poses that are equilibria in MuJoCo too."""
        return (len(self.z) + self.held) / self.poses


def compare(rover: rb.Rover, ground: Ground, poses: int, seed: int) -> Agreement:
    """Settle in equilibrium mode and lower the rover in MuJoCo, at seeded positions."""
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
        marginal_pair = _is_marginal(rover, ground.terrain, tower, (x[k], y[k], yaw[k]), rest, own)
        held += stays
        marginal += marginal_pair
        unlike.append(
            f"pose {k}: {rb.Status(int(ours.status[k])).name}, {'marginal' if marginal_pair else 'not marginal'}, "
            f"{'stays' if stays else 'does not stay'} in MuJoCo; MuJoCo's own pose is "
            f"{np.degrees(np.abs(_angles(rest) - _angles(own)).max()):.2f} deg and {1e3 * (rest.z - own.z):.2f} mm away, "
            f"lifted {rest.lifted.astype(int)} / {own.lifted.astype(int)}, "
            f"at limits {rest.on_stop.astype(int)} / {own.on_stop.astype(int)}, at rest {rest.at_rest}"
        )
    return Agreement(np.array(heights), np.array(angles), poses, lifted, stopped, marginal, held, unlike)


@dataclass(frozen=True)
class Own:
    """A pose of `settle` with the fields of `Rest`, and its gaps."""

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
    """Return True if lifted wheels and limits are the same and angles differ by less than 2 deg."""
    same = np.array_equal(one.lifted, other.lifted) and np.array_equal(one.on_stop, other.on_stop)
    return bool(same and np.abs(_angles(one) - _angles(other)).max() < np.radians(2))


def _is_marginal(
    rover: rb.Rover, terrain: rb.Terrain, tower: DropTower, place: tuple[float, float, float], rest: Rest, own: Own
) -> bool:
    """Return True if two equilibria differ by rounding or by a small displacement only.

    By rounding: they agree within 0.1 deg and 0.2 mm, and wheels that only one of them reports as lifted have gaps below
    0.2 mm. By displacement: after a displacement of 1 mm or 0.1 deg, `settle` returns MuJoCo's equilibrium or MuJoCo
    returns that of `settle`.
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
