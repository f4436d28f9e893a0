"""The covariance of odometry is that of its errors, over simulated drives (NEES)."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
import odometry_nees


def test_the_covariance_is_consistent_over_drives():
    """Compare the mean NEES of 40 drives with its 95 % interval."""
    errors, covariances = odometry_nees.final_errors(40, seed=1)
    low, high = odometry_nees.bounds(40, 2)
    horizontal = odometry_nees.nees(errors[:, :2], covariances[:, :2, :2]).mean()
    assert low < horizontal < high, f"mean NEES of the horizontal position {horizontal:.2f}, interval {low:.2f} to {high:.2f}"
    for name, part in (("position", [0, 1, 2]), ("height", [2])):
        low, high = odometry_nees.bounds(40, len(part))
        found = odometry_nees.nees(errors[:, part], covariances[:, part][:, :, part]).mean()
        assert low < found < high, f"mean NEES of the {name} {found:.2f}, interval {low:.2f} to {high:.2f}"
