"""Messages built from their definitions: /tf, and the node's cost map of grid maps."""

from __future__ import annotations

import importlib.util
import shutil
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.ros.costmap import CostMap
from rockerbogie.ros.grid_messages import fill_grid_map, read_grid_map, read_occupancy
from ros.ros_bench import Bench, needs_ros
from ros.test_costmap import heights

GENERATORS = [name for name in ("catkin_pkg", "em", "lark") if not importlib.util.find_spec(name)]
pytestmark = [
    needs_ros,
    pytest.mark.skipif(bool(GENERATORS), reason=f"generators are not installed: {', '.join(GENERATORS)} (extra dev)"),
    pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("g++")), reason="no gcc and g++"),
]
STEP = 0.1


@pytest.fixture(scope="module", autouse=True)
def built(tmp_path_factory):
    """Build tf2_msgs and grid_map_msgs, unless a ROS installation has them."""
    if importlib.util.find_spec("tf2_msgs") and importlib.util.find_spec("grid_map_msgs"):
        yield
        return
    file = Path(__file__).resolve().parents[2] / "tools" / "ros_messages.py"
    spec = importlib.util.spec_from_file_location("ros_messages", file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folder = tmp_path_factory.mktemp("messages")
    module.build(folder)
    sys.path.insert(0, str(folder))
    yield
    sys.path.remove(str(folder))


def test_transforms_are_those_of_odom():
    """Send joint states: /tf has the pose, frames and stamp of each odom message."""
    from nav_msgs.msg import Odometry
    from sensor_msgs.msg import JointState
    from tf2_msgs.msg import TFMessage

    rover = rb.load_rover("osr")
    with Bench(rover="osr", use_imu=False, start_position=[1.0, 2.0, 0.5]) as bench:
        joints = bench.publisher(JointState, "joint_states")
        odom, tf = bench.record(Odometry, "odom"), bench.record(TFMessage, "/tf")
        for k in range(20):
            message = JointState(name=[f"wheel_{w}_joint" for w in rover.wheel_names], position=[0.1 * k] * 6)
            message.header.stamp.sec, message.header.stamp.nanosec = 5, 20_000_000 * k
            bench.send(joints, message, "joint states")
        bench.until(lambda: len(odom) == 20 == len(tf), "transform of the last row")
    assert odom[-1][1].pose.pose.position.x > 1.05
    for (_, pose), (_, message) in zip(odom, tf, strict=True):
        (found,) = message.transforms
        assert found.header == pose.header
        assert (found.header.frame_id, found.child_frame_id) == ("odom", "base_link")
        at, moved = pose.pose.pose.position, found.transform.translation
        assert (moved.x, moved.y, moved.z) == (at.x, at.y, at.z)
        assert found.transform.rotation == pose.pose.pose.orientation


def grid_map(z, origin=(0.0, 0.0), second=7):
    from grid_map_msgs.msg import GridMap

    message = fill_grid_map(GridMap(), {"elevation": z}, origin, STEP)
    message.header.frame_id, message.header.stamp.sec = "map", second
    return message


def test_the_node_publishes_the_cost_map_of_a_grid_map():
    """Send a map, a change, obstacles and a wrong map: costs and layers are those of `CostMap`."""
    from diagnostic_msgs.msg import DiagnosticArray
    from grid_map_msgs.msg import GridMap
    from nav_msgs.msg import OccupancyGrid

    from rockerbogie.ros.costmap_part import LATCHED

    z = heights(5, 31, 36).astype(np.float32)
    changed = z.copy()
    changed[12:15, 20:24] += 0.1
    costs = CostMap(rb.load_rover("sawppy"), headings=4, layers=["worst_tilt"], limits="none")
    parameters = {"cost_map": True, "cost_map_headings": 4, "cost_map_layers": ["worst_tilt"], "cost_map_limits": "none"}
    with Bench(rover="sawppy", state_rate=20.0, **parameters) as bench:
        part = bench.node.cost_map
        found, layers = bench.record(OccupancyGrid, "costmap", LATCHED), bench.record(GridMap, "costmap_layers", LATCHED)
        state, publisher = bench.record(DiagnosticArray, "rover/state"), bench.publisher(GridMap, "elevation_map")

        def status():
            bench.until(lambda: state, "the node's state")
            return next(s for s in state[-1][1].status if s.name.endswith("cost map"))

        for count, heights_now in ((1, z), (2, changed)):
            publisher.publish(grid_map(heights_now, second=6 + count))
            bench.until(lambda count=count: len(found) == count == len(layers), "cost map")
            costs.replace(heights_now, (0.0, 0.0), STEP)
            values, origin, step = read_occupancy(found[-1][1])
            np.testing.assert_array_equal(values, costs.occupancy())
            assert (found[-1][1].header.frame_id, found[-1][1].header.stamp.sec) == ("map", 6 + count)
            np.testing.assert_allclose((*origin, step), (0.0, 0.0, STEP), atol=1e-6)
            for name in ("passable", "worst_tilt"):
                tilt = read_grid_map(layers[-1][1], name)
                np.testing.assert_array_equal(tilt.z, costs.layer(name).astype(np.float32))
                np.testing.assert_allclose(tilt.origin, (0.0, 0.0), atol=1e-9)
        assert 0 < part.cells < costs.layer("passable").size, "only what the change can reach"

        obstacles = OccupancyGrid(data=[100] * 9)
        obstacles.info.resolution, obstacles.info.width, obstacles.info.height = STEP, 3, 3
        obstacles.info.origin.position.x = obstacles.info.origin.position.y = 1.5 - STEP / 2
        bench.publisher(OccupancyGrid, "obstacles", LATCHED).publish(obstacles)
        bench.until(lambda: len(found) == 3, "cost map with obstacles")
        with_obstacles = costs.occupancy()
        with_obstacles[15:18, 15:18] = 100
        np.testing.assert_array_equal(read_occupancy(found[-1][1])[0], with_obstacles)
        assert part.cells == 0

        bench.until(lambda: "3 cost maps" in status().message, "state of the cost map")
        wrong = grid_map(z)
        wrong.layers = ["height"]
        publisher.publish(wrong)
        bench.until(lambda: "no layer 'elevation'" in status().message, "report of the wrong map")
        assert status().level == b"\x01"
        publisher.publish(grid_map(z))
        bench.until(lambda: len(found) == 4, "cost map after the wrong one")


def test_the_cost_map_follows_the_lifecycle():
    """Publish nothing while inactive, and the newest map on activation; closing ends the work."""
    from grid_map_msgs.msg import GridMap
    from nav_msgs.msg import OccupancyGrid

    from rockerbogie.ros.costmap_part import LATCHED

    with Bench(start=False, rover="sawppy", cost_map=True, cost_map_headings=2) as bench:
        node = bench.node
        node.trigger_configure()
        part = node.cost_map
        found, publisher = bench.record(OccupancyGrid, "costmap", LATCHED), bench.publisher(GridMap, "elevation_map")
        publisher.publish(grid_map(heights(5, 21, 21)))
        bench.until(lambda: part._found is not None, "a cost map that waits")
        bench.spin(0.3)
        assert not found
        node.trigger_activate()
        bench.until(lambda: len(found) == 1, "the newest map")
        node.trigger_deactivate()
        begun, own = threading.Event(), part.costs._tell

        def wait_for_close(cells):
            """Keep the worker between two batches until the part is closed."""
            begun.set()
            while part._open:
                time.sleep(0.01)
            own(cells)

        part.costs._tell = wait_for_close
        publisher.publish(grid_map(heights(6, 201, 201)))
        bench.until(begun.is_set, "start of a large map")
        node.trigger_cleanup()
        assert part.costs._stale.any(), "the work ends between two batches"
        assert node.cost_map is None
        assert not part._worker.is_alive()
    with Bench(rover="sawppy", cost_map=True, cost_map_limits="nonsense") as bench:
        assert not bench.started
