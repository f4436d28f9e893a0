"""Cost map of changing heights: equal to `traversability` bit for bit; ROS messages."""

from __future__ import annotations

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import rockerbogie as rb
from rockerbogie.ros.costmap import CostMap
from rockerbogie.ros.grid_messages import fill_grid_map, fill_occupancy, overlay, read_cloud, read_grid_map, read_occupancy
from ros.ros_bench import PATIENCE, use_own_domain

Array = NDArray[np.float64]
ORIGIN, STEP = (1.0, -2.0), 0.1
LAYERS = ("tilt", "exceeded", "worst_clearance", "roughness")


def heights(seed: int, rows: int = 31, cols: int = 36) -> Array:
    """Rough heights, m."""
    noise = np.random.default_rng(seed).normal(size=(rows, cols))
    return np.asarray(gaussian_filter(noise, 3) * 0.6)


def assert_equal_bits(costs: CostMap) -> None:
    """The layers are those of the whole map made anew."""
    assert costs.terrain is not None
    whole = rb.traversability(
        costs.rover, costs.terrain, costs.headings, costs.resolution, costs.limits, mode=costs.mode, layers=costs.layers
    )
    for name in whole.data_vars:
        assert whole[name].values.tobytes() == costs.maps[name].values.tobytes(), name
    assert whole.identical(costs.maps)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize("name", ["osr", "sawppy"])
def test_equals_traversability_bit_for_bit(name: str, interpolation: Any) -> None:
    """After parts of several sizes, at the edge, in a corner, of one node, and of nothing."""
    costs = CostMap(rb.load_rover(name), headings=2, layers=LAYERS, interpolation=interpolation)
    costs.replace(heights(0), ORIGIN, STEP)
    assert_equal_bits(costs)
    for seed, (row, col, rows, cols) in enumerate([(9, 14, 9, 7), (0, 0, 5, 5), (26, 10, 5, 21), (15, 15, 1, 1)], 1):
        costs.update(heights(seed, rows, cols) if rows > 1 else [[0.2]], (ORIGIN[0] + col * STEP, ORIGIN[1] + row * STEP))
        assert_equal_bits(costs)
    assert costs.terrain is not None
    assert costs.replace(costs.terrain.z, ORIGIN, STEP).cells == 0


def test_settles_only_cells_that_the_change_can_reach() -> None:
    rover = rb.load_rover("sawppy")
    costs = CostMap(rover, headings=2)
    costs.replace(heights(0, 101, 101), (0.0, 0.0), STEP)
    change = costs.update(heights(1, 11, 11) * 0.5, (4.5, 4.5))
    assert not change.everything
    assert 11 * 11 < change.cells < 48 * 48, "of 101 x 101"
    assert change.rows[0] <= 45 <= 56 <= change.rows[1]
    assert change.cols[0] <= 45 <= 56 <= change.cols[1]


def test_missing_data_comes_and_goes() -> None:
    costs = CostMap(rb.load_rover("sawppy"), headings=2, layers=LAYERS)
    z = heights(3, 31, 31)
    costs.replace(np.full_like(z, np.nan), ORIGIN, STEP)
    assert (costs.occupancy() == -1).all()
    with pytest.raises(rb.RockerbogieError, match="every height"):
        costs.layer("passable")
    z[10:14, 12:16] = np.nan
    costs.replace(z, ORIGIN, STEP)
    assert_equal_bits(costs)
    z[20:24, 2:6] = np.nan
    assert not costs.replace(z, ORIGIN, STEP).everything
    assert_equal_bits(costs)
    costs.replace(heights(3, 31, 31), ORIGIN, STEP)
    assert_equal_bits(costs)
    costs.replace(np.full_like(z, np.nan), ORIGIN, STEP)
    assert (costs.occupancy() == -1).all()


def test_another_origin_and_another_resolution() -> None:
    costs = CostMap(rb.load_rover("sawppy"), headings=2, resolution=0.2)
    for z, origin, step in ((heights(0), ORIGIN, 0.1), (heights(1), (1.3, -1.8), 0.1), (heights(2), (1.3, -1.8), 0.05)):
        assert costs.replace(z, origin, step).everything
        assert costs.origin == origin
        assert costs.spacing == (0.2, 0.2)
        assert_equal_bits(costs)
        assert costs.occupancy().shape == costs.layer("passable").shape


def test_curvature_of_the_whole_map_counts() -> None:
    """Discs on smooth cubic terrain use the greatest curvature: a sharper part acts on all."""
    costs = CostMap(rb.load_rover("osr"), headings=2, interpolation="cubic")
    costs.replace(0.1 * heights(0), ORIGIN, STEP)
    assert costs.update(0.2 * heights(1, 15, 15), ORIGIN).everything
    assert_equal_bits(costs)


def test_occupancy_is_the_share_of_headings() -> None:
    costs = CostMap(rb.load_rover("sawppy"), headings=8)
    costs.replace(2.5 * heights(0), ORIGIN, STEP)
    share, found = costs.layer("passable"), costs.occupancy()
    assert found.dtype == np.int8
    assert (found[share == 1] == 0).all()
    assert (found[share == 0] == 100).all()
    assert (found[np.isnan(share)] == -1).all()
    between = (share > 0) & (share < 1)
    assert between.any()
    np.testing.assert_array_equal(found[between], np.rint(100 * (1 - share[between].astype(float))))


def test_bad_calls() -> None:
    rover = rb.load_rover("sawppy")
    with pytest.raises(rb.RockerbogieError, match="interpolation"):
        CostMap(rover, interpolation="nearest")  # type: ignore[arg-type]
    costs = CostMap(rover, headings=1)
    for call in (costs.occupancy, lambda: costs.maps, lambda: costs.update(heights(0), ORIGIN)):
        with pytest.raises(rb.RockerbogieError, match="no heights yet"):
            call()
    costs.replace(heights(0), ORIGIN, STEP)
    with pytest.raises(rb.RockerbogieError, match="between the nodes"):
        costs.update(np.zeros((3, 3)), (1.05, -2.0))
    with pytest.raises(rb.RockerbogieError, match="not within the map"):
        costs.update(np.zeros((3, 3)), (0.9, -2.0))
    for wrong in (np.ones((21, 21), dtype=bool), [["1", "2"], ["3", "4"]]):
        with pytest.raises(rb.RockerbogieError, match="heights are not numbers: .* is not a number"):
            costs.replace(wrong, (0.0, 0.0), STEP)
    with pytest.raises(rb.RockerbogieError, match="not a map"):
        costs.update(np.zeros(3), ORIGIN)
    with pytest.raises(rb.RockerbogieError, match="no layer 'tilt'"):
        costs.layer("tilt")


def space(**fields: Any) -> SimpleNamespace:
    return SimpleNamespace(**fields)


def pose() -> SimpleNamespace:
    return space(position=space(x=0.0, y=0.0, z=0.0), orientation=space(x=0.0, y=0.0, z=0.0, w=1.0))


def empty_grid_map() -> SimpleNamespace:
    info = space(resolution=0.0, length_x=0.0, length_y=0.0, pose=pose())
    return space(layers=[], basic_layers=[], data=[], outer_start_index=0, inner_start_index=0, info=info)


def empty_occupancy() -> SimpleNamespace:
    return space(info=space(resolution=0.0, width=0, height=0, origin=pose()), data=[])


def array() -> SimpleNamespace:
    return space(layout=space(dim=[], data_offset=0), data=[])


def dimension() -> SimpleNamespace:
    return space(label="", size=0, stride=0)


def by_definition(message: Any, index: int, x: float, y: float) -> float:
    """The value at a position, by grid_map's definition: cell (0, 0) has the greatest x and y."""
    info, data = message.info, message.data[index]
    rows, cols = round(info.length_x / info.resolution), round(info.length_y / info.resolution)
    i = int((info.pose.position.x + info.length_x / 2 - x) / info.resolution)
    j = int((info.pose.position.y + info.length_y / 2 - y) / info.resolution)
    i, j = (i + message.outer_start_index) % rows, (j + message.inner_start_index) % cols
    row_major = data.layout.dim[0].label == "row_index"
    return float(data.data[i * cols + j if row_major else j * rows + i])


@pytest.mark.parametrize("start", [(0, 0), (3, 5), (6, 1)])
@pytest.mark.parametrize("row_major", [False, True])
def test_grid_map_is_read_by_its_definition(start: tuple[int, int], row_major: bool) -> None:
    """Every cell, of circular buffers in both orders of storage."""
    rows, cols = 7, 9  # along x and y
    message = empty_grid_map()
    message.layers, message.basic_layers = ["variance", "elevation"], ["variance"]
    info = message.info
    info.resolution, info.length_x, info.length_y = 0.1, 0.7, 0.9
    info.pose.position.x, info.pose.position.y = 4.0, -3.0
    message.outer_start_index, message.inner_start_index = start
    rng = np.random.default_rng(0)
    for _ in message.layers:
        item = array()
        labels = [("row_index", rows), ("column_index", cols)]
        for label, size in labels if row_major else labels[::-1]:
            item.layout.dim.append(space(label=label, size=size, stride=0))
        item.data = rng.normal(size=rows * cols).tolist()
        message.data.append(item)
    message.data[0].data[11] = np.nan
    found = read_grid_map(message)
    assert found.z.shape == (cols, rows)
    assert found.spacing == 0.1
    np.testing.assert_allclose(found.origin, (3.7, -3.4), atol=1e-12)
    for r in range(cols):
        for c in range(rows):
            x, y = found.origin[0] + 0.1 * c, found.origin[1] + 0.1 * r
            valid = not np.isnan(by_definition(message, 0, x, y))
            np.testing.assert_equal(found.z[r, c], by_definition(message, 1, x, y) if valid else np.nan)
    assert np.isnan(found.z).sum() == 1
    with pytest.raises(rb.RockerbogieError, match="no layer 'slope'; it has variance, elevation"):
        read_grid_map(message, "slope")
    info.pose.orientation.z = 0.5
    with pytest.raises(rb.RockerbogieError, match="rotated"):
        read_grid_map(message)


def test_messages_are_read_back() -> None:
    z = heights(0, 5, 8).astype(np.float32).astype(float)
    message = fill_grid_map(empty_grid_map(), {"elevation": z, "passable": z + 1}, ORIGIN, STEP, array, dimension)
    found = read_grid_map(message)
    np.testing.assert_array_equal(found.z, z)
    np.testing.assert_allclose(found.origin, ORIGIN, atol=1e-12)
    assert by_definition(message, 1, ORIGIN[0] + 0.3, ORIGIN[1] + 0.2) == pytest.approx(z[2, 3] + 1, rel=1e-6)
    costs = np.arange(-1, 39, dtype=np.int8).reshape(5, 8)
    grid = fill_occupancy(empty_occupancy(), costs, ORIGIN, STEP)
    assert grid.data[2 * 8 + 3] == costs[2, 3], "rows of x, from the lowest y"
    assert (grid.info.width, grid.info.height) == (8, 5)
    np.testing.assert_allclose((grid.info.origin.position.x, grid.info.origin.position.y), (0.95, -2.05), err_msg="its corner")
    again, origin, step = read_occupancy(grid)
    np.testing.assert_array_equal(again, costs)
    np.testing.assert_allclose(origin, ORIGIN)
    assert step == STEP


def test_obstacles_are_laid_over() -> None:
    costs = np.array([[0, 50, -1], [100, -1, 20]], dtype=np.int8)
    other = fill_occupancy(empty_occupancy(), np.array([[60, 10, 100], [-1, 30, -1]], dtype=np.int8), (0.0, 0.0), 1.0)
    np.testing.assert_array_equal(overlay(costs, (0.0, 0.0), 1.0, other), [[60, 50, 100], [100, -1, 20]])
    np.testing.assert_array_equal(overlay(costs, (100.0, 0.0), 1.0, other), costs)


def cloud(points: Array) -> SimpleNamespace:
    """A cloud of x, y, z with a field between them, in two lines."""
    kind = np.dtype([("x", "<f4"), ("y", "<f4"), ("rgb", "<u4"), ("z", "<f4")])
    data = np.zeros(len(points), dtype=kind)
    data["x"], data["y"], data["z"] = points.T
    fields = [space(name=n, offset=kind.fields[n][1], datatype=7, count=1) for n in "xyz"]  # type: ignore[index]
    width = len(points) // 2
    return space(
        fields=fields, is_bigendian=False, point_step=kind.itemsize, row_step=kind.itemsize * width, height=2, width=width,
        data=data.tobytes(),
    )  # fmt: skip


def test_points_become_heights() -> None:
    points = np.array([[0.0, 0.0, 1.0], [0.04, -0.04, 3.0], [0.3, 0.1, -1.0], [0.31, 0.1, np.nan]])
    found = read_cloud(cloud(points), 0.1)
    expected = np.full((2, 4), np.nan)
    expected[0, 0], expected[1, 3] = 3.0, -1.0
    np.testing.assert_array_equal(found.z, expected)
    assert found.origin == (0.0, 0.0)
    with pytest.raises(rb.RockerbogieError, match="no finite point"):
        read_cloud(cloud(np.full((2, 3), np.nan)), 0.1)
    with pytest.raises(rb.RockerbogieError, match="crop the cloud"):
        read_cloud(cloud(np.array([[0.0, 0.0, 0.0], [1e6, 1e6, 0.0]])), 0.1)


def test_a_node_publishes_costs() -> None:
    """Points and obstacles in, costs out, between two nodes on this machine."""
    rclpy = pytest.importorskip("rclpy", reason="the wheels of ROS 2 are not installed")
    pytest.importorskip("sensor_msgs.msg", reason="the wheels of ROS 2 are not installed")
    from nav_msgs.msg import OccupancyGrid
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import PointCloud2, PointField

    from rockerbogie.ros.costmap_part import LATCHED, CostMapPart

    z = heights(5, 21, 26)
    y, x = np.indices(z.shape) * STEP
    plain = cloud(np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1))
    message = PointCloud2(
        height=plain.height, width=plain.width, point_step=plain.point_step, row_step=plain.row_step, data=plain.data,
        fields=[PointField(name=f.name, offset=f.offset, datatype=f.datatype, count=1) for f in plain.fields],
    )  # fmt: skip
    message.header.frame_id, message.header.stamp.sec = "map", 7
    use_own_domain()
    context = rclpy.Context()
    rclpy.init(context=context)
    try:
        node, other = (rclpy.create_node(name, context=context) for name in ("costmap_test", "planner_test"))
        part = CostMapPart(node, rb.load_rover("sawppy"), headings=2)
        received: list[Any] = []
        other.create_subscription(OccupancyGrid, "costmap", received.append, LATCHED)
        publisher = other.create_publisher(PointCloud2, "elevation_points", 1)
        executor = SingleThreadedExecutor(context=context)
        for each in (node, other):
            executor.add_node(each)
        end = time.monotonic() + PATIENCE
        while not received and time.monotonic() < end:
            if publisher.get_subscription_count() and not part.published:
                publisher.publish(message)
            executor.spin_once(timeout_sec=0.2)
        part.close()
        executor.shutdown()
    finally:
        rclpy.shutdown(context=context)
    assert received, f"no cost map within {PATIENCE:g} s"
    values, origin, step = read_occupancy(received[0])
    assert (received[0].header.frame_id, received[0].header.stamp.sec) == ("map", 7)
    costs = CostMap(rb.load_rover("sawppy"), headings=2)
    costs.replace(z.astype(np.float32), (0.0, 0.0), STEP)
    np.testing.assert_array_equal(values, costs.occupancy())
    np.testing.assert_allclose(origin, (0.0, 0.0), atol=1e-7)
    assert step == pytest.approx(STEP)
