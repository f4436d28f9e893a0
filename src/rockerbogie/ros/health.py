"""Diagnoses of the node: sensors, pose, tip margin, slip and commands."""

from __future__ import annotations

from collections import Counter
from typing import Protocol

import numpy as np
from diagnostic_msgs.msg import DiagnosticStatus

from ..rover.model import Rover
from .command_part import CommandPart, Host
from .costmap_part import CostMapPart
from .intake import Intake
from .messages import ERROR, OK, STALE, WARN, status

#: Speed below which slip is not judged, m/s.
STANDING = 5e-3


class Diagnosed(Host, Protocol):
    """Node that is diagnosed."""

    rover: Rover | None
    intake: Intake
    commands: CommandPart | None
    cost_map: CostMapPart | None
    received: Counter[str]  # messages by kind
    failures: int  # rows that the filter refused
    joints_at: float  # time of the last joint state, s


def diagnoses(node: Diagnosed) -> list[DiagnosticStatus]:
    """Return the state of the rover and of its sensors.

    Args:
        node: a configured node.

    Returns:
        Diagnoses of sensors, pose, slip and commands, and of the cost map if there is one; none before the configuration.
    """
    if node.rover is None or node.commands is None:
        return []
    found = [_sensors(node, node.rover), _pose(node, node.rover), _slip(node, node.rover), _commands(node.commands)]
    return found if node.cost_map is None else [*found, _cost_map(node.cost_map)]


def _sensors(node: Diagnosed, rover: Rover) -> DiagnosticStatus:
    """Return the diagnosis of joint states and IMU."""
    intake, age = node.intake, node.now() - node.joints_at
    level, text = OK, "joint states and IMU arrive"
    if not np.isfinite(age):
        level, text = STALE, "no joint states yet"
    elif intake.missing:
        level, text = ERROR, f"no readings of wheel {', '.join(intake.missing)}: check joint_names"
    elif age > node.value("sensor_timeout"):
        level, text = ERROR, f"no joint states for {age:.1f} s"
    elif intake.uses_imu and not intake.has_imu:
        level, text = WARN, "no IMU: the wheels give the turn, and the start is taken to be level"
    elif not intake.uses_imu:
        text = "joint states arrive; the IMU is not used"
    values = {f"{kind} received": str(count) for kind, count in node.received.items()}
    values |= {name: str(count) for name, count in sorted(intake.events.items())}
    values |= {f"last {name}": text for name, text in sorted(intake.last.items())}
    if node.failures:
        values["rows not used"] = str(node.failures)
    return status("rockerbogie: sensors", level, text, values, rover.name)


def _pose(node: Diagnosed, rover: Rover) -> DiagnosticStatus:
    """Return the diagnosis of attitude, joint limits and tip margin."""
    e = node.estimate
    if e is None:
        return status("rockerbogie: pose", STALE, "no estimate yet", {}, rover.name)
    roll, pitch, yaw = np.degrees(e.attitude)
    margin = e.tip_margin
    level, text = OK, f"tip margin {np.degrees(margin):.1f} deg" if np.isfinite(margin) else "tip margin not known: no masses"
    limits = []
    right = float(rover.right_rocker(e.rocker))
    for name, angle, (low, high) in (
        ("left rocker", e.rocker, rover.rocker_limits),
        ("right rocker", right, rover.rocker_limits),
        ("left bogie", float(e.bogie[0]), rover.bogie_limits),
        ("right bogie", float(e.bogie[1]), rover.bogie_limits),
    ):
        if not low < angle < high:
            limits.append(name)
    if margin < node.value("tip_margin_error"):
        level, text = ERROR, f"close to tipping over: {text}"
    elif margin < node.value("tip_margin_warning"):
        level, text = WARN, f"low {text}"
    if limits:
        level, text = max(level, WARN), f"{text}; at its limit: {', '.join(limits)}"
    values = {
        "roll [deg]": f"{roll:.2f}",
        "pitch [deg]": f"{pitch:.2f}",
        "yaw [deg]": f"{yaw:.2f}",
        "rocker [deg]": f"{np.degrees(e.rocker):.2f}",
        "bogie left [deg]": f"{np.degrees(e.bogie[0]):.2f}",
        "bogie right [deg]": f"{np.degrees(e.bogie[1]):.2f}",
        "tip margin [deg]": f"{np.degrees(margin):.2f}",
        "distance [m]": f"{e.distance:.3f}",
        "sigma x, y, z [m]": ", ".join(f"{v:.3f}" for v in np.sqrt(np.maximum(np.diag(e.pose_covariance)[:3], 0.0))),
    }
    return status("rockerbogie: pose", level, text, values, rover.name)


def _slip(node: Diagnosed, rover: Rover) -> DiagnosticStatus:
    """Return the diagnosis of the wheels' slip against each other."""
    e = node.estimate
    if e is None or not np.isfinite(e.twist).all():
        return status("rockerbogie: slip", STALE, "no motion yet", {}, rover.name)
    speed = float(np.linalg.norm(e.twist[:3]))
    fastest = max(speed, float(np.abs(e.roll_slip).max()))
    share = np.abs(e.roll_slip) / fastest if fastest > STANDING else np.zeros(6)
    worst = int(np.argmax(share))
    level, text = OK, f"wheels agree within {100 * share[worst]:.0f} % of the speed"
    if share[worst] > node.value("slip_warning"):
        level, text = WARN, f"wheel {rover.wheel_names[worst]} slips by {100 * share[worst]:.0f} % of the speed"
    if e.doubted:
        level, text = WARN, f"the wheels contradict each other by {100 * e.slip_share:.0f} % of their speed: is the rover stuck?"
    values = {"speed [m/s]": f"{speed:.4f}", "slip share": f"{e.slip_share:.3f}"}
    values |= {f"roll slip {n} [m/s]": f"{v:.4f}" for n, v in zip(rover.wheel_names, e.roll_slip, strict=True)}
    values |= {f"side slip {n} [m/s]": f"{v:.4f}" for n, v in zip(rover.wheel_names, e.side_slip, strict=True)}
    return status("rockerbogie: slip", level, text, values, rover.name)


def _commands(part: CommandPart) -> DiagnosticStatus:
    """Return the diagnosis of the last command."""
    c, rover = part.command, part.controller.rover
    if c is None:
        return status("rockerbogie: commands", OK, "no cmd_vel yet", {}, rover.name)
    level, text = OK, f"{100 * c.speed_scale:.0f} % of the wanted speed" if part.wanted.any() else "standing"
    short = np.abs(c.steering_short).max()
    if c.waiting:
        text = "waiting until the wheels have turned"
    elif short > 1e-6:
        level, text = WARN, f"the steering limit leaves {np.degrees(short):.1f} deg: wheels slip sideways"
    values = {
        "speed scale": f"{c.speed_scale:.3f}",
        "waiting": str(c.waiting),
        "steering error [deg]": f"{np.degrees(np.abs(c.steering_error).max()):.2f}",
        "load sharing [rad/s]": ", ".join(f"{v:.4f}" for v in part.controller.trim),
    }
    return status("rockerbogie: commands", level, text, values, rover.name)


def _cost_map(part: CostMapPart) -> DiagnosticStatus:
    """Return the diagnosis of the cost map."""
    level, text = OK, f"{part.published} cost maps published"
    if part.error:
        level, text = WARN, f"no cost map: {part.error}"
    elif not part.published:
        level, text = OK, "no heights yet"
    values = {"published": str(part.published), "cells settled": str(part.cells), "time [s]": f"{part.seconds:.2f}"}
    return status("rockerbogie: cost map", level, text, values, part.costs.rover.name)
