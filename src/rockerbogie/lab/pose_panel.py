"""Controls of position, mode, limits and arrows."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from ..gravity import GRAVITY
from ..maps.limits import PRESETS
from .style import QUIET

if TYPE_CHECKING:
    from .context import Visit

#: Keys: forward (share of the rover's size) and turn (rad) of one press.
KEYS = {"I": ("Forward", 0.05, 0.0), "K": ("Back", -0.05, 0.0), "J": ("Turn left", 0.0, 0.05), "L": ("Turn right", 0.0, -0.05)}
#: Angle from which a limit of the page means no limit, degrees.
NO_LIMIT = 90.0
ANGLES = ("tilt", "roll", "pitch", "rocker", "bogie")


class PosePanel:
    """Controls of one visitor's pose.

    Args:
        session: the visitor's session.
    """

    def __init__(self, session: Visit) -> None:
        self.session = session
        gui, state = session.client.gui, session.state
        self.x = gui.add_number("x [m]", round(state.x, 4), step=0.01)
        self.y = gui.add_number("y [m]", round(state.y, 4), step=0.01)
        self.yaw = gui.add_number("yaw [°]", round(math.degrees(state.yaw), 3), step=0.1)
        for axis, field in enumerate((self.x, self.y, self.yaw)):
            field.on_update(session.callback(partial(self._typed, axis), ("typed", axis)))
        self.mode = gui.add_dropdown(
            "mode", ("contact", "equilibrium"), initial_value=state.mode,
            hint="contact: all six wheels on the terrain. equilibrium: the rover under its own weight; wheels may lift.",
        )  # fmt: skip
        self.mode.on_update(session.callback(self._option))
        names = [name.capitalize() for name in GRAVITY]
        own = next((name for name, g in GRAVITY.items() if g == state.gravity), "earth")
        self.gravity = gui.add_dropdown("gravity", names, initial_value=own.capitalize())
        self.gravity.on_update(session.callback(self._option))
        gui.add_button("Look at the rover", color=QUIET).on_click(session.callback(lambda _: session.look()))
        self.wheels = gui.add_html("")
        self.arrows = {}
        with gui.add_folder("Contacts", expand_by_default=True):
            for kind, on in session.forces.shown.items():
                self.arrows[kind] = gui.add_checkbox(f"show {kind}", on)
                self.arrows[kind].on_update(session.callback(self._arrows))
        with gui.add_folder("Limits shown in colour", expand_by_default=False):
            self.preset = gui.add_dropdown("limits of", list(PRESETS), initial_value="none")
            self.preset.on_update(session.callback(self._preset))
            self.limits = {
                name: gui.add_slider(f"{name} ± [°]", 1.0, NO_LIMIT, 0.5, NO_LIMIT, hint=f"{NO_LIMIT:g} means no limit")
                for name in ANGLES
            }
            for slider in self.limits.values():
                slider.on_update(session.callback(self._limits, "limits"))
        with gui.add_folder("Keys", expand_by_default=False):
            gui.add_markdown("**I** forward · **K** back · **J** / **L** turn · **P** play or pause · **C** look at the rover")
        for key, (label, forward, turn) in KEYS.items():
            gui.add_command(label, hotkey=key).on_trigger(session.callback(partial(self._step, forward, turn)))
        gui.add_command("Look at the rover", hotkey="C").on_trigger(session.callback(lambda _: session.look()))

    def show(self, position: tuple[float, float, float], wheels: str) -> None:
        """Show a position and the table of wheels.

        Args:
            position: x, y (m) and yaw (rad).
            wheels: HTML of the table.
        """
        x, y, yaw = position
        shown = ((self.x, round(x, 4)), (self.y, round(y, 4)), (self.yaw, round(math.degrees(yaw), 3)))
        for field, value in shown:
            if field.value != value:
                field.value = value
        self.wheels.content = wheels

    def _typed(self, axis: int, value: float) -> None:
        """Move the rover to a typed x, y or yaw; the other two stay as they are or will be."""
        self.session.leave()
        state = self.session.state
        target = list(state.target or (state.x, state.y, state.yaw))
        target[axis] = math.radians(value) if axis == 2 else float(value)
        state.target = (target[0], target[1], target[2])

    def _step(self, forward: float, turn: float, _: Any) -> None:
        """Move the rover by one press of a key."""
        self.session.leave()
        state = self.session.state
        state.target = state.step(forward * state.size, turn)

    def _option(self, _: Any) -> None:
        """Use the chosen mode and gravity."""
        state = self.session.state
        state.mode = self.mode.value
        state.gravity = GRAVITY[self.gravity.value.lower()]
        state.settle()
        self.session.redraw()

    def _arrows(self, _: Any) -> None:
        """Show or hide points and arrows."""
        self.session.forces.shown.update({kind: box.value for kind, box in self.arrows.items()})
        self.session.redraw()

    def _preset(self, _: Any) -> None:
        """Use the limits of a rover."""
        limits = PRESETS[self.preset.value]
        for name, slider in self.limits.items():
            value = getattr(limits, name)
            slider.value = NO_LIMIT if value is None else round(math.degrees(value) * 2) / 2
        self.session.state.limits = limits
        self.session.redraw()

    def _limits(self, _: Any) -> None:
        """Use the limits of the sliders."""
        values = {n: None if s.value >= NO_LIMIT else math.radians(float(s.value)) for n, s in self.limits.items()}
        self.session.state.limits = replace(self.session.state.limits, **values)
        self.session.redraw()
