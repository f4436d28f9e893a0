"""Controls of the terrain: surface, upload, colours, map."""

from __future__ import annotations

import inspect
import math
import re
from typing import TYPE_CHECKING, Any

from ..maps.traversability import traversability
from ..terrain import surfaces
from ..terrain.heightfield import Terrain
from ..terrain.surface_names import ANGLES, parameters
from .style import QUIET
from .terrain_view import colour_choices, legend_html, usual_colour
from .uploads import surface, surface_names, uploaded_terrain

if TYPE_CHECKING:
    import xarray as xr

    from .context import Visit

#: Cells along the longer side of a map that is computed in the page, and its headings.
MAP_CELLS, MAP_HEADINGS = 90, 8


class TerrainPanel:
    """Controls of one visitor's terrain.

    Args:
        session: the visitor's session.
    """

    def __init__(self, session: Visit) -> None:
        self.session = session
        gui = session.client.gui
        self.title = gui.add_html("")
        self.colour = gui.add_dropdown("colour by", colour_choices(session.maps), initial_value=session.colour)
        self.colour.on_update(session.callback(self._coloured))
        self.legend = gui.add_html("")
        self.light = gui.add_checkbox(
            "light drawing", session.light, hint="No shadows, coarser terrain: for a phone or a computer without a graphics card."
        )
        self.light.on_update(session.callback(self._lightened))
        upload = gui.add_upload_button("Upload a GeoTIFF", mime_type=".tif,.tiff", color=QUIET)
        upload.on_upload(session.callback(self._uploaded))
        self.map_button = gui.add_button(
            "Map where the rover can go", color=QUIET,
            hint="Settle the rover at up to 90 × 90 cells and 8 headings, with the limits of the tab Pose.",
        )  # fmt: skip
        self.map_button.on_click(session.callback(self._map))
        with gui.add_folder("Generate a surface"):
            names = surface_names()
            own, _, rest = session.state.terrain.name.partition(" ")
            seed = re.search(r"\d+$", rest)
            self.surface = gui.add_dropdown("surface", names, initial_value=own if own in names else "mars")
            self.surface.on_update(session.callback(lambda _: self._fields()))
            self.folder = gui.add_folder("Parameters")
            gui.add_button("Generate").on_click(session.callback(self._generate))
        self.fields: dict[str, Any] = {}
        self._fields(int(seed[0]) if own in names and seed else None)

    def show_legend(self) -> None:
        """Show name, legend and grid of the terrain."""
        view, terrain = self.session.terrain_view, self.session.state.terrain
        rows, cols = terrain.z.shape
        self.title.content = (
            f'<div style="padding:0 .8em;font-size:13px"><b>{_escape(terrain.name or "terrain")}</b> '
            f"· {cols} × {rows} nodes, {'bicubic' if terrain.interpolation == 'cubic' else 'bilinear'}</div>"
        )
        self.legend.content = legend_html(view.legend, view.note)

    def use(self, terrain: Terrain, notes: list[str] | None = None) -> None:
        """Replace the terrain.

        Args:
            terrain: the new terrain.
            notes: shown in the page.
        """
        session = self.session
        session.drive_panel.forget()
        session.drive_panel.clear()
        session.state.use_terrain(terrain)
        self.use_map(None)
        session.look()
        if notes:
            session.notify(f"Read {terrain.name}, with notes", " · ".join(notes[:6]), "yellow")

    def use_map(self, maps: xr.Dataset | None) -> None:
        """Replace the map, and colour the terrain by it.

        Args:
            maps: of the terrain, or None.
        """
        session = self.session
        session.maps = maps
        session.colour = usual_colour(maps)
        self.colour.options = colour_choices(maps)
        self.colour.value = session.colour
        session.show_terrain()

    def _fields(self, seed: int | None = None) -> None:
        """Make the fields of the chosen surface's parameters, with another seed than the usual one."""
        for field in self.fields.values():
            field.remove()
        self.fields = {}
        gui = self.session.client.gui
        with self.session.client.atomic(), self.folder:
            hints = parameter_hints(self.surface.value)
            for key, value in parameters(self.surface.value).items():
                name, hint = key.replace("_", " "), hints.get(key)
                if isinstance(value, tuple):
                    self.fields[key] = gui.add_text(name, ",".join(f"{part:g}" for part in value), hint=hint)
                elif isinstance(value, int):
                    first = value if seed is None or key != "seed" else seed
                    self.fields[key] = gui.add_number(name, first, step=1, hint=hint)
                elif isinstance(value, float):
                    shown = math.degrees(value) if key in ANGLES else value
                    label = f"{name} [°]" if key in ANGLES else name
                    self.fields[key] = gui.add_number(label, round(shown, 6), step=0.001, hint=hint)

    def _generate(self, _: Any) -> None:
        """Generate the surface with the parameters of the fields."""
        pairs = "&".join(f"{key}={field.value}" for key, field in self.fields.items())
        self.use(surface(f"{self.surface.value}?{pairs}"))

    def _uploaded(self, file: Any) -> None:
        """Read an uploaded terrain."""
        self.use(*uploaded_terrain(file.name, file.content))

    def _coloured(self, _: Any) -> None:
        """Colour the terrain as chosen."""
        self.session.colour = self.colour.value
        self.session.show_terrain()

    def _lightened(self, _: Any) -> None:
        """Switch between light and full drawing."""
        self.session.light = bool(self.light.value)
        self.session.show_terrain()
        self.session.show_rover()

    def _map(self, _: Any) -> None:
        """Compute a coarse map of the terrain for the rover."""
        state = self.session.state
        xmin, ymin, xmax, ymax = state.terrain.bounds
        resolution = max((xmax - xmin) / MAP_CELLS, (ymax - ymin) / MAP_CELLS, *state.terrain.spacing)
        with self.session.lab.heavy():
            maps = traversability(state.rover, state.terrain, MAP_HEADINGS, resolution, state.limits)
        self.use_map(maps)


def parameter_hints(surface_name: str) -> dict[str, str]:
    """Return the meaning of a surface's parameters, from its documentation.

    Args:
        surface_name: of a built-in surface.

    Returns:
        Parameter -> meaning with unit; angles are in degrees in the page.
    """
    text = inspect.getdoc(getattr(surfaces, surface_name)) or ""
    arguments = text.partition("Args:\n")[2].partition("\n\n")[0]
    found = re.findall(r"^    (\w[\w, ]*): (.*(?:\n {8,}.*)*)", arguments, re.MULTILINE)
    return {
        key: " ".join(meaning.split()).replace(", rad", ", °").rstrip(".")
        for names, meaning in found
        for key in names.split(", ")
    }


def _escape(text: str) -> str:
    """Return text for HTML."""
    from html import escape

    return escape(text)
