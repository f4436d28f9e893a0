"""Controls of the rover: preset, upload, sizes, saving."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..rover.formats.toml_write import to_toml
from ..rover.model import Rover
from .dials import Dial, changed, dh_dials, has_dh, pivot_dials
from .style import QUIET, note_html
from .uploads import plain_name, preset_rover, rover_names, uploaded_rover

if TYPE_CHECKING:
    from .context import Visit

OWN = "(uploaded)"
PIVOTS, CONSTANTS = "pivots and wheels", "K1 to K11 of the paper"


class RoverPanel:
    """Controls of one visitor's rover.

    Args:
        session: the visitor's session.
    """

    def __init__(self, session: Visit) -> None:
        self.session = session
        self.base: Rover = session.state.rover
        gui = session.client.gui
        names = rover_names()
        own = self.base.name if self.base.name in names else OWN
        self.preset = gui.add_dropdown("rover", [*names, *([] if own in names else [OWN])], initial_value=own)
        self.preset.on_update(session.callback(self._choose))
        upload = gui.add_upload_button("Upload TOML, URDF, SDF or MJCF", mime_type=".toml,.urdf,.sdf,.xml", color=QUIET)
        upload.on_upload(session.callback(self._uploaded))
        gui.add_button("Save as TOML").on_click(session.callback(self._save))
        self.edit_by = gui.add_dropdown("sizes by", (PIVOTS, CONSTANTS), initial_value=PIVOTS)
        self.edit_by.on_update(session.callback(lambda _: self._build()))
        self.note = gui.add_html("")
        self.folder = gui.add_folder("Sizes, lengths in m")
        back = gui.add_button("Back to the original sizes", color=QUIET)
        back.on_click(session.callback(lambda _: self.use(self.base)))
        self.sliders: dict[str, Any] = {}
        self._build()

    def use(self, rover: Rover, notes: list[str] | None = None) -> None:
        """Replace the rover and its dials.

        Args:
            rover: the new rover.
            notes: shown in the page.
        """
        self.session.drive_panel.forget()
        self.base = rover
        self.session.state.use_rover(rover)
        self.session.show_rover()
        self._build()
        if notes:
            self.session.notify(f"Read {rover.name}, with notes", " · ".join(notes[:6]), "yellow")

    def _build(self) -> None:
        """Make the sliders for the rover."""
        constants = self.edit_by.value == CONSTANTS
        if constants and not has_dh(self.base):
            text = f"{self.base.name} has no constants K1 to K11: its tracks, wheels or steering axes differ. Pivots are shown."
            self.note.content = note_html(text, warning=True)
            constants = False
        else:
            self.note.content = ""
        for slider in self.sliders.values():
            slider.remove()
        self.sliders = {}
        dials: list[Dial] = dh_dials(self.base) if constants else pivot_dials(self.base)
        with self.session.client.atomic(), self.folder:
            for dial in dials:
                low, high = min(dial.low, dial.value), max(dial.high, dial.value)
                slider = self.session.client.gui.add_slider(dial.label, low, high, dial.step, dial.value)
                slider.on_update(self.session.callback(self._changed, "sizes"))
                self.sliders[dial.key] = slider

    def _changed(self, _: Any) -> None:
        """Use the sizes of the sliders."""
        values = {key: float(slider.value) for key, slider in self.sliders.items()}
        rover, notes = changed(self.base, values)
        self.session.drive_panel.forget()
        self.session.state.use_rover(rover)
        self.session.show_rover()
        self.note.content = note_html(" ".join(notes), warning=True)

    def _choose(self, _: Any) -> None:
        """Load the chosen preset."""
        if self.preset.value != OWN:
            self.use(*preset_rover(self.preset.value))
            self.session.look()

    def _uploaded(self, file: Any) -> None:
        """Read an uploaded rover."""
        self.use(*uploaded_rover(file.name, file.content))
        self.preset.options = [*rover_names(), OWN]
        self.preset.value = OWN
        self.session.look()

    def _save(self, _: Any) -> None:
        """Send the rover to the browser as a TOML file."""
        rover = self.session.state.rover
        if rover is not self.base:
            source = f"{self.base.source}; sizes changed in the lab".removeprefix("; ")
            rover = rover.replace(name=f"{self.base.name}-changed", source=source)
        self.session.client.send_file_download(f"{plain_name(rover.name)}.toml", to_toml(rover).encode(), save_immediately=True)
