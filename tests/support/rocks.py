"""Boxes as rocks, the same in every engine in which an exported rover is dropped."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import rockerbogie as rb


class Rock(NamedTuple):
    """A box on the plane z = 0."""

    size: tuple[float, float, float]  # m
    at: tuple[float, float, float]  # m, of its centre
    rpy: tuple[float, float, float]  # rad, R = Rz Ry Rx


def rocks(rover: rb.Rover, seed: int = 3, count: int = 30) -> list[Rock]:
    """Boxes of up to a wheel's diameter, at random under the rover and beside it."""
    rng = np.random.default_rng(seed)
    length, radius = float(np.ptp(rover.hubs[:, 0])), float(rover.wheel_radius[0])
    boxes = []
    for _ in range(count):
        x, y = rng.uniform(-1, 1, 2) * length
        side = 2 * radius * rng.uniform(0.3, 1.0)
        roll, pitch, yaw = rng.uniform(-0.3, 0.3, 3)
        boxes.append(Rock((side, side, side / 2), (float(x), float(y), 0.0), (float(roll), float(pitch), float(yaw))))
    return boxes


def start_height(rover: rb.Rover) -> float:
    """Height of the rover's origin with its wheels half a radius above the highest rock, m."""
    return float(-(rover.hubs[:, 2] - rover.wheel_radius).min() + rover.wheel_radius[0])
