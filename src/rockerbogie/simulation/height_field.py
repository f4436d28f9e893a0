"""Terrain of the simulation: a map resampled as a MuJoCo height field."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import TerrainError
from ..rover.model import Rover
from ..terrain.heightfield import Terrain

Array = NDArray[np.float64]
Region = tuple[float, float, float, float]

#: Largest distance between the triangles and the terrain, m, as far as the limits on the cell size below allow.
TRIANGLE_ERROR = 1e-4
#: Smallest cell in units of the wheel's radius and of its width. The first keeps the depth of a contact well below a cell. The
#: second keeps a wheel within the 50 contacts that MuJoCo holds for a pair of geoms.
CELL_OF_RADIUS, CELL_OF_WIDTH = 1 / 10, 1 / 8
#: Largest number of nodes.
MOST_NODES = 20_000_000


def add_terrain(spec: Any, terrain: Terrain, region: Region | None, cell: float) -> None:
    """Add the terrain to a model as the height field and geom `terrain`.

    Args:
        spec: `mujoco.MjSpec`; it is changed.
        terrain: the map.
        region: (xmin, ymin, xmax, ymax), m. None: the whole map.
        cell: largest distance between nodes, m.

    Raises:
        TerrainError: as for `sample_terrain`.
    """
    import mujoco

    x, y, z = sample_terrain(terrain, region, cell)
    low, rise = float(z.min()), max(float(np.ptp(z)), 1e-3)
    spec.add_hfield(
        name="terrain", nrow=len(y), ncol=len(x), size=[np.ptp(x) / 2, np.ptp(y) / 2, rise, 0.1],
        userdata=((z - low) / rise).ravel(),
    )  # fmt: skip
    spec.worldbody.add_geom(
        name="terrain", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="terrain",
        pos=[(x[0] + x[-1]) / 2, (y[0] + y[-1]) / 2, low], rgba=[0.7, 0.45, 0.3, 1], **terrain_contact(),
    )  # fmt: skip


def terrain_contact() -> dict[str, Any]:
    """Return the geom attributes of terrain.

    Returns:
        Attributes for `add_geom`: contacts with the rover only, with the rover's friction and stiffness.
    """
    return {"contype": 1, "conaffinity": 0, "priority": -1, "group": 1}


def sample_terrain(terrain: Terrain, region: Region | None, cell: float) -> tuple[Array, Array, Array]:
    """Return nodes and heights of a height field.

    Missing heights are those of the nearest node with data.
    Each node of the terrain is a node of the field, or each node of the field is one of the terrain. So creases of a
    bilinear terrain are kept.

    Args:
        terrain: the map.
        region: (xmin, ymin, xmax, ymax), m. None: the whole map.
        cell: largest distance between nodes, m.

    Returns:
        x (cols,), y (rows,) and heights (rows, cols), m.

    Raises:
        TerrainError: more than `MOST_NODES` nodes; a region without data or outside the map.
    """
    low_x, low_y, high_x, high_y = region or terrain.bounds
    x, y = _nodes(terrain.x, low_x, high_x, cell), _nodes(terrain.y, low_y, high_y, cell)
    if len(x) * len(y) > MOST_NODES:
        raise TerrainError(
            f"terrain {terrain.name!r} takes {len(x)} x {len(y)} nodes {x[1] - x[0]:.3g} m apart to simulate, more than "
            f"{MOST_NODES:,}: take a smaller region or a shorter path"
        )
    z = terrain.height(*np.meshgrid(x, y))
    missing = np.isnan(z)
    if missing.all():
        raise TerrainError(
            f"terrain {terrain.name!r} has no data in the region {region or terrain.bounds}: choose another region"
        )
    if missing.any():
        from scipy.ndimage import distance_transform_edt

        z = z[tuple(distance_transform_edt(missing, return_distances=False, return_indices=True))]
    return x, y, z


def default_cell(rover: Rover, terrain: Terrain, region: Region | None = None) -> float:
    """Return the node spacing for `TRIANGLE_ERROR`, at least the limits of the rover's wheels.

    Args:
        rover: gives the smallest cell by its wheels.
        terrain: the map.
        region: (xmin, ymin, xmax, ymax), m. None: the whole map.

    Returns:
        Distance between nodes, m.
    """
    smallest = max(CELL_OF_RADIUS * float(rover.wheel_radius.min()), CELL_OF_WIDTH * float(rover.wheel_width.max()))
    step = min(terrain.spacing)
    if step <= smallest:
        return smallest
    _, _, z = sample_terrain(terrain, region, step / 2)
    middle, corners = z[1:-1:2, 1:-1:2], (z[:-2:2, :-2:2], z[2::2, 2::2], z[:-2:2, 2::2], z[2::2, :-2:2])
    error = max(float(np.abs(middle - (a + b) / 2).max()) for a, b in (corners[:2], corners[2:]))
    divisions = max(np.sqrt(error / TRIANGLE_ERROR), 1.0)  # a triangle's error is proportional to the square of its size
    return float(max(step / divisions, smallest))


def _nodes(own: Array, low: float, high: float, cell: float) -> Array:
    """Return evenly spaced nodes that cover [low, high] between nodes of the terrain.

    Args:
        own: (n,) the terrain's nodes, m.
        low: lower end, m.
        high: upper end, m.
        cell: largest distance between nodes, m.

    Returns:
        (k,) m.

    Raises:
        TerrainError: the interval lies outside the map.
    """
    step = own[1] - own[0]
    first = max(int(np.floor((low - own[0]) / step + 1e-9)), 0)
    last = min(int(np.ceil((high - own[0]) / step - 1e-9)), len(own) - 1)
    if first >= last:
        raise TerrainError(
            f"the region from {low:g} to {high:g} m does not lie on the terrain, which spans {own[0]:g} to {own[-1]:g} m"
        )
    if cell > step:
        stride = min(round(cell / step), last - first)
        return own[first : last + 1 : stride]
    return np.linspace(own[first], own[last], (last - first) * int(np.ceil(step / cell - 1e-9)) + 1)
