"""A rover with locked wheels on a plane in MuJoCo, under gravity that turns."""

from __future__ import annotations

from typing import Any

import numpy as np

import rockerbogie as rb
from rockerbogie.simulation.mjcf import add_mechanism, empty_spec

RATE = np.radians(0.5)  # rad/s, by default
EARLY = np.radians(4.0)  # before the expected tilt, where the slow turn begins
LATE = np.radians(6.0)
MOVED = np.radians(2.0)  # change of attitude or of a joint that counts as loss, by default


def tilt_of_loss(
    mujoco: Any, rover: rb.Rover, azimuth: float, friction: float, expected: float, rate: float = RATE, moved: float = MOVED
) -> float:
    """Return the tilt of gravity at which a braked rover on a plane begins to move, rad.

    Args:
        mujoco: the module.
        rover: the rover; its wheels are fixed to their links.
        azimuth: direction in which gravity turns, in the rover's axes, rad.
        friction: friction coefficient.
        expected: tilt about which gravity turns slowly, rad.
        rate: of this turn, rad/s.
        moved: change of attitude or of a joint that counts as loss, rad.

    Returns:
        The tilt; NaN if the rover does not move up to LATE beyond the expected one.
    """
    spec = empty_spec("braked")
    ground = {"friction": [friction, 0.005, 0.0001], "contype": 1, "conaffinity": 1}
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[50, 50, 1], **ground)
    base = spec.worldbody.add_body(name="body")
    base.add_freejoint(name="free")
    add_mechanism(spec, rover, base, friction=friction, wheel_joints=False)
    model = spec.compile()
    data = mujoco.MjData(model)
    pose = rb.settle(rover, rb.surfaces.plane(), 0.0, 0.0)
    data.qpos[:7] = [0.0, 0.0, float(pose.z), np.cos(float(pose.pitch) / 2), 0.0, np.sin(float(pose.pitch) / 2), 0.0]

    def turn(angle: float) -> None:
        level = np.sin(angle) * np.array([np.cos(azimuth), np.sin(azimuth)])
        model.opt.gravity[:] = 9.81 * np.array([*level, -np.cos(angle)])
        mujoco.mj_step(model, data)

    dt, start = model.opt.timestep, expected - EARLY
    for share in np.minimum(np.linspace(0.0, 1.5, int(3.0 / dt)), 1.0):
        turn(start * share)
    before, angle = data.qpos.copy(), start
    while angle < expected + LATE:
        turn(angle)
        angle += rate * dt
        attitude = 2.0 * np.arccos(min(1.0, abs(float(data.qpos[3:7] @ before[3:7]))))
        if max(attitude, np.abs(data.qpos[7:] - before[7:]).max()) > moved:
            return angle
        if np.linalg.norm(data.qpos[:3] - before[:3]) > 0.1 * rover.wheelbase:
            return angle
    return np.nan
