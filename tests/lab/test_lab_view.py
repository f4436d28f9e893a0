"""Frames of the rover in the scene: places of its links, and which are sent."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import rockerbogie as rb
from rockerbogie.figures.scene.rover_mesh import LINKS, link_transforms
from rockerbogie.lab.rover_view import CARRIED_BY, RoverView


class Node:
    """Node of a scene that counts what is sent."""

    def __init__(self, scene: Scene, name: str) -> None:
        self.__dict__.update(scene=scene, name=name, position=np.zeros(3), wxyz=np.array([1.0, 0, 0, 0]))

    def __setattr__(self, name: str, value: Any) -> None:
        self.scene.sent += name in ("position", "wxyz")
        self.__dict__[name] = value

    def remove(self) -> None:
        self.scene.nodes = {}


class Scene:
    """Scene as far as `RoverView` uses it."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}
        self.sent = 0

    def add_frame(self, name: str, **_: Any) -> Node:
        self.nodes[name] = Node(self, name)
        return self.nodes[name]

    def add_mesh_simple(self, name: str, *_: Any, **__: Any) -> Node:
        return self.add_frame(name)

    def world(self, name: str) -> np.ndarray:
        """Return the transform of a node, along its path."""
        T = np.eye(4)
        parts = name.split("/")[1:]
        for k in range(len(parts)):
            node = self.nodes.get("/" + "/".join(parts[: k + 1]))
            if node is not None:
                step = np.eye(4)
                step[:3, :3] = Rotation.from_quat(np.roll(node.wxyz, -1)).as_matrix()
                step[:3, 3] = node.position
                T = T @ step
        return T


def test_links_are_where_the_pose_puts_them_and_unmoved_ones_are_not_sent() -> None:
    scene = Scene()
    view = RoverView(scene, "/rover")  # type: ignore[arg-type]
    offset = np.array([5.0, -3.0, 1.0])
    for name in ("curiosity", "osr", "elhami-dashti"):
        rover = rb.load_rover(name)
        view.build(rover)
        terrain = rb.surfaces.rocks(k=0.1, seed=3, size=8.0)
        steering = np.where(rover.steers, 0.3, 0.0)
        for x, turn in ((0.1, 0.0), (0.3, 0.0), (0.3, 1.5)):
            pose = rb.settle(rover, terrain, x, 0.2, 0.7)
            before = scene.sent
            view.place(offset, (x, 0.2, 0.7), pose.q, steering, turn)
            count = scene.sent - before
            links = link_transforms(rover, pose.T_world_body, pose.rocker, pose.bogie, steering, turn)
            for link, T, frame in zip(LINKS, links, view.frames, strict=True):
                found = scene.world(frame.name)
                found[:3, 3] += offset
                assert np.allclose(found, T, atol=1e-8), (name, link)
            if x == 0.3:
                assert count <= (6 if turn else 14), "forks and wheels are fixed to their arms unless they turn"
    assert len(CARRIED_BY) == len(LINKS)
