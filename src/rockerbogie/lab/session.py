"""Session of one visitor: state, scene, panels, and the thread that moves the rover."""

from __future__ import annotations

import sys
import threading
import time
import traceback
from collections import OrderedDict
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError
from ..settling.pose import Pose
from ..statics.loads import WheelLoads
from ..statics.stability import Stability
from .context import Lab
from .drive_panel import DrivePanel
from .forces_view import ForcesView
from .live_panel import LivePanel
from .picking import ray_hit
from .pose_panel import PosePanel
from .readings import measure, readings, readings_html, wheels_html
from .rover_panel import RoverPanel
from .rover_view import RoverView, TurnRing
from .state import LabState, standing
from .style import HINT, SOFTWARE, note_html
from .terrain_panel import TerrainPanel
from .terrain_view import TerrainView, usual_colour
from .uploads import message_of

if TYPE_CHECKING:
    import viser

#: Frames per second while the rover moves; in light drawing, which shares the processor with the browser; updates per second
#: of the numbers.
FRAMES, LIGHT_FRAMES = 60.0, 45.0
NUMBERS = 12.0


class Session:
    """Session of one visitor.

    All changes of the state run on the session's own thread, one after the other: `later` hands them over. Callbacks of viser
    only hand over, so visitors cannot disturb each other.

    Args:
        lab: the server's scene and limits.
        client: viser's handle of the visitor.
        software: True if the visitor's browser has no graphics card.
    """

    def __init__(self, lab: Lab, client: viser.ClientHandle, software: bool = False) -> None:
        self.lab, self.client = lab, client
        self.state = LabState(lab.rover, lab.terrain, *lab.start, mode="contact", gravity=lab.gravity)
        self.maps = lab.maps
        self.colour = usual_colour(lab.maps)
        self.light = lab.light or software
        self.frames = 0  # drawn since the session began
        self.slowest = 0.0  # s, slowest frame so far
        self._jobs: OrderedDict[Any, Callable[[], None]] = OrderedDict()
        self._wake = threading.Condition()
        self._closed = False
        self._grab: tuple[float, ...] = ()
        self._dirty = False
        self._numbers_due = 0.0
        self._measured: tuple[Pose, WheelLoads, Stability] | None = None
        scene, gui = client.scene, client.gui
        self.rover_view = RoverView(scene, "/rover")
        self.ghost = RoverView(scene, "/ghost", opacity=0.4)
        for view in (self.rover_view, self.ghost):
            view.on_drag(self._dragged)  # the ghost may stand in front of the rover
        self.ring = TurnRing(scene, "/ring")
        self.terrain_view = TerrainView(scene)
        self.forces = ForcesView(scene)
        with client.atomic():
            gui.add_html(HINT)
            if software:
                gui.add_html(note_html(SOFTWARE, "software"))
            self.numbers = gui.add_html("")
            tabs = gui.add_tab_group()
            with tabs.add_tab("Pose"):
                self.live_panel = LivePanel(self)
                self.pose_panel = PosePanel(self)
            with tabs.add_tab("Drive"):
                self.drive_panel = DrivePanel(self)
            with tabs.add_tab("Rover"):
                self.rover_panel = RoverPanel(self)
            with tabs.add_tab("Terrain"):
                self.terrain_panel = TerrainPanel(self)
            self.show_terrain()
            self.show_rover()
            if (run := lab.run) is not None:
                self.attempt(lambda: self.drive_panel.begin(run))
            self.look()
            self.draw()
        scene.on_click()(self._clicked)
        self._thread = threading.Thread(target=self._work, name=f"lab-session-{client.client_id}", daemon=True)
        self._thread.start()

    # -- work of the session ----------------------------------------------------------------------------------------

    def later(self, action: Callable[[], None], key: Any = None) -> None:
        """Run an action on the session's thread.

        Args:
            action: takes nothing; a `RockerbogieError` it raises is shown in the page.
            key: a later action with the same key replaces this one if it has not run yet. None: never replaced.
        """
        with self._wake:
            if self._closed:
                return
            self._jobs[object() if key is None else key] = action
            self._wake.notify()

    def leave(self) -> None:
        """Leave the run and the robot: the rover stays where it is, free to be moved."""
        self.live_panel.leave()
        self.drive_panel.leave()

    def callback(self, action: Callable[[Any], Any], key: Any = None) -> Callable[[Any], Awaitable[None]]:
        """Return a callback for viser that hands an action over.

        Args:
            action: takes the value that the visitor gave to the control; None for a key.
            key: as `later`.

        Returns:
            The callback. It ignores events that the program itself causes by setting a value.
        """

        async def run(event: Any) -> None:
            # A coroutine runs at once where viser receives the value; a frame may write another one before the action runs.
            value = getattr(event.target, "value", None)
            if event.client is not None:
                self.later(lambda: action(value), key)

        return run

    def close(self) -> None:
        """End the session's thread and drop what it holds."""
        with self._wake:
            self._closed = True
            self._jobs.clear()
            self._wake.notify()

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._closed

    def join(self, timeout: float) -> None:
        """Wait for the end of the session's thread.

        Args:
            timeout: s.
        """
        self._thread.join(timeout)

    def attempt(self, action: Callable[[], None]) -> None:
        """Run an action; show its error in the page.

        Args:
            action: takes nothing.
        """
        try:
            action()
        except Exception as error:
            if not isinstance(error, RockerbogieError):
                traceback.print_exc(file=sys.stderr)
            self.notify("That did not work", message_of(error), "red")

    def notify(self, title: str, text: str, colour: Any = "blue") -> None:
        """Show a message in the page.

        Args:
            title: its heading.
            text: one or two sentences.
            colour: red for errors.
        """
        self.client.add_notification(title, text, color=colour, auto_close_seconds=20.0)

    def _work(self) -> None:
        """Run jobs and frames until the session is closed."""
        while True:
            with self._wake:
                while not (self._jobs or self._closed or self._moving()):
                    self._wake.wait()
                if self._closed:
                    return
                jobs, self._jobs = list(self._jobs.values()), OrderedDict()
            began = time.perf_counter()
            for job in jobs:
                self.attempt(job)
            self.attempt(self._frame)
            spent = time.perf_counter() - began
            if self._moving():
                time.sleep(max(0.0, 1.0 / (LIGHT_FRAMES if self.light else FRAMES) - spent))

    def _moving(self) -> bool:
        """Return True if the next frame differs from this one without a new job."""
        return self.state.target is not None or self.drive_panel.playing or self._numbers_due > 0.0

    def _frame(self) -> None:
        """Move the rover by one frame and draw it."""
        began = time.perf_counter()
        moved = self.drive_panel.advance() or self.state.glide()
        if moved or self._dirty or 0.0 < self._numbers_due <= began:
            self._dirty = False
            self.draw()
            self.slowest = max(self.slowest, time.perf_counter() - began)

    # -- drawing ------------------------------------------------------------------------------------------------------

    def redraw(self) -> None:
        """Draw at the next frame."""
        self._dirty = True

    def show_rover(self) -> None:
        """Build the meshes of the rover."""
        self.rover_view.build(self.state.rover, self.light)
        self.ghost.build(self.state.rover, self.light, visible=False)
        self.ring.build(self.state.rover, self._turned)
        self.redraw()

    def show_terrain(self) -> None:
        """Build the meshes of the terrain."""
        self.client.scene.configure_default_lights(cast_shadow=not self.light)
        self.terrain_view.build(self.state.terrain, self.colour, self.maps, self.light)
        self.terrain_panel.show_legend()
        self.redraw()

    def draw(self) -> None:
        """Send the current pose to the page: links, arrows, and the numbers when they are due."""
        frame = self.drive_panel.frame()
        if frame is None:
            pose, position, drawn = self.state.pose, (self.state.x, self.state.y, self.state.yaw), self.state.pose.q
            steering, turned = None, np.zeros(6)
            if self.live_panel.tracking and (live := self.live_panel.pose) is not None:
                steering, turned = live.steering, live.wheel_angle
            if not np.isfinite(drawn).all():
                drawn = standing(self.state.rover, self.state.terrain, *position[:2])
        else:
            pose, position, drawn = frame.pose, frame.position, frame.q
            steering, turned = frame.steering, frame.wheel_turn
        offset = self.terrain_view.offset
        now = time.perf_counter()
        with self.client.atomic():
            self.rover_view.place(offset, position, drawn, steering, turned)
            self.ring.place(offset, position, drawn)
            self.live_panel.draw(drawn, offset)
            self.terrain_view.refine(position[0], position[1], 1.5 * self.state.size)
            at_rest = not (self.state.target or self.drive_panel.playing or self.live_panel.moving)
            if now >= self._numbers_due or at_rest:
                self._show_numbers(pose, position)
                self._numbers_due = 0.0 if at_rest else now + 1.0 / NUMBERS
        self.frames += 1

    def _show_numbers(self, pose: Pose, position: tuple[float, float, float]) -> None:
        """Send numbers and arrows of a pose to the page."""
        loads, tip = measure(pose)
        self.numbers.content = readings_html(pose, readings(pose, self.state.limits, loads, tip))
        self.pose_panel.show(position, wheels_html(pose, loads))
        self.forces.show(pose, loads, self.terrain_view.offset)
        self.drive_panel.show_charts()
        self.live_panel.show(pose)

    def look(self) -> None:
        """Turn the visitor's camera to the rover, from behind and above."""
        offset, size, frame = self.terrain_view.offset, self.state.size, self.drive_panel.frame()
        x, y, yaw = (self.state.x, self.state.y, self.state.yaw) if frame is None else frame.position
        z = float(self.state.pose.z) if frame is None else float(frame.q[0])
        if not np.isfinite(z):
            z = float(standing(self.state.rover, self.state.terrain, x, y)[0])
        centre = np.array([x, y, z]) - offset
        back = yaw + np.pi - 0.6
        camera = self.client.camera
        narrow = camera.image_width < 0.8 * camera.image_height  # a phone: the controls cover the lower half
        away = (8.0 if narrow else 4.2) * size
        direction = np.array([0.8 * np.cos(back), 0.8 * np.sin(back), 0.5])
        upward = np.array([-0.5 * np.cos(back), -0.5 * np.sin(back), 0.8])
        shift = -0.22 * away * upward if narrow else np.zeros(3)
        camera.up_direction = (0.0, 0.0, 1.0)
        camera.position = centre + away * direction + shift
        camera.look_at = centre + shift
        camera.near = max(0.002, 0.02 * size)

    # -- pointer ------------------------------------------------------------------------------------------------------

    def _hit(self, point: Any, lift: float) -> np.ndarray | None:
        """Return the point of the lifted terrain that the camera sees behind a point."""
        offset = self.terrain_view.offset
        origin = np.asarray(self.client.camera.position) + offset
        return ray_hit(self.state.terrain, origin, np.asarray(point) + offset - origin, lift)  # type: ignore[arg-type]

    async def _dragged(self, event: Any) -> None:
        """Move the target of the rover with the pointer."""
        phase, grabbed, pointer = event.phase, event.start_position, event.end_position
        self.later(lambda: self._drag(phase, grabbed, pointer), ("drag", phase))

    def _drag(self, phase: str, grabbed: Any, pointer: Any) -> None:
        """Handle one drag event of the rover."""
        self.leave()
        if phase == "start" or not self._grab:
            point: Array = np.asarray(grabbed) + self.terrain_view.offset
            ground = float(self.state.terrain.height(point[0], point[1]))
            lift = float(point[2]) - ground if np.isfinite(ground) else 0.0
            self._grab = (self.state.x - float(point[0]), self.state.y - float(point[1]), lift)
        hit = self._hit(pointer, self._grab[2])
        if hit is not None:
            self.state.target = (float(hit[0]) + self._grab[0], float(hit[1]) + self._grab[1], self.state.yaw)
        if phase == "end":
            self._grab = ()

    async def _turned(self, event: Any) -> None:
        """Turn the target of the rover with the pointer."""
        phase, grabbed, pointer = event.phase, event.start_position, event.end_position
        self.later(lambda: self._turn(phase, grabbed, pointer), ("turn", phase))

    def _turn(self, phase: str, grabbed: Any, pointer: Any) -> None:
        """Handle one drag event of the ring."""
        self.leave()
        offset, centre = self.terrain_view.offset, (self.state.x, self.state.y)

        def azimuth(point: Any) -> float:
            x, y = np.asarray(point)[:2] + offset[:2]
            return float(np.arctan2(y - centre[1], x - centre[0]))

        if phase == "start" or not self._grab:
            self._grab = (azimuth(grabbed), self.state.yaw)
        camera = np.asarray(self.client.camera.position)
        height = float(np.asarray(grabbed)[2])
        ray = np.asarray(pointer) - camera
        if ray[2] < 0.0:  # the pointer's point at the height of the ring
            pointer = camera + ray * (height - camera[2]) / ray[2]
        self.state.target = (*centre, self._grab[1] + azimuth(pointer) - self._grab[0])
        if phase == "end":
            self._grab = ()

    def _clicked(self, event: Any) -> None:
        """Use a click on the terrain for the path, the route or the rover."""
        origin = np.asarray(event.ray_origin) + self.terrain_view.offset
        direction = event.ray_direction

        def act() -> None:
            hit = ray_hit(self.state.terrain, origin, direction)  # type: ignore[arg-type]
            if hit is not None:
                self.drive_panel.clicked(float(hit[0]), float(hit[1]))

        self.later(act)
