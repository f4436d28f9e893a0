"""Evolutionary search for settled poses that are wrong.

    python tools/search_sharp.py [--seconds 300] [--seed 0] [--interpolation cubic] [--mode contact]

A search starts from a random case (sharp_grounds.py) and keeps its worst pose. Each generation moves the rover or changes
a few heights near its contacts, settles a batch of such variants and keeps the worst pose. The score of a pose is

    its largest fault in metres (certified.py), if it has one;
    else the distance of `pose.gap` or `pose.clearance` from their brackets;
    else the negative logarithm of the second lowest minimum of a tread: a missed contact would put the tread below the terrain.

Prints the faults of each restart and a summary; --save stores faults as .npz.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rockerbogie as rb

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
from support import sampled
from support.certified import FAULTS, certify, faults_of, some
from support.sharp_grounds import FAMILIES, Case, draw_case

Array = NDArray[np.float64]

BATCH = 24  # variants per generation
PATIENCE = 12  # generations without progress before a restart
FAULT, DISCREPANCY = 1e6, 1e3  # added to a score: faults rank above discrepancies, and these above second contacts
DISCREPANT = 2e-9  # m


@dataclass
class Found:
    """The worst pose of a generation: its case, index, score and faults (m) by name."""

    case: Case
    k: int
    score: float
    faults: dict[str, float]
    discrepancy: float  # m


def worst_of(case: Case, mode: str) -> Found | None:
    """Settle the positions of a case; return the worst pose, None if no pose has a result."""
    pose = case.settle(mode)
    given = np.isfinite(pose.z)
    if mode == "contact":
        given &= np.isin(pose.status, (rb.Status.CONVERGED, rb.Status.JOINT_STOP))
    at = np.flatnonzero(given)
    if not at.size:
        return None
    settled = some(pose, at)
    b = certify(settled)
    faults = faults_of(settled, b)
    with np.errstate(invalid="ignore"):
        off = np.fmax(np.fmax(b.gap_low - settled.gap, settled.gap - b.gap_high), 0.0).max(axis=1)
        off = np.fmax(off, np.fmax(b.clearance_low - settled.clearance, settled.clearance - b.clearance_high))
    score = second_contact(settled)
    score += np.where(off > DISCREPANT, DISCREPANCY + np.log10(np.maximum(off, 1e-300)), 0.0)
    for bad in faults.values():
        score += np.where(bad > 0, FAULT * (1 + np.minimum(bad, 1e3)), 0.0)
    k = int(np.nanargmax(score))
    return Found(case, int(at[k]), float(score[k]), {f: float(v[k]) for f, v in faults.items()}, float(off[k]))


def second_contact(pose: rb.Pose) -> Array:
    """Return −log10 of the second lowest minimum (n,) of a tread, relative to the radius.

    The minimum is at least 1 % of the radius away from the lowest.
    """
    found = sampled.tread_minima(pose, per_cell=2.0)
    radius = np.tile(pose.rover.wheel_radius, pose.status.size)[:, None]
    apart = abs(found.phi - found.phi[:, :1]) * radius + abs(found.s - found.s[:, :1])
    second = np.where(apart > 0.01 * radius, found.gap, np.inf).min(axis=1) / radius[:, 0]
    near = second.reshape(-1, 6).min(axis=1)
    return np.asarray(-np.log10(np.clip(near, 1e-9, 1e3)))


def vary(found: Found, rng: np.random.Generator) -> Case:
    """Return a case of BATCH positions near the worst one.

    The heights are the same, or changed near its contacts.
    """
    case, k = found.case, found.k
    terrain = case.terrain
    cell = np.array(terrain.spacing)
    if rng.random() < 0.6:
        terrain = changed(case, k, rng)
    step = 10 ** rng.uniform(-4, 0.3)
    move = rng.normal(size=(BATCH, 3)) * step
    move[0] = 0.0
    x, y = case.x[k] + move[:, 0] * cell[0], case.y[k] + move[:, 1] * cell[1]
    turn = case.yaw[k] + 0.3 * move[:, 2]
    return replace(case, terrain=terrain, x=x, y=y, yaw=turn, steering=np.repeat(case.steering[k : k + 1], BATCH, axis=0))


def changed(case: Case, k: int, rng: np.random.Generator) -> rb.Terrain:
    """Return the terrain with 1 to 3 bumps near a wheel of pose k."""
    terrain, rover = case.terrain, case.rover
    z = terrain.z.copy()
    (dx, dy), (x0, y0) = terrain.spacing, terrain.origin
    size = float(rover.wheel_radius.max()) * 10 ** rng.uniform(-4, -0.3)
    bump = np.outer([1, 4, 1], [1, 4, 1]) / 36 if rng.random() < 0.5 else np.ones((1, 1))
    for _ in range(rng.integers(1, 4)):
        hub = rover.hubs[rng.integers(6), :2]
        c, s = np.cos(case.yaw[k]), np.sin(case.yaw[k])
        px, py = case.x[k] + c * hub[0] - s * hub[1], case.y[k] + s * hub[0] + c * hub[1]
        col, row = (int(np.floor(v)) for v in ((px - x0) / dx + rng.normal(), (py - y0) / dy + rng.normal()))
        rows, cols = bump.shape
        col, row = int(np.clip(col, 0, z.shape[1] - cols)), int(np.clip(row, 0, z.shape[0] - rows))
        z[row : row + rows, col : col + cols] += bump * size * rng.normal()
    return rb.Terrain.from_array(z, terrain.spacing, terrain.origin, terrain.interpolation, name=terrain.name)


def search(rng: np.random.Generator, interpolation: str, mode: str, deadline: float) -> tuple[Found | None, int]:
    """Run one restart; return the worst pose and the number of poses settled."""
    family = str(rng.choice([f for f in FAMILIES if f != "noise"]))
    best = worst_of(draw_case(int(rng.integers(1 << 30)), family, interpolation, BATCH), mode)  # type: ignore[arg-type]
    poses, idle = BATCH, 0
    while best is not None and idle < PATIENCE and time.perf_counter() < deadline:
        found = worst_of(vary(best, rng), mode)
        poses += BATCH
        if found is not None and found.score > best.score:
            best, idle = found, 0
        else:
            idle += 1
    return best, poses


def save(found: Found, path: Path, mode: str) -> None:
    """Write a pose's terrain, rover and position as .npz."""
    case, t = found.case, found.case.terrain
    place = {name: getattr(case, name)[found.k] for name in ("x", "y", "yaw", "steering")}
    rover = {
        name: getattr(case.rover, name) for name in ("name", "hubs", "rocker_pivot", "bogie_pivot", "wheel_radius", "wheel_width")
    }
    np.savez(path, z=t.z, spacing=t.spacing, origin=t.origin, interpolation=t.interpolation, mode=mode, **place,
             **{f"rover_{name}": value for name, value in rover.items()}, rover=case.rover.name, seed=case.seed)  # fmt: skip


def main() -> int:
    """Search for the given time; return 1 if a fault is found, else 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--interpolation", choices=("cubic", "linear"), default="cubic")
    parser.add_argument("--mode", choices=("contact", "equilibrium"), default="contact")
    parser.add_argument("--save", type=Path, help="folder for the faults found")
    given = parser.parse_args()
    rng = np.random.default_rng([given.seed, given.interpolation == "cubic", given.mode == "contact"])
    deadline = time.perf_counter() + given.seconds
    poses, restarts, faults, largest, nearest = 0, 0, 0, 0.0, 0.0
    while time.perf_counter() < deadline:
        found, n = search(rng, given.interpolation, given.mode, deadline)
        poses, restarts = poses + n, restarts + 1
        if found is None:
            continue
        largest, nearest = max(largest, found.discrepancy), max(nearest, found.score if found.score < DISCREPANCY / 2 else 0.0)
        wrong = {f: v for f, v in found.faults.items() if f in FAULTS and v > 0}
        if wrong:
            faults += 1
            print(f"FAULT {found.case.family} seed {found.case.seed} {found.case.rover.name}: {wrong}", flush=True)
            if given.save:
                save(found, given.save / f"search_{given.interpolation}_{given.mode}_{given.seed}_{restarts}.npz", given.mode)
    print(
        f"{poses} poses, {restarts} restarts, {faults} faults; largest discrepancy {largest:.2g} m; "
        f"second contacts to {10**-nearest:.1g} of a radius ({given.interpolation}, {given.mode})"
    )
    return int(faults > 0)


if __name__ == "__main__":
    sys.exit(main())
