"""Check the covariance of odometry by its NEES over simulated drives.

    python tools/odometry_nees.py --count 200

Each drive is an exact run over rocks (`rb.drive`). Its sensors get errors: every wheel slips along and across its path by 10 % of
the speed, correlated over 0.5 m; all wheels share 0.5 %; the attitude is off by a constant 0.01 rad in roll and pitch and
0.02 rad in yaw. NEES is eᵀP⁻¹e of the final error e of the position; its mean over the drives has a 95 % interval by chi-squared.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
from scipy.stats import chi2

import rockerbogie as rb

SHARE, CORRELATED, COMMON, ATTITUDE = 0.1, 0.5, 0.005, (0.01, 0.01, 0.02)  # –, m, –, rad


def correlated(rng: np.random.Generator, distance: np.ndarray, count: int) -> np.ndarray:
    """Return noise (n, count) of unit variance, correlated over `CORRELATED`."""
    found = np.empty((len(distance), count))
    found[0] = rng.normal(size=count)
    for k, step in enumerate(np.diff(distance)):
        # the integral of this noise over a long way has the variance CORRELATED times the way
        keep = np.exp(-2.0 * step / CORRELATED)
        found[k + 1] = keep * found[k] + np.sqrt(1 - keep**2) * rng.normal(size=count)
    return found


def final_errors(count: int, seed: int = 0, rover_name: str = "curiosity", length: float = 6.0) -> tuple[np.ndarray, np.ndarray]:
    """Return final errors (n, 3) of odometry over drives, and their covariances (n, 3, 3)."""
    rover, terrain, rng = rb.load_rover(rover_name), rb.surfaces.mars(seed=1), np.random.default_rng(seed)
    errors, covariances = [], []
    while len(errors) < count:
        x, y = rng.uniform(-12.0, 12.0, 2)
        heading, radius = rng.uniform(-np.pi, np.pi), rng.uniform(4.0, 20.0)
        run = rb.drive(
            rover, terrain, rb.Path.arc((x, y), heading, radius, rng.choice([-1, 1]) * length / radius), speed=0.05, step=0.05
        )
        if (run["status"] != 0).any():
            continue
        along = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(run["x"]), np.diff(run["y"])))])
        slip = SHARE * correlated(rng, along, 12)
        log = run[["wheel_rate", "steering", "rocker", "bogie", "roll", "pitch", "yaw"]].copy(deep=True)
        log["wheel_rate"] = log["wheel_rate"] * (1.0 + slip[:, :6]) * (1.0 + COMMON * rng.normal())
        # a wheel that slides aside by a share of its speed reads as one whose steering is off by that angle
        log["steering"] = log["steering"] + np.where(rover.steers, slip[:, 6:], 0.0)
        for name, sigma in zip(("roll", "pitch", "yaw"), ATTITUDE, strict=True):
            log[name] = log[name] + sigma * rng.normal()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rb.LogWarning)
            track = rb.odometry(rover, None, log, start=tuple(float(run[k][0]) for k in "xyz"))
        errors.append([float(track[k][-1] - run[k][-1]) for k in "xyz"])
        covariances.append(track["pose_covariance"].values[-1, :3, :3])
    return np.array(errors), np.array(covariances)


def nees(errors: np.ndarray, covariances: np.ndarray) -> np.ndarray:
    """Return eᵀP⁻¹e of each drive."""
    return np.einsum("ni,nij,nj->n", errors, np.linalg.inv(covariances), errors)


def bounds(count: int, size: int) -> tuple[float, float]:
    """Return the 95 % interval of the mean NEES of drives with errors of `size` components."""
    low, high = chi2.ppf((0.025, 0.975), size * count) / count
    return float(low), float(high)


def main() -> None:
    """Print mean NEES and its bounds for the position, its horizontal part and its height."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--count", type=int, default=200)
    options.add_argument("--seed", type=int, default=0)
    given = options.parse_args()
    errors, covariances = final_errors(given.count, given.seed)
    for what, part in (("position", [0, 1, 2]), ("horizontal", [0, 1]), ("height", [2])):
        values = nees(errors[:, part], covariances[:, part][:, :, part])
        low, high = bounds(given.count, len(part))
        print(f"{what}: mean NEES {values.mean():.2f}, 95 % interval {low:.2f} to {high:.2f}, median {np.median(values):.2f}")
    stated = np.sqrt(np.einsum("nii->i", covariances) / len(errors))
    print(f"RMS error in x, y, z {np.sqrt((errors**2).mean(axis=0)).round(4)} m, stated {stated.round(4)} m")


if __name__ == "__main__":
    main()
