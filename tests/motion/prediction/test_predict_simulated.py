"""Predicted drives against rigid-body dynamics."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb

pytest.importorskip("mujoco", reason="MuJoCo is not installed")


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_drive_over_bumps_agrees_with_rigid_body_dynamics() -> None:
    rover = rb.load_rover("osr")
    x = np.arange(0.0, 6.01, 0.05)
    bumps = 0.25 * np.add.outer(np.zeros_like(x), x) * 0.2 + 0.03 * np.add.outer(np.sin(7 * x), np.cos(5 * x))
    ground = rb.Terrain.from_array(bumps, spacing=0.05, interpolation="linear")
    path = rb.Path.straight((1.5, 3.0), 0.3, 2.0)
    run = rb.predict(rover, ground, None, path, friction=0.7, speed=0.1)
    commands = run[["wheel_rate_command", "steering"]].rename(wheel_rate_command="wheel_rate")
    sim = rb.simulate(rover, ground, path, 0.1, friction=0.7, torque=1e6, commands=commands, interval=0.5)
    at = {name: np.interp(sim["time"], run["time"], run[name]) for name in ("x", "y")}
    error = np.hypot(sim["x"] - at["x"], sim["y"] - at["y"])
    assert float(error.max()) <= 0.02 * 2.0
