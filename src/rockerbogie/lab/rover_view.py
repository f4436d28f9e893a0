"""Rover in the scene of one visitor: a mesh for each part, moved by the frames of its links."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..arrays import Array
from ..figures.scene.rover_mesh import LINKS, link_transforms, rover_parts
from ..rover.frames import ON_BOGIE, WHEEL_SIDE
from ..rover.model import Rover
from ..rover.rotations import body_transform

if TYPE_CHECKING:
    import viser

#: Colour of the ring with which the rover is turned.
RING = (244, 196, 48)
RING_SIDES = 72
#: Index of the link that carries each link of `LINKS`: body; bar, rods and rockers; bogies; forks; wheels. The body has none.
CARRIED_BY = (-1, 0, 0, 0, 0, 0, 4, 5, *[(6 if ON_BOGIE[i] else 4) + WHEEL_SIDE[i] for i in range(6)] * 2)
#: A link that has moved less than this against its carrier is not sent again, m and 1.
UNMOVED = 1e-9


class RoverView:
    """Rover of one visitor, or the ghost of a second model.

    Args:
        scene: the visitor's scene.
        name: root of the nodes, such as "/rover".
        opacity: None for a solid rover, else from 0 to 1.
    """

    def __init__(self, scene: viser.SceneApi, name: str, opacity: float | None = None) -> None:
        self.scene, self.name, self.opacity = scene, name, opacity
        self.frames: list[Any] = []
        self.meshes: list[Any] = []
        self.rover: Rover | None = None
        self._light = False
        self._dragged: Callable[[Any], Any] | None = None
        self._sent: Array = np.zeros(0)

    def build(self, rover: Rover, light: bool = False, visible: bool = True) -> None:
        """Replace the meshes by those of a rover; they appear with the next `place`.

        Args:
            rover: the rover.
            light: draw fewer triangles.
            visible: False: send the meshes only with the first `show`.
        """
        self.remove()
        self.rover, self._light = rover, light
        if visible:
            self._make(rover)

    def _make(self, rover: Rover) -> None:
        """Add the frames and meshes of a rover to the scene, and keep them in this view."""
        paths: list[str] = []
        for link, carrier in zip(LINKS, CARRIED_BY, strict=True):
            paths.append(f"{self.name if carrier < 0 else paths[carrier]}/{link}")
        self.frames = [self.scene.add_frame(path, show_axes=False) for path in paths]
        self._sent = np.full((len(LINKS), 3, 4), np.nan)
        for part in rover_parts(rover, self._light):
            self.meshes.append(
                self.scene.add_mesh_simple(
                    f"{paths[LINKS.index(part.link)]}/{part.name}",
                    part.vertices.astype(np.float32),
                    part.faces,
                    color=tuple(round(255 * c) for c in part.colour),
                    opacity=self.opacity,
                    side="double",
                    cast_shadow=self.opacity is None,
                )
            )
            if self._dragged is not None:
                self.meshes[-1].on_drag("left")(self._dragged)

    def place(
        self,
        offset: Array,
        position: Sequence[float],
        q: Array,
        steering: Array | None = None,
        wheel_turn: Array | float = 0.0,
    ) -> None:
        """Move the links to a pose.

        Args:
            offset: (3,) origin of the scene in the world, m.
            position: x, y (m) and yaw (rad).
            q: (6,) z, roll, pitch, rocker, bogie left, bogie right; m and rad.
            steering: (6,) rad; None: 0.
            wheel_turn: (6,) or one angle by which the wheels have turned, rad.
        """
        if self.rover is None or not self.frames:
            return
        x, y, yaw = position
        T = body_transform(x, y, q[0], q[1], q[2], yaw)
        links = link_transforms(self.rover, T, q[3], q[4:6], steering, wheel_turn)
        local = links[:, :3]
        carriers = links[list(CARRIED_BY[1:]), :3]
        back = np.swapaxes(carriers[:, :, :3], 1, 2)
        local = np.concatenate([back @ local[1:, :, :3], back @ (local[1:, :, 3:] - carriers[:, :, 3:])], axis=2)
        local = np.concatenate([links[:1, :3], local])
        local[0, :, 3] -= offset
        moved = ~(np.abs(local - self._sent) < UNMOVED)
        turned = np.flatnonzero(moved[:, :, :3].any(axis=(1, 2)))
        for k in np.flatnonzero(moved[:, :, 3].any(axis=1)):
            self.frames[k].position = local[k, :, 3]
        if turned.size:
            turns = np.roll(Rotation.from_matrix(local[turned, :, :3]).as_quat(), 1, axis=1)
            for k, turn in zip(turned, turns, strict=True):
                self.frames[k].wxyz = turn
        self._sent = np.where(moved, local, self._sent)

    def show(self, visible: bool) -> None:
        """Show or hide the rover.

        Args:
            visible: True to show it.
        """
        if visible and self.rover is not None and not self.frames:
            self._make(self.rover)
        if self.frames:
            self.frames[0].visible = visible

    def on_drag(self, callback: Callable[[Any], Any]) -> None:
        """Call a function when a visitor drags any part of the rovers that are built from now on.

        Args:
            callback: takes viser's drag event.
        """
        self._dragged = callback

    def remove(self) -> None:
        """Remove all nodes."""
        if self.frames:
            self.frames[0].remove()
        self.frames, self.meshes, self.rover = [], [], None


class TurnRing:
    """Ring around the rover, with an arrow at its front, by which a visitor turns it.

    Args:
        scene: the visitor's scene.
        name: of its node.
    """

    def __init__(self, scene: viser.SceneApi, name: str) -> None:
        self.scene, self.name = scene, name
        self.mesh: Any = None

    def build(self, rover: Rover, callback: Callable[[Any], Any]) -> None:
        """Make the ring for a rover.

        Args:
            rover: the rover.
            callback: takes viser's drag event.
        """
        vertices, faces = ring_mesh(rover)
        self.mesh = self.scene.add_mesh_simple(
            self.name, vertices, faces, color=RING, side="double", opacity=0.9, cast_shadow=False, receive_shadow=False
        )
        self.mesh.on_drag("left")(callback)

    def place(self, offset: Array, position: Sequence[float], q: Array) -> None:
        """Move the ring with the body.

        Args:
            offset: (3,) origin of the scene in the world, m.
            position: x, y (m) and yaw (rad).
            q: (6,) as `RoverView.place`.
        """
        x, y, yaw = position
        T = body_transform(x, y, q[0], q[1], q[2], yaw)
        self.mesh.position = T[:3, 3] - offset
        self.mesh.wxyz = np.roll(Rotation.from_matrix(T[:3, :3]).as_quat(), 1)


def ring_mesh(rover: Rover) -> tuple[Array, Array]:
    """Return a flat ring around the wheels, with an arrow at its front.

    Args:
        rover: the rover.

    Returns:
        Vertices (n, 3) m in the body frame and faces (m, 3).
    """
    centre = np.array([float(rover.hubs[:, 0].max() + rover.hubs[:, 0].min()) / 2, 0.0])
    reach = np.hypot(rover.hubs[:, 0] - centre[0], np.abs(rover.hubs[:, 1]) + rover.wheel_width / 2)
    inner = 1.12 * float((reach + 0.5 * rover.wheel_radius).max())
    width = 0.075 * inner
    height = float(rover.hubs[:, 2].mean())
    angle = np.linspace(0, 2 * np.pi, RING_SIDES, endpoint=False)
    spoke = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    flat = np.concatenate([centre + inner * spoke, centre + (inner + width) * spoke])
    k = np.arange(RING_SIDES)
    after = (k + 1) % RING_SIDES
    faces = np.concatenate(
        [np.stack([k, k + RING_SIDES, after + RING_SIDES], axis=1), np.stack([k, after + RING_SIDES, after], axis=1)]
    )
    tip = np.array([[inner + 0.5 * width, 2.6 * width], [inner + 0.5 * width, -2.6 * width], [inner + 4.2 * width, 0.0]]) + centre
    points = np.concatenate([flat, tip])
    faces = np.concatenate([faces, [[len(flat), len(flat) + 1, len(flat) + 2]]])
    lift = np.full((len(points), 1), height)
    return np.concatenate([points, lift], axis=1).astype(np.float32), faces.astype(np.uint32)
