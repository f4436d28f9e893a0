"""Rover of a running robot: tracked by the page's rover, and compared with the model."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..logs.live_pose import LivePose
from ..rover.rotations import wrap_angle
from ..settling.pose import Pose
from .style import note_html

if TYPE_CHECKING:
    from .context import Visit

#: Time after the newest pose for which the rover counts as moving, s.
FRESH = 0.3


class LivePanel:
    """Switch that makes one visitor's rover track a running robot, and their difference.

    The visitor's rover is settled at the robot's x, y and yaw. The ghost has the attitude and the joint angles that the robot
    reports, at the height of the visitor's rover: odometry counts heights from its own start.

    Args:
        session: the visitor's session.
    """

    def __init__(self, session: Visit) -> None:
        self.session = session
        self.pose: LivePose | None = None
        self._time = -np.inf  # of the newest pose, by this machine's clock
        self._live = session.lab.live is not None
        gui = session.client.gui
        self.box = gui.add_checkbox("track the robot", self._live, visible=self._live)
        self.box.on_update(session.callback(lambda _: self._switched()))
        self.table = gui.add_html(note_html("Waiting for the topic odom.", "live") if self._live else "", visible=self._live)

    @property
    def tracking(self) -> bool:
        """True if the rover is at the robot's position."""
        return self._live and bool(self.box.value) and self.pose is not None

    @property
    def moving(self) -> bool:
        """True if the rover tracks a robot whose newest pose has just come."""
        return self.tracking and time.perf_counter() - self._time < FRESH

    def update(self, pose: LivePose) -> None:
        """Move the rover to the robot.

        Args:
            pose: the newest pose.
        """
        self.pose, self._time = pose, time.perf_counter()
        if self.tracking:
            self._track()

    def leave(self) -> None:
        """Leave the robot: the rover stays where it is, free to be moved."""
        if self._live and self.box.value:
            self.box.value = False
            self.session.ghost.show(False)

    def draw(self, q: Array, offset: Array) -> None:
        """Move the ghost to the robot's attitude and joint angles.

        Args:
            q: (6,) as the rover is drawn; only its height is used.
            offset: (3,) origin of the scene in the world, m.
        """
        if self.tracking and (pose := self.pose) is not None:
            state = self.session.state
            reported = np.array([q[0], pose.roll, pose.pitch, pose.rocker, *pose.bogie])
            self.session.ghost.place(offset, (state.x, state.y, state.yaw), reported, pose.steering, pose.wheel_angle)

    def show(self, pose: Pose) -> None:
        """Show the angles of robot and model.

        Args:
            pose: of the model.
        """
        if self.tracking and self.pose is not None:
            state = self.session.state
            inside = state.inside(self.pose.x, self.pose.y, self.pose.yaw)[:2] == (self.pose.x, self.pose.y)
            self.table.content = table_html(self.pose, pose) + note_html(
                "" if inside else "The robot is outside the map: the rover is at the edge.", warning=True
            )

    def _switched(self) -> None:
        """Start to track the robot if the switch is on; hide its ghost if it is off."""
        if self.tracking:
            self._track()
        else:
            self.session.ghost.show(False)

    def _track(self) -> None:
        """Put the rover at the robot's x, y and yaw."""
        assert self.pose is not None
        session = self.session
        if session.drive_panel.run is not None:
            session.drive_panel.forget()
        session.state.target = None
        session.state.move(self.pose.x, self.pose.y, self.pose.yaw)
        session.ghost.show(True)
        session.redraw()


def table_html(robot: LivePose, model: Pose) -> str:
    """Return a table of the robot's angles beside those of the model.

    Args:
        robot: as reported.
        model: settled at the robot's x, y and yaw.

    Returns:
        HTML: roll, pitch, rocker and bogies of both, and their differences, in degrees.
    """
    rows = ""
    for name, reported, settled in (
        ("roll", robot.roll, model.roll),
        ("pitch", robot.pitch, model.pitch),
        ("rocker", robot.rocker, model.rocker),
        ("bogie left", robot.bogie[0], model.bogie[0]),
        ("bogie right", robot.bogie[1], model.bogie[1]),
    ):
        apart = float(wrap_angle(float(reported) - float(settled)))
        cells = [f"{round(float(np.degrees(value)), 2) + 0.0:.2f}°" for value in (float(reported), float(settled), apart)]
        rows += f"<tr><td>{name}</td>" + "".join(f'<td style="text-align:right">{cell}</td>' for cell in cells) + "</tr>"
    head = "".join(
        f'<th style="text-align:right;font-weight:500;opacity:.75">{name}</th>' for name in ("robot", "model", "apart")
    )
    return (
        f'<div style="padding:0 .8em .4em"><table data-key="live" data-time="{robot.time:.3f}" style="font-size:12px;width:100%;'
        f'font-variant-numeric:tabular-nums"><tr><th></th>{head}</tr>{rows}</table></div>'
    )


def hand_over(live: Any, sessions: dict[int, Any]) -> None:
    """Give each new pose of a robot to all sessions, until the poses end.

    Args:
        live: iterable of `LivePose`.
        sessions: visitor -> session.
    """
    for pose in live:
        for session in list(sessions.values()):
            session.later(lambda session=session, pose=pose: session.live_panel.update(pose), "live")
