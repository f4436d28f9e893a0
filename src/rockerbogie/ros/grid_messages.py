"""Maps of heights from ROS messages, and costs as ROS messages.

Every function takes objects with the fields of the message, so that ROS is not needed. Arrays are (rows, cols), y grows with
the row.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array
from ..errors import RockerbogieError
from .costmap import LETHAL, UNKNOWN

#: NumPy's types of the fields of a PointCloud2, by its numbers.
FIELD_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
#: Most nodes of a map made from points: a stray point far away would need more.
MOST_NODES = 1 << 24
#: Labels of grid_map's arrays, the slower index first.
COLUMN_MAJOR, ROW_MAJOR = ("column_index", "row_index"), ("row_index", "column_index")


class Heights(NamedTuple):
    """A map of heights, as `CostMap.replace` takes it."""

    z: Array  # (rows, cols) m, NaN without data
    origin: tuple[float, float]  # x, y of z[0, 0], m
    spacing: float  # m


def read_grid_map(message: Any, layer: str = "elevation") -> Heights:
    """Read a layer of a grid_map_msgs/GridMap.

    The message is a circular buffer whose first cell has the greatest x and y; its rows go along −x, its columns along −y.

    Args:
        message: grid_map_msgs/GridMap.
        layer: name of the layer. Cells without a value in one of the message's basic layers are missing data.

    Returns:
        The heights.

    Raises:
        RockerbogieError: no such layer, an array of another size or order, a rotated map.
    """
    names = list(message.layers)
    if layer not in names:
        raise RockerbogieError(f"the grid map has no layer {layer!r}; it has {', '.join(names) or 'none'}")
    z = _unrolled(message, names.index(layer))
    for name in message.basic_layers:
        if name != layer and name in names:
            z = np.where(np.isnan(_unrolled(message, names.index(name))), np.nan, z)
    info = message.info
    _check_level(info.pose.orientation, "the grid map")
    step = float(info.resolution)
    rows, cols = z.shape
    x, y = float(info.pose.position.x), float(info.pose.position.y)
    return Heights(z, (x - 0.5 * (cols - 1) * step, y - 0.5 * (rows - 1) * step), step)


def _unrolled(message: Any, index: int) -> Array:
    """Return an array of a grid map as (rows, cols) with y growing with the row."""
    data = message.data[index]
    labels = tuple(dim.label for dim in data.layout.dim)
    if labels not in (COLUMN_MAJOR, ROW_MAJOR):
        raise RockerbogieError(f"an array of the grid map has the dimensions {labels}: give {COLUMN_MAJOR} or {ROW_MAJOR}")
    shape = tuple(int(dim.size) for dim in data.layout.dim)
    values = np.asarray(data.data, dtype=float)[int(data.layout.data_offset) :]
    if not shape[0] * shape[1] or values.size != shape[0] * shape[1]:
        raise RockerbogieError(f"an array of the grid map holds {values.size} values for {shape[0]} x {shape[1]} cells")
    matrix = values.reshape(shape)
    along_x = matrix.T if labels == COLUMN_MAJOR else matrix  # its rows go along -x
    along_x = np.roll(along_x, (-int(message.outer_start_index), -int(message.inner_start_index)), axis=(0, 1))
    return np.ascontiguousarray(along_x[::-1, ::-1].T)


def fill_grid_map(
    message: Any,
    layers: Mapping[str, Array],
    origin: tuple[float, float],
    spacing: float,
    array: Callable[[], Any] | None = None,
    dimension: Callable[[], Any] | None = None,
) -> Any:
    """Write layers into a grid_map_msgs/GridMap.

    Args:
        message: an empty message, filled; its header is left to the caller.
        layers: name -> (rows, cols).
        origin: x, y of the centre of cell [0, 0], m.
        spacing: side of a cell, m.
        array: makes a std_msgs/Float32MultiArray; `None`: of std_msgs.
        dimension: makes a std_msgs/MultiArrayDimension; `None`: of std_msgs.

    Returns:
        The message.

    Raises:
        RockerbogieError: layers of different shapes, or none.
    """
    if array is None or dimension is None:
        from std_msgs.msg import Float32MultiArray, MultiArrayDimension

        array, dimension = array or Float32MultiArray, dimension or MultiArrayDimension
    shapes = {np.shape(values) for values in layers.values()}
    if len(shapes) != 1:
        raise RockerbogieError(f"layers of a grid map need one shape; they have {sorted(shapes)}")
    ((rows, cols),) = shapes
    message.layers, message.basic_layers, message.data = list(layers), [], []
    for values in layers.values():
        item = array()
        for label, size, stride in zip(COLUMN_MAJOR, (rows, cols), (rows * cols, cols), strict=True):
            part = dimension()
            part.label, part.size, part.stride = label, size, stride
            item.layout.dim.append(part)
        item.data = np.asarray(values, dtype=np.float32)[::-1, ::-1].ravel().tolist()
        message.data.append(item)
    message.outer_start_index = message.inner_start_index = 0
    info = message.info
    info.resolution, info.length_x, info.length_y = float(spacing), float(cols * spacing), float(rows * spacing)
    at, turn = info.pose.position, info.pose.orientation
    at.x, at.y, at.z = origin[0] + 0.5 * (cols - 1) * spacing, origin[1] + 0.5 * (rows - 1) * spacing, 0.0
    turn.x, turn.y, turn.z, turn.w = 0.0, 0.0, 0.0, 1.0
    return message


def read_occupancy(message: Any) -> tuple[NDArray[np.int8], tuple[float, float], float]:
    """Read a nav_msgs/OccupancyGrid.

    Args:
        message: the message.

    Returns:
        (rows, cols) costs, x and y of the centre of cell [0, 0] (m), side of a cell (m).

    Raises:
        RockerbogieError: a rotated grid, or data of another size.
    """
    info = message.info
    _check_level(info.origin.orientation, "the occupancy grid")
    values = np.asarray(message.data, dtype=np.int8)
    if values.size != info.height * info.width:
        raise RockerbogieError(f"the occupancy grid holds {values.size} values for {info.height} x {info.width} cells")
    step = float(info.resolution)
    origin = (float(info.origin.position.x) + 0.5 * step, float(info.origin.position.y) + 0.5 * step)
    return values.reshape(info.height, info.width), origin, step


def fill_occupancy(message: Any, costs: NDArray[np.int8], origin: tuple[float, float], spacing: float) -> Any:
    """Write costs into a nav_msgs/OccupancyGrid.

    Args:
        message: an empty message, filled; its header is left to the caller.
        costs: (rows, cols), -1 to 100.
        origin: x, y of the centre of cell [0, 0], m.
        spacing: side of a cell, m.

    Returns:
        The message.
    """
    info = message.info
    info.resolution, (info.height, info.width) = float(spacing), (int(n) for n in costs.shape)
    at, turn = info.origin.position, info.origin.orientation
    at.x, at.y, at.z = origin[0] - 0.5 * spacing, origin[1] - 0.5 * spacing, 0.0
    turn.x, turn.y, turn.z, turn.w = 0.0, 0.0, 0.0, 1.0
    message.data = costs.astype(np.int8).ravel().tolist()
    return message


def overlay(costs: NDArray[np.int8], origin: tuple[float, float], spacing: float, message: Any) -> NDArray[np.int8]:
    """Return costs raised to those of an occupancy grid, such as seen obstacles.

    Args:
        costs: (rows, cols), -1 to 100.
        origin: x, y of the centre of cell [0, 0], m.
        spacing: side of a cell, m.
        message: nav_msgs/OccupancyGrid in the same frame, of any resolution.

    Returns:
        (rows, cols): the greater cost of each cell and of the grid's cell at its centre. A cell is -1 only if it is so in both,
        or if it is -1 in `costs` and not lethal in the grid.
    """
    others, (x0, y0), step = read_occupancy(message)
    rows = np.rint((origin[1] + spacing * np.arange(costs.shape[0]) - y0) / step).astype(int)
    cols = np.rint((origin[0] + spacing * np.arange(costs.shape[1]) - x0) / step).astype(int)
    inside = ((rows >= 0) & (rows < others.shape[0]))[:, None] & ((cols >= 0) & (cols < others.shape[1]))
    picked = others[np.clip(rows, 0, others.shape[0] - 1)[:, None], np.clip(cols, 0, others.shape[1] - 1)]
    known = inside & (picked >= 0) & ((costs != UNKNOWN) | (picked >= LETHAL))
    return np.where(known, np.maximum(costs, picked), costs)


def read_cloud(message: Any, spacing: float) -> Heights:
    """Make a map of heights from a sensor_msgs/PointCloud2: the highest point of each cell.

    Args:
        message: the cloud, in the frame of the map, z up.
        spacing: side of a cell, m. Cell centres are multiples of it.

    Returns:
        The heights; NaN in cells without a point.

    Raises:
        RockerbogieError: no fields x, y, z, data of another size than stated, no finite point, or an extent of more than
            `MOST_NODES` cells.
    """
    check_spacing(spacing)
    fields = {field.name: field for field in message.fields}
    if missing := [name for name in "xyz" if name not in fields]:
        raise RockerbogieError(f"the point cloud has no field {', '.join(missing)}")
    order = ">" if message.is_bigendian else "<"
    kind = np.dtype(
        {
            "names": list("xyz"),
            "formats": [order + FIELD_TYPES[fields[name].datatype] for name in "xyz"],
            "offsets": [int(fields[name].offset) for name in "xyz"],
            "itemsize": int(message.point_step),
        }
    )
    data = np.frombuffer(bytes(message.data), dtype=np.uint8)
    stated = int(message.height), int(message.row_step)
    if data.size != stated[0] * stated[1] or stated[1] < int(message.width) * kind.itemsize:
        raise RockerbogieError(
            f"the point cloud holds {data.size} bytes for {stated[0]} lines of {stated[1]} bytes "
            f"with {message.width} points of {kind.itemsize} bytes each"
        )
    lines = data.reshape(stated)
    points = lines[:, : int(message.width) * kind.itemsize].copy().view(kind).ravel()
    x, y, z = (points[name].astype(float) for name in "xyz")
    finite = np.isfinite(x) & np.isfinite(y) & np.isfinite(z)
    if not finite.any():
        raise RockerbogieError("the point cloud has no finite point")
    cols, rows = (np.rint(values[finite] / spacing).astype(np.int64) for values in (x, y))
    first, shape = (int(rows.min()), int(cols.min())), (int(np.ptp(rows)) + 1, int(np.ptp(cols)) + 1)
    if shape[0] * shape[1] > MOST_NODES:
        raise RockerbogieError(
            f"the points spread over {shape[0]} x {shape[1]} cells of {spacing:g} m: crop the cloud, or use larger cells"
        )
    heights = np.full(shape, -np.inf)
    np.maximum.at(heights, (rows - first[0], cols - first[1]), z[finite])
    heights[np.isinf(heights)] = np.nan
    return Heights(heights, (first[1] * spacing, first[0] * spacing), float(spacing))


def check_spacing(spacing: float) -> None:
    """Raise if the side of a cell is not a length.

    Args:
        spacing: m.

    Raises:
        RockerbogieError: not finite, or not above 0.
    """
    if not (np.isfinite(spacing) and spacing > 0):
        raise RockerbogieError(f"spacing is {spacing!r}: give the side of a cell, m, above 0")


def _check_level(turn: Any, what: str) -> None:
    """Raise if an orientation is a rotation; all zeros is an unset one."""
    if max(abs(turn.x), abs(turn.y), abs(turn.z)) > 1e-6:
        raise RockerbogieError(f"{what} is rotated in its frame: publish it along the axes of a frame")
