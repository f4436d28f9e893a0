"""Time a step of `OdometryFilter`, its tip margin, and `body_twist` at new poses.

    python tools/time_odometry.py --rover curiosity

Prints processor time in µs: median and 99th percentile. Other programs on the machine do not count.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable

import numpy as np

import rockerbogie as rb


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rover", default="curiosity")
    rover, terrain = rb.load_rover(parser.parse_args().rover), rb.surfaces.mars(seed=2, k=0.07)
    run = rb.drive(rover, terrain, rb.Path.straight((0.0, 0.0), 0.0, 3.0), speed=0.1)
    odometer, time_of = rb.OdometryFilter(rover), run["time"].values
    step: list[float] = []
    margin: list[float] = []
    for k, t in enumerate(time_of):
        joints = {name: run[name].values[k] for name in ("wheel_rate", "steering", "rocker", "bogie")}
        imu = {name: float(run[name].values[k]) for name in ("roll", "pitch", "yaw")}
        step.append(taken(lambda t=t, joints=joints, imu=imu: odometer.update(t, joints, imu)))
        margin.append(taken(lambda: odometer.estimate.tip_margin))
    report("step of OdometryFilter", step)
    report("its tip margin", margin)
    poses = [rb.settle(rover, terrain, x, 0.1, 0.2) for x in np.linspace(0.0, 2.0, 500)]
    twist: list[float] = []
    for pose in poses:
        _ = pose.contact_normal  # computed once, before
        twist.append(taken(lambda pose=pose: rb.body_twist(rover, pose, wheel_rates=np.full(6, 0.2))))
    report("body_twist at a new pose", twist)


def taken(work: Callable[[], object]) -> float:
    """Return the processor time of a function.

    Args:
        work: the function.

    Returns:
        s, of this thread.
    """
    begin = time.thread_time()
    work()
    return time.thread_time() - begin


def report(label: str, times: list[float]) -> None:
    """Print a line for times in s, without the first tenth.

    Args:
        label: for the line.
        times: s.
    """
    median, most = 1e6 * np.percentile(times[len(times) // 10 :], (50, 99))
    print(f"{label}: median {median:.0f} µs, 99 % {most:.0f} µs")


if __name__ == "__main__":
    main()
