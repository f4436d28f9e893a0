"""Named cases: rovers, terrains and the poses settled on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rover.formats import load_rover
from ..rover.model import Rover
from ..terrain import surfaces
from ..terrain.heightfield import Terrain

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """Rover and terrain of a benchmark."""

    name: str
    rover: Rover
    terrain: Terrain


def cases(raster: Terrain | None = None) -> list[Case]:
    """Return the named cases.

    They are smooth cubic terrain, rough linear terrain under thin discs, rocks under whole treads, Mars at map resolution, and
    a raster file's terrain (linear) if one is given.

    Args:
        raster: terrain of one more case.

    Returns:
        The cases.
    """
    percy, curiosity = load_rover("perseverance"), load_rover("curiosity")
    mars = surfaces.mars(1, size=200.0, spacing=1.0, k=0.0, smallest_crater=10.0, interpolation="cubic")
    every = [
        smooth_case(),
        rough_case(400),
        Case("rocks 10 cm, whole tread", percy, rocky_ground(0.1)),
        Case("rocks 5 cm, whole tread", percy, rocky_ground(0.05)),
        Case("Mars 1 m cubic, whole tread", curiosity, mars),
        Case("Mars 1 m linear, whole tread", curiosity, Terrain.from_array(mars.z, mars.spacing, mars.origin, "linear")),
    ]
    if raster is not None:
        every.append(Case(f"{raster.name}, whole tread", curiosity, raster))
    return every


def smooth_case() -> Case:
    """Return the paper's rover on smooth cubic terrain.

    Slopes are at most 15 deg, radii of curvature at least 0.5 m.

    Returns:
        The case.
    """
    ground = surfaces.rough(1, max_slope=np.radians(15), min_radius=0.5, size=12.0)
    return Case("smooth cubic, thin disc", load_rover("elhami-dashti"), ground)


def rough_case(nodes: int) -> Case:
    """Return Rocky 7 with wheels of width 0 on linear terrain of random heights.

    Heights are normally distributed with a standard deviation of 1 cm; nodes are 5 cm apart.

    Args:
        nodes: nodes a side.

    Returns:
        The case.
    """
    noise = np.random.default_rng(0).normal(size=(nodes, nodes)) * 0.01
    ground = Terrain.from_array(noise, 0.05, interpolation="linear", name="1 cm noise")
    return Case("rough 5 cm, thin disc", load_rover("rocky7").replace(wheel_width=np.zeros(6)), ground)


def rocky_ground(spacing: float) -> Terrain:
    """Return linear terrain with an area fraction of 0.1 of rocks.

    Args:
        spacing: of the nodes, m. The smallest rock has a diameter of 10 cm or two cells.

    Returns:
        The terrain, 40 m a side.
    """
    return surfaces.rocks(0.1, 1, size=40.0, spacing=spacing, smallest=max(0.1, 2 * spacing))


def places(case: Case, poses: int) -> tuple[Array, Array, Array]:
    """Return seeded random positions and yaws on the map, outside missing data.

    Args:
        case: rover and terrain; positions keep a wheelbase from the edge.
        poses: their number.

    Returns:
        x, y (m) and yaw (rad), (poses,) each.
    """
    rng = np.random.default_rng(2)
    x0, y0, x1, y1 = case.terrain.bounds
    margin = case.rover.wheelbase
    x, y = rng.uniform(x0 + margin, x1 - margin, poses), rng.uniform(y0 + margin, y1 - margin, poses)
    for _ in range(100):
        lost = np.isnan(case.terrain.height(x, y))
        if not lost.any():
            break
        x[lost], y[lost] = rng.uniform(x0 + margin, x1 - margin, lost.sum()), rng.uniform(y0 + margin, y1 - margin, lost.sum())
    return x, y, rng.uniform(-np.pi, np.pi, poses)
