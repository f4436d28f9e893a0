"""Named cases: rovers, terrains and the poses settled on them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rover.formats import load_rover
from ..rover.model import Rover
from ..terrain import surfaces
from ..terrain.heightfield import Terrain
from ..terrain.window import Interpolation

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
    every = [
        smooth_case(),
        rough_case(400),
        Case("rocks 10 cm, whole tread", percy, rocky_ground(0.1)),
        Case("rocks 5 cm, whole tread", percy, rocky_ground(0.05)),
        mars_case("cubic"),
        mars_case("linear"),
    ]
    if raster is not None:
        every.append(Case(f"{raster.name}, whole tread", curiosity, raster))
    return every


def mars_case(interpolation: Interpolation) -> Case:
    """Return Curiosity's whole treads on craters and hills on a 1 m grid.

    Args:
        interpolation: "linear" or "cubic".

    Returns:
        The case.
    """
    mars = surfaces.mars(1, size=200.0, spacing=1.0, k=0.0, smallest_crater=10.0, interpolation=interpolation)
    return Case(f"Mars 1 m {interpolation}, whole tread", load_rover("curiosity"), mars)


def grounds() -> Iterator[tuple[str, Terrain]]:
    """Yield the kinds of terrain on which the slowest poses are searched for, with their names.

    Near-flat terrain is a tie between equal minima of the gap; a wall makes bounds on it loose.

    Returns:
        Name and terrain of each kind.
    """
    yield "smooth cubic", smooth_case().terrain
    yield "flat cubic", surfaces.plane(0.1, size=12.0, spacing=0.1, interpolation="cubic")
    yield "near-flat cubic", near_flat()
    yield "wall of 10 m, cubic", wall(10.0)
    yield "wall of 10 km, cubic", wall(1e4)
    rocks = rocky_ground(0.1)
    yield "rocks 10 cm linear", rocks
    yield "rocks 10 cm cubic", Terrain.from_array(rocks.z, rocks.spacing, rocks.origin, "cubic")
    z = rocks.z.copy()
    z[::12, ::12] = np.nan
    yield "rocks 10 cm linear, missing nodes", Terrain.from_array(z, rocks.spacing, rocks.origin, "linear")
    yield "1 cm noise linear", rough_case(400).terrain
    yield "Mars 1 m linear", mars_case("linear").terrain
    yield "Mars 1 m cubic", mars_case("cubic").terrain


def waiting_cases() -> list[Case]:
    """Return Curiosity's whole treads on ordinary and on difficult terrain.

    Returns:
        The cases.
    """
    every = dict(grounds())
    rocks, mars = ("rocks 10 cm linear", "rocks 10 cm cubic"), ("Mars 1 m linear", "Mars 1 m cubic")
    names = (*rocks, "near-flat cubic", "wall of 10 km, cubic", *mars)
    return [Case(name, load_rover("curiosity"), every[name]) for name in names]


def near_flat() -> Terrain:
    """Return level cubic terrain of 10 cm cells with 1e-8 m of noise, like a flat raster.

    Returns:
        The terrain, 12 m a side.
    """
    z = np.random.default_rng(4).normal(0.0, 1e-8, (121, 121))
    return Terrain.from_array(z, 0.1, (-6.0, -6.0), "cubic", name="near-flat")


def wall(height: float) -> Terrain:
    """Return cubic terrain with a vertical wall, as unmarked missing data makes: 10 cm cells.

    Args:
        height: m.

    Returns:
        The terrain, 6 m a side, low for x < 0.
    """
    z = np.full((61, 61), 100.0)
    z[:, :30] -= height
    return Terrain.from_array(z, 0.1, (-3.0, -3.0), "cubic", name=f"wall of {height:g} m")


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
