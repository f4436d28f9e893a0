"""Part of a ROS 2 node: heights in, the rover's cost map out."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
from nav_msgs.msg import OccupancyGrid
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import PointCloud2

from ..errors import RockerbogieError
from ..rover.model import Rover
from .costmap import CostMap
from .grid_messages import Heights, check_spacing, fill_grid_map, fill_occupancy, overlay, read_cloud, read_grid_map
from .messages import destroy, optional_message

#: As Nav2's static layer subscribes.
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL, reliability=ReliabilityPolicy.RELIABLE)


class CostMapPart:
    """Subscriptions, publishers and a worker thread on a node.

    Subscribes: `elevation_map` (grid_map_msgs/GridMap, where its messages are installed), `elevation_points`
    (sensor_msgs/PointCloud2, in the map's frame), `obstacles` (nav_msgs/OccupancyGrid, laid over the costs). Publishes:
    `costmap` (nav_msgs/OccupancyGrid, latched) and `costmap_layers` (GridMap with the layers that have no heading).

    Attributes:
        costs: the cost map.
        active: publish; if False, heights are still used, and the newest cost map is published by `activate`.
        published: number of cost maps published.
        cells, seconds: number of cells settled for the last cost map, and the time that it took, s.
        error: of the last message; '' if it was used.
    """

    def __init__(
        self,
        node: Any,
        rover: Rover,
        *,
        layer: str = "elevation",
        spacing: float = 0.1,
        frame: str = "map",
        active: bool = True,
        **options: Any,
    ) -> None:
        """Subscribe and start the worker.

        Args:
            node: an rclpy node.
            rover: the rover.
            layer: of the grid map with the heights.
            spacing: side of the cells made from points, m.
            frame: of the map, if a message has none.
            active: publish from the start.
            options: of `CostMap`.

        Raises:
            RockerbogieError: a wrong option.
        """
        self.node, self.layer, self.spacing, self.frame, self.active = node, layer, spacing, frame, active
        self.costs = CostMap(rover, tell=self._go_on, **options)
        check_spacing(spacing)
        self.published, self.cells, self.seconds, self.error = 0, 0, 0.0, ""
        self._obstacles: Any = None
        self._latest: Any = None  # message that waits for the worker
        self._last: Any = None  # message of the last cost map
        self._found: tuple[Any, ...] | None = None  # the newest messages, in the order of the publishers
        self._ready, self._open = threading.Condition(), True
        self._publishers = [node.create_publisher(OccupancyGrid, "costmap", LATCHED)]
        self._made = [
            node.create_subscription(PointCloud2, "elevation_points", self._take, 1),
            node.create_subscription(OccupancyGrid, "obstacles", self._take_obstacles, LATCHED),
        ]
        self._grid_map = optional_message("grid_map_msgs", "GridMap")  # no wheel of it on PyPI; a ROS installation has it
        if self._grid_map is not None:
            self._publishers.append(node.create_publisher(self._grid_map, "costmap_layers", LATCHED))
            self._made.append(node.create_subscription(self._grid_map, "elevation_map", self._take, 1))
        self._worker = threading.Thread(target=self._work, name="costmap", daemon=True)
        self._worker.start()

    def activate(self) -> None:
        """Publish from now on: first the newest cost map, if there is one."""
        with self._ready:
            self.active = True
            self._send()

    def close(self) -> None:
        """Stop the worker after its current batch of poses, and release topics."""
        with self._ready:
            self._open = False
            self._ready.notify()
        self._worker.join()
        for made in (*self._made, *self._publishers):
            destroy(self.node, made)

    def _take(self, message: Any) -> None:
        """Hand a message to the worker; an older one that waits is dropped."""
        with self._ready:
            self._latest = message
            self._ready.notify()

    def _take_obstacles(self, message: Any) -> None:
        """Lay obstacles over the last cost map, and over those to come."""
        with self._ready:
            self._obstacles = message
            self._latest = self._latest or self._last
            self._ready.notify()

    def _go_on(self, cells: int) -> None:
        """Raise if the part was closed: the work ends."""
        if not self._open:
            raise _ClosedError

    def _work(self) -> None:
        """Publish a cost map for the latest message, until closed."""
        while True:
            with self._ready:
                self._ready.wait_for(lambda: self._latest is not None or not self._open)
                if not self._open:
                    return
                message, self._latest = self._latest, None
            try:
                self._renew(message)
                self.error = ""
            except _ClosedError:
                return
            except Exception as error:  # a wrong message must not end the worker
                self.error = str(error) if isinstance(error, RockerbogieError) else f"{type(error).__name__}: {error}"
                self.node.get_logger().warning(f"no cost map: {self.error}", throttle_duration_sec=5.0)

    def _heights(self, message: Any) -> Heights:
        """Return the heights of a message."""
        return read_cloud(message, self.spacing) if isinstance(message, PointCloud2) else read_grid_map(message, self.layer)

    def _renew(self, message: Any) -> None:
        """Settle what has changed, and publish."""
        began = time.perf_counter()
        change = self.costs.replace(*self._heights(message))
        costs, origin, step = self.costs.occupancy(), self.costs.origin, self.costs.spacing[0]
        if self._obstacles is not None:
            costs = overlay(costs, origin, step, self._obstacles)
        found = fill_occupancy(OccupancyGrid(), costs, origin, step)
        found.header.stamp = found.info.map_load_time = message.header.stamp
        found.header.frame_id = message.header.frame_id or self.frame
        messages = [found]
        if self._grid_map is not None and self.costs.terrain is not None:
            flat = {name: values for name in self.costs.layers if np.ndim(values := self.costs.layer(name)) == 2}
            grid = fill_grid_map(self._grid_map(), flat, origin, step)
            grid.header = found.header
            messages.append(grid)
        self.cells, self.seconds = change.cells, time.perf_counter() - began
        with self._ready:
            self._last, self._found = message, tuple(messages)
            if self.active and self._open:
                self._send()

    def _send(self) -> None:
        """Publish the newest cost map, unless it is published already."""
        if self._found is not None:
            for publisher, message in zip(self._publishers, self._found, strict=False):
                publisher.publish(message)
            self._found = None
            self.published += 1


class _ClosedError(Exception):
    """The part was closed while the worker was settling."""
