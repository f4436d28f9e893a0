"""Verification of settled poses by the oracle; `tools/verify_settle.py` verifies many."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import rockerbogie as rb
from support import oracle
from support.data import DATA

Array = NDArray[np.float64]

#: Largest depth of a tread point below the terrain, and largest gap of a wheel in contact, m.
TOLERANCE = 1e-6
#: Statuses of contact mode for which the six gaps are 0.
TOUCHING = (rb.Status.CONVERGED, rb.Status.JOINT_STOP)
SLACK = 1e-8  # width of the oracle's bracket, m
CHUNK = 500  # poses verified at once


def grounds(seed: int = 0) -> dict[str, Callable[[], rb.Terrain]]:
    """Return terrains by name: rock fields, and the Mars yard if its file is present.

    Rock fields have 5, 10 and 20 % cover on rolling terrain with 2 cm cells.
    """

    def field(k: float) -> Callable[[], rb.Terrain]:
        def make() -> rb.Terrain:
            base = rb.surfaces.fractal(seed, size=24.0, spacing=0.02, interpolation="linear")
            return rb.surfaces.rocks(k, seed, base=base)

        return make

    found: dict[str, Callable[[], rb.Terrain]] = {f"k={100 * k:.0f}%": field(k) for k in (0.05, 0.10, 0.20)}
    yard = DATA / "marsyard2021" / "marsyard_terrain_hm.tif"
    if yard.exists():
        for kind in ("linear", "cubic"):
            found[f"marsyard2021 {kind}"] = lambda kind=kind: rb.Terrain.from_raster(yard, interpolation=kind)
    return found


def draw(terrain: rb.Terrain, rover: rb.Rover, count: int, seed: int) -> tuple[Array, ...]:
    """Return random x, y (m) and yaw (rad), each (count,), with the rover on the map."""
    rng = np.random.default_rng(seed)
    reach = np.hypot(*np.abs(rover.hubs[:, :2]).max(axis=0)) + 2 * rover.wheel_radius.max()
    west, south, east, north = terrain.bounds
    return (
        rng.uniform(west + reach, east - reach, count),
        rng.uniform(south + reach, north - reach, count),
        rng.uniform(-np.pi, np.pi, count),
    )


@dataclass
class Contacts:
    """Counts of a batch by status, and the oracle's gaps of its poses in contact mode."""

    status: NDArray[np.int64]
    gap: Array  # (n, 6) m, of poses whose status says that six wheels are in contact
    worst: float  # largest distance of a gap from 0, bracket included, m

    @property
    def failed(self) -> int:
        """Number of poses with a wheel that is not in contact."""
        off = (self.gap > TOLERANCE) | (self.gap - SLACK < -TOLERANCE)
        return int(off.any(axis=1).sum())


def verify_contact(pose: rb.Pose) -> Contacts:
    """Compute the oracle's gaps of each pose of a batch (n,) that is reported as in contact."""
    ground = oracle.Ground.of(pose.terrain)
    good = np.flatnonzero(np.isin(pose.status, TOUCHING))
    gap = np.empty((len(good), 6))
    for start in range(0, len(good), CHUNK):
        at = good[start : start + CHUNK]
        wheels = oracle.stand(pose.rover, pose.x[at], pose.y[at], pose.yaw[at], pose.q[at], pose.steering[at])
        gap[start : start + CHUNK] = oracle.least_gap(ground, wheels, SLACK).gap.reshape(-1, 6)
    status = np.bincount(pose.status, minlength=len(rb.Status))
    worst = float(np.abs(np.concatenate([gap, gap - SLACK])).max()) if len(good) else np.nan
    return Contacts(status, gap, worst)


@dataclass
class Equilibria:
    """Counts of a batch by status in equilibrium mode, and the faults of its poses."""

    status: NDArray[np.int64]
    wrong: list[str]  # one line for each fault
    deepest: float  # lowest gap of a wheel or the body, bracket included, m


def verify_equilibrium(pose: rb.Pose, tries: int = 40, seed: int = 0) -> Equilibria:
    """Verify each pose of a batch (n,) of equilibrium mode against the definitions.

    - No tread and no part of the body's box is below the terrain; reported contacts are contacts.
    - Joints are within their limits.
    - Contact forces are not negative, act at contacts only, and sum to the weight.
    - No nearby pose (angles changed within the limits, z at first contact) has a lower centre of mass.
    """
    rover, ground = pose.rover, oracle.Ground.of(pose.terrain)
    at = np.flatnonzero(np.isfinite(pose.z))
    x, y, yaw, q, steering = (a[at] for a in (pose.x, pose.y, pose.yaw, pose.q, pose.steering))
    wheel, belly, height = gaps_and_height(rover, ground, x, y, yaw, q, steering, np.ones(len(at), dtype=bool))
    lowest = np.minimum(wheel.min(axis=1), belly)
    low, high = np.array([rover.rocker_limits, rover.bogie_limits, rover.bogie_limits]).T
    weight = rover.mass * 9.80665
    share, belly_share = pose.support[at] / weight, pose.belly_support[at] / weight
    lifted, on_belly = pose.wheel_lifted[at], pose.status[at] == rb.Status.BELLY_CONTACT
    clear, close = 1.1 * TOLERANCE, 0.9 * TOLERANCE  # between the two, both reports are right
    checks = {
        "below the terrain": lowest - SLACK < -TOLERANCE,
        "without any contact": lowest > TOLERANCE,
        "a wheel reported in contact is not": (~lifted & (wheel > clear)).any(axis=1),
        "a wheel reported as lifted is in contact": (lifted & (wheel < close)).any(axis=1),
        "contact of the body is not as reported": (on_belly & (belly > clear)) | (~on_belly & (belly < close)),
        "a joint is beyond its limit": ((q[:, 3:] < low - 1e-9) | (q[:, 3:] > high + 1e-9)).any(axis=1),
        "a contact force is negative": (share < 0).any(axis=1) | (belly_share < 0),
        "the forces do not sum to the weight": abs(share.sum(axis=1) + belly_share - 1) > 1e-6,
        "a force acts without contact": ((share > 0) & (wheel > clear)).any(axis=1) | ((belly_share > 0) & (belly > clear)),
    }
    rng = np.random.default_rng(seed)
    size = rover.wheelbase
    for step in (1e-4, 3e-3):
        away = rng.normal(size=(len(at), tries, 5))
        away *= step / np.linalg.norm(away, axis=-1, keepdims=True)
        moved = np.repeat(q[:, None], tries, axis=1)
        moved[..., 1:] += away
        moved[..., 3:] = np.clip(moved[..., 3:], low, high)
        many = [np.repeat(a, tries, axis=0) for a in (x, y, yaw, steering)]
        near = np.repeat(belly < 0.1 * size, tries)
        level = gaps_and_height(rover, ground, *many[:3], moved.reshape(-1, 6), many[3], near)[2].reshape(-1, tries)
        checks[f"lower centre of mass {step:g} rad away"] = (
            level.min(axis=1, initial=np.inf) < height - 1e-5 * step * size - 2 * SLACK
        )
    wrong = []
    for what, bad in checks.items():
        wrong += [f"pose {at[k]} ({rb.Status(pose.status[at[k]]).name}): {what}" for k in np.flatnonzero(bad)]
    return Equilibria(np.bincount(pose.status, minlength=len(rb.Status)), wrong, float(lowest.min(initial=np.inf) - SLACK))


def gaps_and_height(
    rover: rb.Rover, ground: oracle.Ground, x: Array, y: Array, yaw: Array, q: Array, steering: Array, near: NDArray[np.bool_]
) -> tuple[Array, Array, Array]:
    """Return gaps of wheels and body, and the height of the centre of mass at first contact.

    Args:
        rover, ground: the rover and the oracle's terrain.
        x, y, yaw: (n,) m, m, rad.
        q: (n, 6) z, roll, pitch, rocker, bogies.
        steering: (n, 6) rad.
        near: (n,) True where the body may be in contact; elsewhere its gap is not computed.

    Returns:
        Gaps of wheels (n, 6) and of the body (n,; inf where not `near`), and the height (n,) of the centre of mass after a shift
        of z to first contact; all in m.
    """
    wheel = oracle.least_gap(ground, oracle.stand(rover, x, y, yaw, q, steering), SLACK).gap.reshape(-1, 6)
    belly = np.full(len(q), np.inf)
    if near.any():
        faces = oracle.box(rover, x[near], y[near], yaw[near], q[near])
        belly[near] = oracle.least_gap(ground, faces, SLACK).gap.reshape(-1, 3).min(axis=1)
    height = oracle.mass_height(rover, oracle.link_poses(rover, x, y, yaw, q, steering))
    return wheel, belly, height - np.minimum(wheel.min(axis=1), belly)
