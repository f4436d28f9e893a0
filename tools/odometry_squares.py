"""Drive squares over rocks by odometry; MuJoCo is the robot.

    python tools/odometry_squares.py                     # the first five passable seeds for Curiosity and OSR
    python tools/odometry_squares.py --rovers osr --seeds 5 --limit 60

The square lies on `surfaces.mars(seed, k=0.07, size=2 * side + 12)`. It is passable if `rb.settle` finds a pose every 2 cm of
its sides and at 19 headings on each corner, with status CONVERGED (joints within their limits) and the body clear of the
terrain. The rover is driven by `WheelController` (contact angles, load sharing) and `OdometryFilter`, as by the ROS 2 node. A
line has the distance, simulated time, error of the last position, its share of the distance, stated standard deviation of x
and y, the share of the way that was doubted, and that of the poses at which the rover cannot stand.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np
from simulated_rover import MARGIN, REACHED, SimulatedRover, drive_by_odometry

import rockerbogie as rb

#: Side of the square, m, and speed, m/s.
TRACKS = {"curiosity": (10.0, 0.2), "osr": (5.0, 0.1)}
ROCKS = 0.07
#: Distance between poses that are checked, m; number of headings on a corner.
STEP, HEADINGS = 0.02, 19


def blocked(rover: rb.Rover, seed: int, side: float) -> float:
    """Return the share of poses on a square at which the rover cannot stand; 0 if passable."""
    terrain = rb.surfaces.mars(seed=seed, k=ROCKS, size=2 * side + 3 * MARGIN)
    half, along = side / 2, np.arange(-side / 2, side / 2 + 1e-9, STEP)
    poses = [np.stack(np.broadcast_arrays(along, -half, 0.0)), np.stack(np.broadcast_arrays(half, along, np.pi / 2))]
    poses += [np.stack(np.broadcast_arrays(-along, half, np.pi)), np.stack(np.broadcast_arrays(-half, -along, -np.pi / 2))]
    for k, corner in enumerate(((half, -half), (half, half), (-half, half))):
        poses.append(np.stack(np.broadcast_arrays(*corner, (k + np.linspace(0.0, 1.0, HEADINGS)) * np.pi / 2)))
    pose = rb.settle(rover, terrain, *np.concatenate(poses, axis=1))
    return 1.0 - float(((pose.status == rb.Status.CONVERGED) & (pose.clearance > 0)).mean())


def main() -> None:
    """Print a line for each square."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rovers", nargs="+", default=list(TRACKS), choices=list(TRACKS))
    options.add_argument("--seeds", type=int, nargs="+", help="any squares; default: the first passable ones")
    options.add_argument("--count", type=int, default=5, help="number of passable squares")
    options.add_argument("--limit", type=float, default=600.0, help="simulated time at which a drive ends, s")
    given = options.parse_args()
    print("| rover | seed | corners | distance | time | error | of distance | stated sigma x, y | doubted | blocked |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in given.rovers:
        side, speed = TRACKS[name]
        rover = rb.load_rover(name)
        seeds = given.seeds or itertools.islice(
            (seed for seed in itertools.count() if not blocked(rover, seed, side)), given.count
        )
        for seed in seeds:
            robot = SimulatedRover(name, seed, ROCKS, side)
            found = drive_by_odometry(robot, speed, 4, True, True, REACHED, given.limit)
            sigma = np.sqrt(np.diag(found.estimate.pose_covariance)[:2])
            print(
                f"| {name} | {seed} | {found.corners} | {robot.length:.1f} m | {found.time:.0f} s | {found.error:.2f} m | "
                f"{100 * found.error / robot.length:.2f} % | {sigma[0]:.2f} m, {sigma[1]:.2f} m | {100 * found.doubted:.1f} % | "
                f"{100 * blocked(rover, seed, side):.1f} % |",
                flush=True,
            )


if __name__ == "__main__":
    main()
