"""Contact points, normals and forces in the scene of one visitor."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..settling.pose import Pose
from ..statics.loads import WheelLoads
from .forces import contact_arrows

if TYPE_CHECKING:
    import viser

#: Colours of points, normals and forces, of Okabe and Ito.
POINT, NORMAL, FORCE = (213, 94, 0), (86, 180, 233), (0, 158, 115)
#: Length of a normal, in wheel radii, and of a force of a sixth of the weight.
LONG = 2.2
_NOWHERE = np.zeros((1, 3), dtype=np.float32)


class ForcesView:
    """Arrows at the contacts.

    Args:
        scene: the visitor's scene.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self.scene = scene
        self.shown = {"points": True, "normals": False, "forces": True}
        self._radius = 0.0
        self._nodes: dict[str, Any] = {}

    def show(self, pose: Pose, loads: WheelLoads, offset: Array) -> None:
        """Move the arrows to a pose.

        Args:
            pose: one pose.
            loads: its contact forces.
            offset: (3,) origin of the scene in the world, m.
        """
        radius = float(pose.rover.wheel_radius.mean())
        if radius != self._radius:
            self._build(radius)
        arrows = contact_arrows(pose, loads)
        points = arrows.points - offset
        unit = LONG * radius
        share = unit * arrows.forces / (pose.rover.mass * pose.gravity / 6)
        known = np.isfinite(share).all(axis=-1)
        self._set("normals", points, unit * arrows.normals)
        self._set("forces", points[known], share[known])
        visible = self.shown["points"] and len(points) > 0
        if visible:
            self._nodes["points"].points = (points + 0.12 * radius * arrows.normals).astype(np.float32)
        self._nodes["points"].visible = visible

    def _set(self, kind: str, start: Array, along: Array) -> None:
        """Move one kind of arrow, or hide it."""
        visible = self.shown[kind] and len(start) > 0
        if visible:
            self._nodes[kind].points = np.stack([start, start + along], axis=1).astype(np.float32)
        self._nodes[kind].visible = visible

    def _build(self, radius: float) -> None:
        """Make the nodes for a wheel radius, m."""
        for node in self._nodes.values():
            node.remove()
        self._radius = radius
        size = {"shaft_radius": 0.07 * radius, "head_radius": 0.17 * radius, "head_length": 0.3 * radius, "visible": False}
        start = np.zeros((1, 2, 3), dtype=np.float32)
        self._nodes = {
            "normals": self.scene.add_arrows("/contacts/normals", start, NORMAL, **size),
            "forces": self.scene.add_arrows("/contacts/forces", start, FORCE, **size),
            "points": self.scene.add_point_cloud(
                "/contacts/points", _NOWHERE, POINT, point_size=0.16 * radius, point_shape="circle", visible=False
            ),
        }
