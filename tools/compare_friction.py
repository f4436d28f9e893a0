"""Compare least friction coefficients with a conic solver on random poses.

For each pose, the solver searches contact forces at a friction coefficient 2e-6 above and 2e-6 below the least one found. They
must exist above, and must not exist below. The balance is that of the tests, written from the geometry alone; it takes one
evaluation for each unit force, on all poses at once.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rockerbogie as rb

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "statics"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from test_loads import conic, settled, unit_columns

CASES = (("curiosity", "mars"), ("osr", "rocks"), ("sawppy", "rocks"), ("rocky7", "mars"), ("elhami-dashti", "mars"))
ASIDE = 2e-6  # of the friction coefficient
HELD = 1e-9  # by how much the cones may have to widen where forces exist


def checked(pose: rb.Pose, k: int, mu: float) -> tuple[float, float]:
    """Return by how much the cones must widen to balance a pose, above and below a coefficient.

    Args:
        pose: settled poses.
        k: index of the pose.
        mu: friction coefficient.
    """
    columns, b = unit_columns(pose, k)
    scale = np.abs(columns[3:]).max()
    columns[3:] /= scale
    b = b / np.abs(b[2]) / np.array([1, 1, 1, *[scale] * 6])
    return conic(columns, b, mu + ASIDE), conic(columns, b, mu - ASIDE)


def one(pose: rb.Pose, k: int) -> rb.Pose:
    """Return one pose of a batch as a batch.

    Args:
        pose: settled poses.
        k: index of the pose.
    """
    return rb.settle(pose.rover, pose.terrain, pose.x[k : k + 1], pose.y[k : k + 1], pose.yaw[k : k + 1])


def main() -> int:
    """Print the comparison; return 1 if any pose disagrees."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=10_000, help="number of poses")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    wrong = skipped = total = 0
    gaps: list[NDArray[np.float64]] = []
    began = time.process_time()
    for name, surface in CASES:
        pose = settled(name, 100 + args.seed, args.poses // len(CASES), surface=surface)
        loads = rb.wheel_loads(pose)
        balanced = loads.status == rb.LoadStatus.BALANCED
        gaps.append((loads.required_friction - loads.friction_bound)[balanced])
        plain = balanced & (loads.required_friction > 10 * ASIDE) & (pose.joint_stop == 0).all(axis=-1)
        total += pose.status.size
        skipped += int((~plain).sum())
        for k in np.flatnonzero(plain):
            above, below = checked(one(pose, k), 0, float(loads.required_friction[k]))
            if not (above < HELD and below > 0.0):
                wrong += 1
                print(f"{name} {surface} pose {k}: {above:.2e} above, {below:.2e} below", flush=True)
        print(f"{name} {surface}: {pose.status.size} poses, {time.process_time() - began:.0f} s", flush=True)
    gap = np.concatenate(gaps)
    print(f"{total} poses, {total - skipped} compared, {wrong} disagree; duality gap: largest {gap.max():.1e}, "
          f"{(gap > 1e-6).sum()} above 1e-6, of {gap.size} balanced")  # fmt: skip
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
