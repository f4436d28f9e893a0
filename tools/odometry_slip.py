"""Compare odometry's error with the true slip of MuJoCo's wheels on straight drives.

    python tools/odometry_slip.py --seeds 2 7 11 --speeds 0.05 0.2

Attitude and joint rates are exact, so that slip is the only cause of error. Prints, for each terrain and speed, the error of the
last position and the way that the rims rolled over the way of the hubs.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import rockerbogie as rb
from rockerbogie.rover.rotations import body_transform

LENGTH, START = 5.0, (-3.0, 0.0)  # m


def drive(rover: rb.Rover, terrain: rb.Terrain, speed: float) -> tuple[np.ndarray, float, np.ndarray]:
    """Return odometry's error, the drive's length, and rolled over true way of each wheel.

    Args:
        rover: the rover.
        terrain: under it.
        speed: m/s.

    Returns:
        (3,) m; m; (6,).
    """
    run = rb.simulate(rover, terrain, rb.Path.straight(START, 0.0, LENGTH), speed=speed)
    true = np.stack([run[name] for name in "xyz"], axis=-1)
    log = run[["wheel_rate", "steering", "rocker", "bogie", "roll", "pitch", "yaw"]]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rb.LogWarning)
        track = rb.odometry(rover, None, log, start=tuple(true[0].tolist()))
    error = np.array([float(track[name][-1]) for name in "xyz"]) - true[-1]
    hubs = rb.wheel_frames(rover, run["rocker"].values, run["bogie"].values, run["steering"].values)[..., :3, 3]
    turns = [body_transform(*row) for row in np.column_stack([true, run["roll"], run["pitch"], run["yaw"]])]
    turns = np.array(turns)
    at = np.einsum("nij,nkj->nki", turns[:, :3, :3], hubs) + turns[:, None, :3, 3]
    way = np.linalg.norm(np.diff(at, axis=0), axis=2).sum(axis=0)
    rolled = np.trapezoid(run["wheel_rate"].values, run["time"].values, axis=0) * rover.wheel_radius
    return error, float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum()), rolled / way


def main() -> None:
    """Print one line for each terrain and speed."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--rover", default="curiosity")
    options.add_argument("--seeds", type=int, nargs="+", default=[2, 7, 11])
    options.add_argument("--speeds", type=float, nargs="+", default=[0.05, 0.2])
    given = options.parse_args()
    rover = rb.load_rover(given.rover)
    for seed in given.seeds:
        terrain = rb.surfaces.mars(seed=seed, size=24.0)
        for speed in given.speeds:
            error, length, ratio = drive(rover, terrain, speed)
            share = 100 * np.linalg.norm(error) / length
            print(f"mars({seed}), {speed:g} m/s: error {share:.2f} %, rolled over true way {ratio.mean():.4f}", ratio.round(3))


if __name__ == "__main__":
    main()
