"""The node and a simulated rover close a loop: /cmd_vel drives it, /odom steers it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from ros.ros_bench import needs_ros

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))
import drive_ros_square
from simulated_rover import SimulatedRover

pytestmark = needs_ros


@pytest.mark.parametrize("rocks", [0.0, 0.07])
def test_an_open_leg_on_rough_terrain_ends_within_1_5_percent(rocks):
    """Drive one leg, on which errors cannot cancel as on a square."""
    robot = SimulatedRover("curiosity", seed=5, rocks=rocks, side=3.0)
    found = drive_ros_square.drive(robot, 0.1, 1, {"share_load": True, "use_contact_angles": True})
    assert found["corners reached"] == 1
    assert found["distance [m]"] > 2.5
    assert found["error [% of the distance]"] <= 1.5
    assert not found["events"]
