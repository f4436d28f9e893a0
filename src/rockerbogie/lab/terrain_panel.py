"""Controls of the terrain: surface, upload, colours, map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ..maps.traversability import traversability
from ..terrain.heightfield import Terrain
from ..terrain.surface_names import ANGLES, parameters
from .terrain_view import colour_choices, legend_html
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
        upload = gui.add_upload_button("Upload a GeoTIFF", mime_type=".tif,.tiff")
        upload.on_upload(session.callback(lambda event: self._uploaded(event.target.value)))
        self.map_button = gui.add_button("Compute a map of where the rover can go")
        self.map_button.on_click(session.callback(self._map))
        with gui.add_folder("Generate a surface"):
            names = surface_names()
            own = session.state.terrain.name.split(" ")[0]
            self.surface = gui.add_dropdown("surface", names, initial_value=own if own in names else "mars")
            self.surface.on_update(session.callback(lambda _: self._fields()))
            self.folder = gui.add_folder("Parameters")
            gui.add_button("Generate").on_click(session.callback(self._generate))
        self.fields: dict[str, Any] = {}
        self._fields()

    def show_legend(self) -> None:
        """Show name, legend and grid of the terrain."""
        view, terrain = self.session.terrain_view, self.session.state.terrain
        rows, cols = terrain.z.shape
        self.title.content = (
            f'<div style="padding:0 .8em;font-size:13px"><b>{_escape(terrain.name or "terrain")}</b> '
            f"{cols} × {rows} nodes, {terrain.interpolation}</div>"
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
        session.colour = "passable" if maps is not None and "passable" in maps else "hillshade"
        self.colour.options = colour_choices(maps)
        self.colour.value = session.colour
        session.show_terrain()

    def _fields(self) -> None:
        """Make the fields of the chosen surface's parameters."""
        for field in self.fields.values():
            field.remove()
        self.fields = {}
        gui = self.session.client.gui
        with self.session.client.atomic(), self.folder:
            for key, value in parameters(self.surface.value).items():
                if isinstance(value, tuple):
                    self.fields[key] = gui.add_text(key, ",".join(f"{part:g}" for part in value))
                elif isinstance(value, int):
                    self.fields[key] = gui.add_number(key, value, step=1)
                elif isinstance(value, float):
                    shown = math.degrees(value) if key in ANGLES else value
                    self.fields[key] = gui.add_number(f"{key} [°]" if key in ANGLES else key, round(shown, 6), step=0.001)

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

    def _map(self, _: Any) -> None:
        """Compute a coarse map of the terrain for the rover."""
        state = self.session.state
        xmin, ymin, xmax, ymax = state.terrain.bounds
        resolution = max((xmax - xmin) / MAP_CELLS, (ymax - ymin) / MAP_CELLS, *state.terrain.spacing)
        with self.session.lab.heavy():
            maps = traversability(state.rover, state.terrain, MAP_HEADINGS, resolution, state.limits)
        self.use_map(maps)


def _escape(text: str) -> str:
    """Return text for HTML."""
    from html import escape

    return escape(text)
