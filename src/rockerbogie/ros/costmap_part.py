"""Part of a ROS 2 node: heights in, the rover's cost map out."""

from __future__ import annotations

import threading
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from ..errors import RockerbogieError
from ..rover.model import Rover
from .costmap import CostMap
from .grid_messages import Heights, fill_grid_map, fill_occupancy, overlay, read_cloud, read_grid_map

try:
    from grid_map_msgs.msg import GridMap
except ImportError:  # no wheel of it on PyPI; a ROS installation has it
    GridMap = None

#: As Nav2's static layer subscribes.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)


class CostMapPart:
    """Subscriptions, publishers and a worker thread on a node.

    Subscribes: `elevation_map` (grid_map_msgs/GridMap, where its messages are installed), `elevation_points`
    (sensor_msgs/PointCloud2, in the map's frame), `obstacles` (nav_msgs/OccupancyGrid, laid over the costs). Publishes:
    `costmap` (nav_msgs/OccupancyGrid, latched) and `costmap_layers` (GridMap with the layers that have no heading).

    Attributes:
        costs: the cost map.
        published: number of cost maps published.
    """

    def __init__(
        self, node: Any, rover: Rover, *, layer: str = "elevation", spacing: float = 0.1, frame: str = "map", **options: Any
    ) -> None:
        """Subscribe and start the worker.

        Args:
            node: an rclpy node.
            rover: the rover.
            layer: of the grid map with the heights.
            spacing: side of the cells made from points, m.
            frame: of the map, if a message has none.
            options: of `CostMap`.

        Raises:
            RockerbogieError: a wrong option.
        """
        self.node, self.layer, self.spacing, self.frame = node, layer, spacing, frame
        self.costs = CostMap(rover, **options)
        self.published = 0
        self._obstacles: Any = None
        self._latest: Any = None
        self._ready, self._open = threading.Condition(), True
        self.publisher = node.create_publisher(OccupancyGrid, "costmap", LATCHED)
        self._made = [
            node.create_subscription(PointCloud2, "elevation_points", self._take, 1),
            node.create_subscription(OccupancyGrid, "obstacles", self._take_obstacles, LATCHED),
        ]
        self.layers = None
        if GridMap is not None:
            self.layers = node.create_publisher(GridMap, "costmap_layers", LATCHED)
            self._made.append(node.create_subscription(GridMap, "elevation_map", self._take, 1))
        self._worker = threading.Thread(target=self._work, name="costmap", daemon=True)
        self._worker.start()

    def close(self) -> None:
        """Stop the worker, and release topics."""
        with self._ready:
            self._open = False
            self._ready.notify()
        self._worker.join()
        for part in self._made:
            self.node.destroy_subscription(part)
        for publisher in filter(None, (self.publisher, self.layers)):
            self.node.destroy_publisher(publisher)

    def _take(self, message: Any) -> None:
        """Hand a message to the worker; an older one that waits is dropped."""
        with self._ready:
            self._latest = message
            self._ready.notify()

    def _take_obstacles(self, message: Any) -> None:
        """Keep the obstacles for the next cost map."""
        self._obstacles = message

    def _work(self) -> None:
        """Publish a cost map for the latest message, until closed."""
        while True:
            with self._ready:
                self._ready.wait_for(lambda: self._latest is not None or not self._open)
                if not self._open:
                    return
                message, self._latest = self._latest, None
            try:
                self._publish(message, self._heights(message))
            except RockerbogieError as error:
                self.node.get_logger().warning(f"no cost map: {error}", throttle_duration_sec=5.0)

    def _heights(self, message: Any) -> Heights:
        """Return the heights of a message."""
        return read_cloud(message, self.spacing) if isinstance(message, PointCloud2) else read_grid_map(message, self.layer)

    def _publish(self, message: Any, heights: Heights) -> None:
        """Settle what has changed, and publish."""
        self.costs.replace(*heights)
        costs, origin, step = self.costs.occupancy(), self.costs.origin, self.costs.spacing[0]
        if self._obstacles is not None:
            costs = overlay(costs, origin, step, self._obstacles)
        found = fill_occupancy(OccupancyGrid(), costs, origin, step)
        found.header.stamp = found.info.map_load_time = message.header.stamp
        found.header.frame_id = message.header.frame_id or self.frame
        self.publisher.publish(found)
        if self.layers is not None and self.costs.terrain is not None:
            flat = {name: values for name in self.costs.layers if np.ndim(values := self.costs.layer(name)) == 2}
            grid = fill_grid_map(GridMap(), flat, origin, step)
            grid.header = found.header
            self.layers.publish(grid)
        self.published += 1
