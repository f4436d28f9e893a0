"""Growth of cost with poses per call, with the size of the map, and with finer cells."""

from __future__ import annotations

import numpy as np

from .._kernels.jit.parallel import threads
from ..rover.formats import load_rover
from ..settling.settle import settle
from ..terrain import surfaces
from .cases import Case, places, rough_case, smooth_case
from .clock import best

Row = dict[str, float]


def growth(poses: int = 3000) -> dict[str, list[Row]]:
    """Time settling on one thread for growing batches and maps.

    Args:
        poses: timed per case.

    Returns:
        µs per pose. `poses`: in one call on smooth terrain. `nodes`: maps of the same rough terrain, thin discs. `cells`: rocks
        of 40 cm and more on ever finer grids, Perseverance's whole tread.
    """
    smooth, percy = smooth_case(), load_rover("perseverance")
    with threads(1):
        return {
            "poses": [{"poses": count, "us": cost(smooth, count)} for count in (1, 10, 100, 1000, 10_000, 100_000)],
            "nodes": [{"nodes": side**2, "us": cost(rough_case(side), poses)} for side in (128, 512, 2048)],
            "cells": [
                {
                    "radius_over_cell": float(percy.wheel_radius[0]) / cell,
                    "us": cost(Case("", percy, surfaces.rocks(0.1, 1, size=20.0, spacing=cell, smallest=0.4)), poses),
                }
                for cell in (0.2, 0.1, 0.05, 0.025)
            ],
        }


def cost(case: Case, poses: int) -> float:
    """Return the time per pose of the fastest of some calls.

    Args:
        case: rover and terrain.
        poses: per call.

    Returns:
        µs.
    """
    x, y, yaw = places(case, poses)
    settle(case.rover, case.terrain, x, y, yaw)
    return 1e6 * best(lambda: settle(case.rover, case.terrain, x, y, yaw), int(np.clip(10_000 // poses, 5, 200))) / poses
