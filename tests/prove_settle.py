"""Settled poses on rock fields and a Mars yard, each proved by the oracle over the whole of every tread.

    python tests/prove_settle.py [--poses 10000] [--mode contact] [--rover perseverance] [--ground k=20%]

Prints, for each rover on each ground, the share settled, what became of the rest, and the worst gap the oracle finds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import oracle
import rockerbogie as rb
from conftest import DATA

ROVERS = ("elhami-dashti", "perseverance", "rocky7")
#: No tread point further under the ground than this, and each touching wheel within it, m.
TOLERANCE = 1e-6
#: In contact mode six wheels touch where these are said; beyond a stop no rover can stand so, but the gaps are nought.
TOUCHING = (rb.Status.CONVERGED, rb.Status.JOINT_STOP)
SLACK = 1e-8  # the oracle's bracket, m
CHUNK = 500  # poses proved at once


def grounds(seed: int = 0) -> dict[str, Callable[[], rb.Terrain]]:
    """Rock fields of 5, 10 and 20 % cover on 2 cm cells, on rolling ground, and the Mars yard where its file is here."""

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


def draw(terrain: rb.Terrain, rover: rb.Rover, count: int, seed: int) -> tuple[NDArray[np.float64], ...]:
    """x, y, yaw (count,) anywhere that keeps the rover on the map."""
    rng = np.random.default_rng(seed)
    reach = np.hypot(*np.abs(rover.hubs[:, :2]).max(axis=0)) + 2 * rover.wheel_radius.max()
    west, south, east, north = terrain.bounds
    return (
        rng.uniform(west + reach, east - reach, count),
        rng.uniform(south + reach, north - reach, count),
        rng.uniform(-np.pi, np.pi, count),
    )


@dataclass
class Proof:
    """What became of a batch: how many got each status, and the oracle's gaps (n, 6) of those that settled."""

    status: NDArray[np.int64]
    gap: NDArray[np.float64]
    worst: float  # m, furthest from touching, bracket included

    @property
    def failed(self) -> int:
        """Poses that say so and do not."""
        off = (self.gap > TOLERANCE) | (self.gap - SLACK < -TOLERANCE)
        return int(off.any(axis=1).sum())


def prove(pose: rb.Pose) -> Proof:
    """Every pose of a batch (n,) that says its six wheels touch, held against the definitions."""
    ground = oracle.Ground.of(pose.terrain)
    good = np.flatnonzero(np.isin(pose.status, TOUCHING))
    gap = np.empty((len(good), 6))
    for start in range(0, len(good), CHUNK):
        at = good[start : start + CHUNK]
        wheels = oracle.stand(pose.rover, pose.x[at], pose.y[at], pose.yaw[at], pose.q[at], pose.steering[at])
        gap[start : start + CHUNK] = oracle.least_gap(ground, wheels, SLACK).gap.reshape(-1, 6)
    status = np.bincount(pose.status, minlength=len(rb.Status))
    worst = float(np.abs(np.concatenate([gap, gap - SLACK])).max()) if len(good) else np.nan
    return Proof(status, gap, worst)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=10_000)
    parser.add_argument("--rover", choices=ROVERS, action="append")
    parser.add_argument("--ground", action="append", help="part of a ground's name")
    given = parser.parse_args()
    for name, make in grounds().items():
        if given.ground and not any(part in name for part in given.ground):
            continue
        terrain = make()
        for which in given.rover or ROVERS:
            rover = rb.load_rover(which)
            place = draw(terrain, rover, given.poses, 1)
            began = time.perf_counter()
            pose = rb.settle(rover, terrain, *place)
            took = time.perf_counter() - began
            proof = prove(pose)
            known = proof.status.sum() - proof.status[rb.Status.NO_DATA]
            settled = proof.status[list(TOUCHING)].sum()
            rest = ", ".join(f"{n} {rb.Status(k).name}" for k, n in enumerate(proof.status) if k and n)
            print(
                f"{name:20} {which:14} {100 * settled / known:7.3f} % settled, worst gap {proof.worst:.2e} m, "
                f"{proof.failed} wrong, {1e6 * took / given.poses:.1f} µs a pose  {rest}",
                flush=True,
            )


if __name__ == "__main__":
    main()
