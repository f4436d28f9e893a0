"""Controls of paths, routes and runs: click, drive, play, scrub, compare."""

from __future__ import annotations

import threading
import time
from pathlib import Path as FilePath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arrays import Array
from ..errors import PathError, RockerbogieError
from ..maps.plan import plan
from ..motion.drive import drive, to_csv
from ..motion.path import Path
from ..settling.pose import Pose
from ..simulation.simulate import simulate
from .path_view import PathView
from .paths import MOST_POINTS, path_through, step_of
from .records import Difference, Record, difference
from .style import QUIET, note_html
from .uploads import message_of

if TYPE_CHECKING:
    import xarray as xr

    from .context import Visit

MOVE, DRAW, ROUTE = "moves the rover", "adds to the path", "sets start, then goal"
PLAY, PAUSE = "▶ Play", "⏸ Pause"
#: Longest path that the page simulates in MuJoCo, m.
MOST_SIMULATED = 30.0
#: Time in which a new run is played, s.
USUAL_PLAY = 15.0


class Shown(NamedTuple):
    """Moment of a run as it is drawn."""

    pose: Pose  # of the nearest record
    position: tuple[float, float, float]
    q: Array  # (6,)
    steering: Array  # (6,)
    wheel_turn: Array  # (6,)


class StoppedError(Exception):
    """The visitor has left or has begun something else: a computation ends early."""


class DrivePanel:
    """Controls of one visitor's runs.

    Args:
        session: the visitor's session.
    """

    def __init__(self, session: Visit) -> None:
        self.session = session
        self.points: list[tuple[float, float]] = []
        self.path: Path | None = None
        self.start: tuple[float, float] | None = None
        self.run: Record | None = None
        self.simulated: Record | None = None
        self.differences: Difference | None = None
        self.playing = False
        self.time = 0.0
        self._clock = 0.0
        self._serial = 0  # counts runs, so that a late simulation of an earlier one is dropped
        gui = session.client.gui
        self.view = PathView(session.client.scene)
        self.note = gui.add_html("")
        self.click = gui.add_dropdown("a click", (MOVE, DRAW, ROUTE), initial_value=MOVE, hint="effect of a click on the terrain")
        self.click.on_update(session.callback(lambda _: self._explain()))
        edit = gui.add_button_group("path", ("Undo", "Clear"))
        edit.on_click(session.callback(lambda name: self._undo() if name == "Undo" else self.clear()))
        self.speed = gui.add_slider("speed [cm/s]", 1.0, 30.0, 0.5, 5.0)
        self.drive_button = gui.add_button("Drive the path", disabled=True)
        self.drive_button.on_click(session.callback(lambda _: self._drive()))
        self.simulate_button = gui.add_button("Simulate it in MuJoCo too", disabled=True, color=QUIET)
        self.simulate_button.on_click(session.callback(lambda _: self._simulate()))
        self.progress = gui.add_progress_bar(0.0, visible=False)
        self.play_button = gui.add_button(PLAY, disabled=True)
        self.play_button.on_click(session.callback(lambda _: self.play(not self.playing)))
        self.scrub = gui.add_slider("time [s]", 0.0, 1.0, 0.01, 0.0, disabled=True)
        self.scrub.on_update(session.callback(self._scrub, "scrub"))
        self.rate = gui.add_slider("playback ×", 1.0, 100.0, 1.0, 1.0)
        self.charts = gui.add_html("")
        self.save = gui.add_button("Save the run as CSV", disabled=True, color=QUIET)
        self.save.on_click(session.callback(lambda _: self._save()))
        gui.add_command("Play or pause", hotkey="P").on_trigger(session.callback(lambda _: self.play(not self.playing)))
        self._explain()

    # -- called by the session ------------------------------------------------------------------------------------

    def begin(self, run: xr.Dataset) -> None:
        """Show the run with which the lab was started.

        Args:
            run: of the visitor's rover and terrain.
        """
        self._use(Record.of(self.session.state.rover, self.session.state.terrain, run), play=False)

    def advance(self) -> bool:
        """Move the time of a playing run.

        Returns:
            True if a run is playing.
        """
        if not self.playing or self.run is None:
            return False
        now = time.perf_counter()
        self.time += (now - self._clock) * float(self.rate.value)
        self._clock = now
        if self.time >= self.run.duration:
            self.time = self.run.duration
            self.play(False)
        return True

    def frame(self) -> Shown | None:
        """Return the moment of the run that is shown, and move the ghost.

        Returns:
            The moment; None if the rover is not on a run.
        """
        if self.run is None:
            return None
        if self.simulated is not None:
            other = self.simulated.at(self.time)
            offset = self.session.terrain_view.offset
            self.session.ghost.place(offset, other.position, self.simulated.drawn(other), other.steering, other.wheel_turn)
        moment = self.run.at(self.time)
        return Shown(self.run.pose(moment.nearest), moment.position, self.run.drawn(moment), moment.steering, moment.wheel_turn)

    def show_charts(self) -> None:
        """Show the charts with the cursor at the current time."""
        if self.run is None:
            return
        if self.scrub.value != round(self.time, 2):
            self.scrub.value = min(round(self.time, 2), self.scrub.max)
        drawn = self.run.charts(self.time)
        if self.differences is not None:
            drawn.append(self.differences.chart(self.time))
        self.charts.content = f'<div data-key="charts">{"".join(drawn)}</div>'

    def leave(self) -> None:
        """Leave the run: the rover stays where it is, free to be moved."""
        if self.run is not None:
            position = self.run.at(self.time).position
            self.forget()
            self.session.state.move(*position)
            self.session.redraw()

    def forget(self) -> None:
        """Drop the run, as rover or terrain have changed."""
        self._serial += 1
        self.playing = False
        self.run = self.simulated = self.differences = None
        self.session.ghost.show(False)
        self.play_button.label = PLAY
        for control in (self.play_button, self.scrub, self.save, self.simulate_button):
            control.disabled = True
        self.progress.visible = False
        self.charts.content = ""

    def clicked(self, x: float, y: float) -> None:
        """Use a click on the terrain.

        Args:
            x: m.
            y: m.
        """
        if self.click.value == MOVE:
            self.session.leave()
            self.session.state.target = (x, y, self.session.state.yaw)
        elif self.click.value == DRAW:
            self._add(x, y)
        else:
            self._route(x, y)

    def clear(self) -> None:
        """Drop the path and the run."""
        self.leave()
        self.points, self.path, self.start = [], None, None
        self.view.clear()
        self._explain()

    # -- path and route -----------------------------------------------------------------------------------------------

    def _add(self, x: float, y: float) -> None:
        """Add a point to the path."""
        if self.path is not None and not self.points:  # a route was shown
            self.clear()
        if len(self.points) >= MOST_POINTS:
            raise PathError(f"a path has at most {MOST_POINTS} points")
        self.points.append((x, y))
        self._draw_path()

    def _undo(self) -> None:
        """Remove the last point of the path."""
        self.points = self.points[:-1]
        self._draw_path()

    def _draw_path(self) -> None:
        """Make and show the path through the points."""
        state = self.session.state
        self.path = None
        try:
            if len(self.points) >= 2:
                self.path = path_through(self.points, state.size)
        except PathError:
            self.points.pop()
            raise
        finally:
            self.view.show(self.path, self.points, state.terrain, self.session.terrain_view.offset, state.size)
            self._explain()

    def _route(self, x: float, y: float) -> None:
        """Use a click as start or as goal, and plan the route."""
        session, state = self.session, self.session.state
        if session.maps is None:
            raise RockerbogieError("a route needs a map: compute one in the tab Terrain, or start with --map")
        if self.start is None:
            self.clear()
            self.start = (x, y)
            self.view.mark("start", x, y, state.terrain, session.terrain_view.offset, state.size)
            self._explain()
            return
        start, self.start = self.start, None
        with session.lab.heavy():
            route = plan(session.maps, start, (x, y), rover=state.rover)
        self.path = route.path
        offset = session.terrain_view.offset
        self.view.show(self.path, [], state.terrain, offset, state.size)
        self.view.mark("start", *start, state.terrain, offset, state.size)
        self.view.mark("goal", x, y, state.terrain, offset, state.size)
        self._explain(str(route))

    def _explain(self, text: str = "") -> None:
        """Show the next step, and the length of the path."""
        if not text:
            length = "" if self.path is None else f"Path of {self.path.length:.2f} m. "
            step = {
                MOVE: "To drive a path, let a click add to the path, and click two points or more.",
                DRAW: "Click two points or more on the terrain, then press “Drive the path”."
                if self.path is None
                else "Press “Drive the path”, or click further points.",
                ROUTE: self._route_step(),
            }[self.click.value]
            text = length + step
        self.note.content = note_html(text, "path")
        self.drive_button.disabled = self.path is None

    def _route_step(self) -> str:
        """Return the next step towards a route."""
        if self.session.maps is None:
            return "A route needs a map: compute one in the tab Terrain."
        return "Click the goal." if self.start else "Click the start on the terrain, then the goal."

    # -- run ------------------------------------------------------------------------------------------------------

    def _drive(self) -> None:
        """Drive along the path."""
        state = self.session.state
        if self.path is None:
            raise PathError("there is no path yet: choose “adds to the path” and click two points on the terrain")
        run = drive(
            state.rover, state.terrain, self.path, float(self.speed.value) / 100,
            step=step_of(self.path), mode=state.mode, gravity=state.gravity,
        )  # fmt: skip
        self._use(Record.of(state.rover, state.terrain, run), play=True)
        self._explain(f"{run.attrs['status_summary']}.")

    def _use(self, run: Record, play: bool) -> None:
        """Show a run from its start."""
        self.session.leave()
        self.forget()
        self.run, self.time = run, 0.0
        self.scrub.max = max(round(run.duration, 2), 0.02)
        self.scrub.value = 0.0
        self.rate.value = float(np.clip(round(run.duration / USUAL_PLAY), 1, 100))
        for control in (self.play_button, self.scrub, self.save):
            control.disabled = False
        self.simulate_button.disabled = self.path is None
        self.session.state.target = None
        self.play(play)
        self.session.redraw()

    def play(self, on: bool) -> None:
        """Play or pause the run.

        Args:
            on: True to play; from the start if the run is at its end.
        """
        if self.run is None:
            return
        if on and self.time >= self.run.duration:
            self.time = 0.0
        self.playing, self._clock = on, time.perf_counter()
        self.play_button.label = PAUSE if on else PLAY
        self.session.redraw()

    def _scrub(self, seconds: float) -> None:
        """Show the time that the visitor chose."""
        if self.run is not None:
            self.play(False)
            self.time = float(seconds)
            self.session.redraw()

    def _save(self) -> None:
        """Send the run to the browser as CSV."""
        if self.run is None:
            return
        with TemporaryDirectory(prefix="rockerbogie-lab-") as folder:
            file = FilePath(folder) / "run.csv"
            to_csv(self.run.run, file)
            content = file.read_bytes()
        self.session.client.send_file_download("run.csv", content, save_immediately=True)

    # -- simulation ------------------------------------------------------------------------------------------------

    def _simulate(self) -> None:
        """Start the simulation of the path in MuJoCo on a thread, and show its progress bar."""
        state, path = self.session.state, self.path
        if path is None or self.run is None:
            raise PathError("there is no run to simulate: drive a path first")
        if path.length > MOST_SIMULATED:
            raise PathError(f"the path is {path.length:.1f} m long; the page simulates at most {MOST_SIMULATED:g} m")
        speed = max(float(self.speed.value) / 100, path.length / 600)
        serial = self._serial
        self.simulate_button.disabled, self.progress.visible, self.progress.value = True, True, 0.0
        arguments = (state.rover, state.terrain, path, speed)
        work = threading.Thread(target=self._simulate_there, args=(serial, *arguments), daemon=True, name="lab-simulation")
        work.start()

    def _simulate_there(self, serial: int, rover: Any, terrain: Any, path: Path, speed: float) -> None:
        """Run the simulation, and hand its result to the session."""
        session = self.session
        last = -1.0

        def tell(done: int, count: int) -> None:
            nonlocal last
            if session.closed or serial != self._serial:
                raise StoppedError
            share = round(100 * done / max(count, 1))
            if share != last:
                last = share
                self.progress.value = float(share)

        try:
            with session.lab.heavy():
                simulated = simulate(rover, terrain, path, speed, progress=tell)
            record, apart = Record.of(rover, terrain, simulated), difference(rover, terrain, simulated)
        except StoppedError:
            return
        except Exception as error:
            text = message_of(error)
            session.later(lambda: self._simulation_failed(serial, text))
            return
        session.later(lambda: self._use_simulation(serial, record, apart))

    def _simulation_failed(self, serial: int, text: str) -> None:
        """Show the reason why a simulation failed."""
        if serial == self._serial:
            self.progress.visible, self.simulate_button.disabled = False, False
        raise RockerbogieError(f"MuJoCo: {text}")

    def _use_simulation(self, serial: int, record: Record, apart: Difference) -> None:
        """Show a simulation beside the run it belongs to."""
        if serial != self._serial or self.run is None:
            return
        self.progress.visible = False
        self.simulated, self.differences = record, apart
        self.session.ghost.show(True)
        self.time = 0.0
        self.play(True)
