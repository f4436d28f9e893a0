"""Meshes of terrain within a triangle budget, coloured by height, slope or a layer."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...arrays import Array
from ...errors import RockerbogieError, TerrainError, expect
from ...terrain.heightfield import Terrain
from .colours import Legend, colour_table, colours_of
from .mesh import Index, colour_of

if TYPE_CHECKING:
    import xarray as xr

#: xmin, ymin, xmax, ymax, m.
Bounds = tuple[float, float, float, float]

SOIL = colour_of("#d9b48f")
#: Colour of the sides of a block cut out of the terrain.
CUT = colour_of("#b9a58e")
#: Greatest number of triangles of a terrain mesh, unless another is given.
TRIANGLES = 300_000
#: Cells drawn per cell of cubic terrain along each side, at most.
FINEST = 4
#: Ratio of neighbouring cells outside the dense part of a graded grid.
COARSER = 1.6
#: Direction to the sun of the hillshade: from the north-west, 45 degrees high.
_SUN = np.array([-0.5, 0.5, np.sqrt(0.5)])
#: Colour modes beside the name of a map's layer.
MODES = ("plain", "hillshade", "height", "slope")


class Grid(NamedTuple):
    """Heights of a part of the terrain on the grid that is drawn."""

    x: Array  # (cols,) m
    y: Array  # (rows,) m
    z: Array  # (rows, cols) m; NaN is missing data
    note: str  # spacing of the grid, and how it relates to the nodes of the terrain


class TerrainMesh(NamedTuple):
    """Triangles of a terrain with a colour at each vertex."""

    vertices: Array  # (n, 3) m
    faces: Index  # (m, 3), counter-clockwise from above
    colours: Array  # (n, 3) red, green, blue, 0 to 1
    legend: Legend | None  # None for plain and hillshade
    note: str  # spacing of the grid that is drawn


def terrain_grid(terrain: Terrain, bounds: Bounds | None = None, triangles: int = TRIANGLES) -> Grid:
    """Return heights on a grid that gives at most a number of triangles.

    Every k-th node is taken where all nodes would be too many. If there is room, the cells of cubic terrain are divided, to show
    its curvature.

    Args:
        terrain: the terrain.
        bounds: part to draw, m; default: all of it. It is widened to whole cells.
        triangles: greatest number of triangles.

    Returns:
        The grid.

    Raises:
        TerrainError: bounds beside the terrain, or fewer than two triangles.
    """
    expect(terrain, Terrain, "terrain", "make one with rockerbogie.Terrain.from_array, from_raster or rockerbogie.surfaces")
    if triangles < 2:
        raise TerrainError(f"a mesh of {triangles} triangles cannot show terrain: give at least 2")
    rows, cols = terrain.z.shape
    spans = []
    for axis, nodes in ((0, cols), (1, rows)):
        low, high = (0.0, nodes - 1.0)
        if bounds is not None:
            low, high = ((bounds[axis + end] - terrain.origin[axis]) / terrain.spacing[axis] for end in (0, 2))
        first, last = max(0, int(np.floor(low + 1e-9))), min(nodes - 1, int(np.ceil(high - 1e-9)))
        if not first < last:
            raise TerrainError(f"bounds {bounds} lie outside the terrain, which spans {terrain.bounds}")
        spans.append((first, last))
    cells = [last - first for first, last in spans]
    finest = FINEST if terrain.interpolation == "cubic" else 1
    room = triangles / (2 * cells[0] * cells[1])
    finer = max(1, min(finest, int(np.sqrt(room))))
    every = 1
    while finer == 1 and 2 * np.prod([-(-count // every) for count in cells]) > triangles and every < max(cells):
        every += max(1, every // 8)
    x, y = (terrain.origin[axis] + terrain.spacing[axis] * _stations(*spans[axis], every, finer) for axis in (0, 1))
    z = terrain.height(*np.meshgrid(x, y))
    dx, dy = (spacing * every / finer for spacing in terrain.spacing)
    step = f"{dx:.3g} m" if np.isclose(dx, dy) else f"{dx:.3g} by {dy:.3g} m"
    about = "finer than its nodes" if finer > 1 else "all nodes of the terrain"
    if every > 1:
        about = f"1 in {every} nodes of the terrain"
    return Grid(x, y, z, f"grid {step} ({about})")


def graded_grid(terrain: Terrain, centre: tuple[float, float], radius: float, cells: int) -> Grid:
    """Return heights on a grid that is dense near a position and coarser with the distance.

    Args:
        terrain: the terrain.
        centre: x and y, m.
        radius: half the side of the dense square, m.
        cells: cells along a side of the dense square, at most.

    Returns:
        The grid. Its lines lie on nodes where the cells are as large as those of the terrain.
    """
    lines, steps = [], []
    for axis, nodes in ((0, terrain.z.shape[1]), (1, terrain.z.shape[0])):
        origin, spacing = terrain.origin[axis], terrain.spacing[axis]
        every = max(1, int(np.ceil(2 * radius / spacing / cells)))
        at = _graded((centre[axis] - origin) / spacing, radius / spacing, every, nodes)
        lines.append(origin + spacing * at)
        steps.append(spacing * every)
    x, y = lines
    note = f"grid {max(steps):.3g} m near the rover, coarser with the distance"
    return Grid(x, y, terrain.height(*np.meshgrid(x, y)), note)


def _graded(middle: float, half: float, every: int, nodes: int) -> Array:
    """Return nodes: `every` nodes apart within `half` of a position, further apart beyond it."""
    dense = np.arange(0.0, half + every, every)
    growing = np.cumsum(every * COARSER ** np.arange(1.0, 1.0 + np.log(nodes + 1.0) / np.log(COARSER)))
    away = np.concatenate([dense, dense[-1] + growing])
    at = round(middle) + np.concatenate([-away[::-1], away])
    return np.unique(np.append(np.clip(at.round(), 0, nodes - 1), (0, nodes - 1)))


def _stations(first: int, last: int, every: int, finer: int) -> Array:
    """Return the grid lines between two nodes, in nodes; the last one is kept."""
    if finer > 1:
        return np.linspace(first, last, (last - first) * finer + 1)
    at = np.arange(first, last, every, dtype=float)
    return np.append(at, float(last))


def grid_faces(z: Array) -> Index:
    """Return the triangles of a grid of heights; cells with missing data are left out.

    Args:
        z: (rows, cols) m.

    Returns:
        (m, 3) indices into the flat grid, counter-clockwise from above.
    """
    rows, cols = z.shape
    a = (np.arange(rows - 1)[:, None] * cols + np.arange(cols - 1)).ravel()
    known = np.isfinite(z)
    whole = (known[:-1, :-1] & known[:-1, 1:] & known[1:, :-1] & known[1:, 1:]).ravel()
    a = a[whole]
    faces = np.concatenate([np.stack([a, a + 1, a + cols + 1], axis=1), np.stack([a, a + cols + 1, a + cols], axis=1)])
    return faces.astype(np.int32)


def grid_normals(x: Array, y: Array, z: Array) -> Array:
    """Return upward unit normals of a grid, by differences that leave out missing data.

    Args:
        x: (cols,) m.
        y: (rows,) m.
        z: (rows, cols) m.

    Returns:
        (rows, cols, 3); vertical where a height or all its neighbours are missing.
    """
    slope = [_difference(z, x, 1), _difference(z, y, 0)]
    normal = np.stack([-slope[0], -slope[1], np.ones_like(z)], axis=-1)
    return np.asarray(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def _difference(z: Array, at: Array, axis: int) -> Array:
    """Return dz/dx along an axis: central where both neighbours exist, else one-sided, else 0."""
    step = np.diff(at).reshape((-1, 1) if axis == 0 else (1, -1))
    rise = np.diff(z, axis=axis)
    pad = [(0, 0), (0, 0)]
    total, weight = np.zeros_like(z), np.zeros_like(z)
    known = np.isfinite(rise)
    for before in (0, 1):
        pad[axis] = (before, 1 - before)
        total += np.pad(np.where(known, rise, 0.0), pad)
        weight += np.pad(np.where(known, np.broadcast_to(step, rise.shape), 0.0), pad)
    return np.asarray(np.divide(total, weight, out=np.zeros_like(z), where=weight > 0))


def hillshade(x: Array, y: Array, z: Array) -> Array:
    """Return the illumination of a grid from the north-west.

    Args:
        x: (cols,) m.
        y: (rows,) m.
        z: (rows, cols) m.

    Returns:
        (rows, cols) from 0.35 in the shade to 1 facing the sun.
    """
    return np.asarray(0.35 + 0.65 * np.clip(grid_normals(x, y, z) @ _SUN, 0.0, 1.0))


def terrain_mesh(
    terrain: Terrain,
    bounds: Bounds | None = None,
    *,
    colour: str = "height",
    maps: xr.Dataset | None = None,
    limits: tuple[float, float] | None = None,
    colour_map: str | None = None,
    triangles: int = TRIANGLES,
    shaded: bool = True,
) -> TerrainMesh:
    """Return a part of a terrain as triangles with colours.

    Args:
        terrain: the terrain.
        bounds: xmin, ymin, xmax, ymax, m; default: all of it.
        colour: plain, hillshade, height, slope, or the name of a layer of `maps`.
        maps: map with that layer, from `traversability`.
        limits: values of the first and last colour, in the layer's units (m; rad for slope); default: the extremes.
        colour_map: viridis, cividis or terrain; default: terrain for heights, viridis for others.
        triangles: greatest number of triangles; beyond it, only every k-th node is drawn (`note`).
        shaded: multiply colours by the hillshade.

    Returns:
        The mesh; cells with missing data are left out.

    Raises:
        RockerbogieError: an unknown colour, layer or colour map; bounds beside the terrain.
    """
    return grid_mesh(terrain_grid(terrain, bounds, triangles), colour, maps, limits, colour_map, shaded)


def grid_mesh(
    grid: Grid, colour: str = "height", maps: xr.Dataset | None = None, limits: tuple[float, float] | None = None,
    colour_map: str | None = None, shaded: bool = True, skirt: float = 0.0,
) -> TerrainMesh:  # fmt: skip
    """Return a grid of heights as triangles with colours.

    Args:
        grid: from `terrain_grid` or `graded_grid`.
        colour: as `terrain_mesh`, as are the following.
        maps: map with that layer.
        limits: values of the first and last colour.
        colour_map: viridis, cividis or terrain.
        shaded: multiply colours by the hillshade.
        skirt: height of a vertical strip below the outer edges, m. It covers gaps to neighbouring meshes of other spacing.

    Returns:
        The mesh; cells with missing data are left out.

    Raises:
        RockerbogieError: an unknown colour, layer or colour map.
    """
    x, y, z, note = grid
    points = np.stack([*np.meshgrid(x, y), z], axis=-1).reshape(-1, 3)
    legend = None
    if colour in ("plain", "hillshade"):
        colours = np.broadcast_to(np.array(SOIL), (*z.shape, 3))
    else:
        values, legend = coloured_values(x, y, z, colour, maps, limits, colour_map)
        colours = colours_of(values, legend)
    if colour == "hillshade" or (shaded and colour != "plain"):
        colours = colours * hillshade(x, y, z)[..., None]
    colours = np.reshape(colours, (-1, 3))
    faces = grid_faces(z)
    if skirt > 0.0:
        edge, strip = _edge_strip(z)
        faces = np.concatenate([faces, strip + len(points)])
        points = np.concatenate([points, points[edge], points[edge] - (0.0, 0.0, skirt)])
        colours = np.concatenate([colours, colours[edge], colours[edge]])
    used = np.unique(faces)
    place = np.zeros(len(points), dtype=np.int32)
    place[used] = np.arange(len(used), dtype=np.int32)
    return TerrainMesh(points[used], place[faces], np.array(colours[used]), legend, note)


def _edge_strip(z: Array) -> tuple[Index, Index]:
    """Return the nodes along the outer edges of a grid, and the triangles of a strip below them.

    Args:
        z: (rows, cols) m; the strip is interrupted where heights are missing.

    Returns:
        Nodes (n,) of the flat grid, around it; triangles (m, 3), indices into these nodes followed by their copies below.
    """
    node = np.arange(z.size).reshape(z.shape)
    around = np.concatenate([node[0], node[1:, -1], node[-1, -2::-1], node[-2::-1, 0]])  # ends where it begins
    known = np.isfinite(z.ravel()[around])
    k = np.flatnonzero(known[:-1] & known[1:])
    below = k + len(around)
    strip = np.concatenate([np.stack([k, below, k + 1], axis=1), np.stack([k + 1, below, below + 1], axis=1)])
    return around, strip.astype(np.int32)


def edge_error(terrain: Terrain, grid: Grid) -> float:
    """Return the greatest height between the outer edges of a grid and those of the terrain.

    Args:
        terrain: the terrain.
        grid: of a part of it.

    Returns:
        m; 0 without data.
    """
    fine = FINEST if terrain.interpolation == "cubic" else 1
    worst = 0.0
    for axis, along, across in ((0, grid.x, grid.y), (1, grid.y, grid.x)):
        count = round((along[-1] - along[0]) / terrain.spacing[axis]) * fine + 1
        at = np.linspace(along[0], along[-1], count)
        for end in (0, -1):
            beside = np.full(count, across[end])
            drawn = np.interp(at, along, grid.z[end] if axis == 0 else grid.z[:, end])
            error = np.abs((terrain.height(at, beside) if axis == 0 else terrain.height(beside, at)) - drawn)
            worst = max(worst, float(np.max(error, initial=0.0, where=np.isfinite(error))))
    return worst


def coloured_values(
    x: Array, y: Array, z: Array, colour: str, maps: xr.Dataset | None = None, limits: tuple[float, float] | None = None,
    colour_map: str | None = None,
) -> tuple[Array, Legend]:  # fmt: skip
    """Return the values that colour a grid, and their scale.

    Args:
        x: (cols,) m.
        y: (rows,) m.
        z: (rows, cols) m.
        colour: height, slope, or the name of a layer of `maps`.
        maps: map with that layer.
        limits: values of the first and last colour; default: the extremes.
        colour_map: default: terrain for heights, viridis for others.

    Returns:
        Values (rows, cols), NaN if missing, and their legend.

    Raises:
        RockerbogieError: no such layer, a layer without a number for each cell, limits that are not low, high.
    """
    if colour == "height":
        values, label, units = z, "height", "m"
    elif colour == "slope":
        values, label, units = np.arccos(np.clip(grid_normals(x, y, z)[..., 2], -1, 1)), "slope", "rad"
        values = np.where(np.isfinite(z), values, np.nan)
    else:
        if maps is None or colour not in maps or set(maps[colour].dims) != {"y", "x"}:
            layers = [] if maps is None else [str(name) for name, v in maps.data_vars.items() if set(v.dims) == {"y", "x"}]
            raise RockerbogieError(f"colour {colour!r} is not known: give {', '.join([*MODES, *layers])}")
        layer = maps[colour]
        values = layer.sel(x=x, y=y, method="nearest").transpose("y", "x").values.astype(float)
        outside = np.abs(x - layer["x"].sel(x=x, method="nearest").values) > _cell(layer["x"].values)
        beyond = np.abs(y - layer["y"].sel(y=y, method="nearest").values) > _cell(layer["y"].values)
        values = np.where(outside[None, :] | beyond[:, None], np.nan, values)
        label, units = str(layer.attrs.get("long_name", colour)), str(layer.attrs.get("units", ""))
        if colour == "passable":
            from ...maps.style import CLASSES

            bounds = np.array([one.most for one in CLASSES])
            classes = np.where(np.isfinite(values), np.searchsorted(bounds, values), np.nan)
            colours = np.array([colour_of(one.colour) for one in CLASSES])
            return classes, Legend(
                "headings passable", "", 0.0, float(len(CLASSES) - 1), colours, tuple(c.label for c in CLASSES)
            )
    known = values[np.isfinite(values)]
    low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 1.0)
    if limits is not None:
        low, high = limits
        if not (np.isfinite([low, high]).all() and low < high):
            raise RockerbogieError(f"limits are {limits!r}: give (low, high), finite, low below high")
    table = colour_table(colour_map or ("terrain" if colour == "height" else "viridis"))
    return values, Legend(label, units, low, high, table)


def _cell(at: Array) -> float:
    """Return a little more than half the spacing of coordinates; infinity for one."""
    return 0.51 * float(np.abs(np.diff(at)).max()) if len(at) > 1 else np.inf


def block_base(z: Array) -> float:
    """Return the height of the base of a block of terrain.

    Args:
        z: heights, m.

    Returns:
        15 % of the relief below the lowest point, and at least 0.05 m, m.
    """
    low, high = float(np.nanmin(z)), float(np.nanmax(z))
    return low - max(0.15 * (high - low), 0.05)
