"""Pose and joint angles of a running robot at a time."""

from __future__ import annotations

from dataclasses import dataclass

from ..arrays import Array


@dataclass(frozen=True)
class LivePose:
    """Pose and joint angles of a rover at a time; 0 for joints that are not published."""

    time: float  # s
    x: float  # m
    y: float
    z: float
    roll: float  # rad
    pitch: float
    yaw: float
    rocker: float
    bogie: Array  # (2,)
    steering: Array  # (6,)
    wheel_angle: Array  # (6,)
