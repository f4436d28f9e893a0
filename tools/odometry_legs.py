"""Compare odometry on open legs with and without contact angles and load sharing.

    python tools/odometry_legs.py --rovers curiosity osr --seeds 5 6 7 8 9 10 --rocks 0 0.07

MuJoCo is the robot; `WheelController` commands it every 0.04 s, steered by `OdometryFilter`, without ROS. Attitude and joint
angles are exact. Prints a table: mean and largest error of the last position over the seeds, as a share of the distance.
The gains of load sharing were chosen on seeds 2, 3, 4, 12, 13 and 14.
"""

from __future__ import annotations

import argparse

import numpy as np
from simulated_rover import REACHED, SimulatedRover, drive_by_odometry

import rockerbogie as rb

#: Wheel rates: name -> use contact angles, share loads.
MODES = {
    "plane": (False, False),
    "contact angles": (True, False),
    "plane, shared": (False, True),
    "contact angles, shared": (True, True),
}
#: Length of a leg in wheelbases; speed, wheelbases per second.
LEG, SPEED = 2.6, 0.05


def drive(name: str, seed: int, rocks: float, contact: bool, share: bool, legs: int) -> float:
    """Return the error of the last position as a share of the distance."""
    size = rb.load_rover(name).wheelbase
    robot = SimulatedRover(name, seed, rocks, LEG * size)
    limit = 4 * legs * LEG / SPEED
    found = drive_by_odometry(robot, SPEED * size, legs, contact, share, REACHED * size / 2.26, limit)
    assert found.corners == legs, f"{name} on mars({seed}, k={rocks:g}) reached {found.corners} of {legs} corners"
    return found.error / robot.length


def main() -> None:
    """Print one line for each rover, terrain and mode."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rovers", nargs="+", default=["curiosity", "osr"])
    options.add_argument("--seeds", type=int, nargs="+", default=[5, 6, 7, 8, 9, 10])
    options.add_argument("--rocks", type=float, nargs="+", default=[0.0, 0.07], help="area fractions of rocks")
    options.add_argument("--modes", nargs="+", default=list(MODES), choices=list(MODES))
    options.add_argument("--legs", type=int, default=1, help="1: open; 4: a square")
    given = options.parse_args()
    print("| rover, rocks | wheel rates | mean error | largest |\n|---|---|---|---|")
    for name in given.rovers:
        for rocks in given.rocks:
            for mode in given.modes:
                errors = [100 * drive(name, seed, rocks, *MODES[mode], given.legs) for seed in given.seeds]
                print(f"| {name}, k = {rocks:g} | {mode} | {np.mean(errors):.1f} % | {max(errors):.1f} % |", flush=True)


if __name__ == "__main__":
    main()
