"""Terrain in the scene of one visitor: tiles of a coarse grid, and all nodes near the rover."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..arrays import Array
from ..figures.scene.colours import Legend
from ..figures.scene.terrain_mesh import (
    MODES,
    TRIANGLES,
    Grid,
    TerrainMesh,
    coloured_values,
    edge_error,
    graded_grid,
    grid_mesh,
    terrain_grid,
)
from ..terrain.heightfield import Terrain

if TYPE_CHECKING:
    import viser
    import xarray as xr

#: Triangles of the coarse grid, and cells along a side of a tile that is drawn with all nodes.
COARSE = 200_000
TILE = 128
#: Most tiles drawn with all nodes at a time.
MOST_FINE = 9
#: Light drawing: cells along a side of the dense part of the grid; its radius and the distance after which it moves with the
#: rover, as shares of the radius of `refine`.
LIGHT_CELLS, LIGHT_RADIUS, LIGHT_MOVE = 32, 0.8, 0.15

_UNLIT = "KHR_materials_unlit"

Bounds = tuple[float, float, float, float]


class Tile(NamedTuple):
    """Part of the map that is drawn by one mesh."""

    key: tuple[int, int]
    bounds: Bounds


def tiles_of(terrain: Terrain) -> list[Tile]:
    """Divide a map into tiles of about 128 cells a side.

    Args:
        terrain: the terrain.

    Returns:
        One tile if all nodes are within the budget of the coarse grid; else tiles whose edges lie on nodes.
    """
    rows, cols = terrain.z.shape
    if 2 * (rows - 1) * (cols - 1) <= COARSE:
        return [Tile((0, 0), terrain.bounds)]
    edges = [np.linspace(0, n - 1, max(1, round((n - 1) / TILE)) + 1).round().astype(int) for n in (cols, rows)]
    (x0, y0), (dx, dy) = terrain.origin, terrain.spacing
    return [
        Tile((i, j), (x0 + dx * edges[0][i], y0 + dy * edges[1][j], x0 + dx * edges[0][i + 1], y0 + dy * edges[1][j + 1]))
        for j in range(len(edges[1]) - 1)
        for i in range(len(edges[0]) - 1)
    ]


def near_tiles(tiles: list[Tile], x: float, y: float, radius: float) -> list[Tile]:
    """Return the tiles that reach within a radius of a position, the nearest first.

    Args:
        tiles: all tiles.
        x: m.
        y: m.
        radius: m.

    Returns:
        At most `MOST_FINE` tiles.
    """
    away = []
    for tile in tiles:
        xmin, ymin, xmax, ymax = tile.bounds
        gap = math.hypot(max(xmin - x, 0.0, x - xmax), max(ymin - y, 0.0, y - ymax))
        if gap <= radius:
            away.append((gap, tile.key, tile))
    return [tile for _, _, tile in sorted(away)[:MOST_FINE]]


class TerrainView:
    """Terrain of one visitor.

    Args:
        scene: the visitor's scene.
    """

    def __init__(self, scene: viser.SceneApi) -> None:
        self.scene = scene
        self.offset: Array = np.zeros(3)
        self.legend: Legend | None = None
        self.note = ""
        self._tiles: list[Tile] = []
        self._coarse: dict[tuple[int, int], Any] = {}
        self._fine: dict[tuple[int, int], Any] = {}
        self._paint: dict[str, Any] = {}
        self._skirt = 0.0  # m, below the edges of tiles
        self._terrain: Terrain | None = None
        self.light = False
        self._near: Any = None  # mesh of light drawing
        self._centre: tuple[float, float] | None = None  # of its dense part
        self._drawn = 0  # meshes of light drawing so far

    def build(self, terrain: Terrain, colour: str, maps: xr.Dataset | None, light: bool = False) -> None:
        """Replace the meshes by those of a terrain; in light drawing they appear with `refine`.

        Args:
            terrain: the terrain.
            colour: plain, hillshade, height, slope or a layer of `maps`.
            maps: map with the layer, or None.
            light: draw one small grid that is dense near the rover.
        """
        self.remove()
        self.light = light
        xmin, ymin, xmax, ymax = terrain.bounds
        self.offset = np.array([(xmin + xmax) / 2, (ymin + ymax) / 2, float(np.nanmean(terrain.z))])
        self._terrain, self._tiles = terrain, tiles_of(terrain)
        x, y, z, note = terrain_grid(terrain, None, COARSE)
        self._paint = {"colour": colour, "maps": maps}
        self.legend = None
        if colour not in ("plain", "hillshade"):
            _, self.legend = coloured_values(x, y, z, colour, maps)
            if not self.legend.classes and self.legend.low < self.legend.high:
                self._paint["limits"] = (self.legend.low, self.legend.high)
        if light:
            self._tiles = []
            self.note = "light drawing: a coarse grid, dense near the rover. The rover settles on all data."
            return
        whole = len(self._tiles) == 1
        self.note = note if whole else f"{note}; all nodes near the rover. The rover settles on all data."
        grids = [terrain_grid(terrain, tile.bounds, max(2, COARSE // len(self._tiles))) for tile in self._tiles]
        self._skirt = 0.0 if whole else 2.0 * max(edge_error(terrain, grid) for grid in grids)
        for tile, grid in zip(self._tiles, grids, strict=True):
            self._coarse[tile.key] = self._add("coarse", tile, grid)

    def refine(self, x: float, y: float, radius: float) -> None:
        """Draw the terrain near a position with all nodes, and the rest with a coarse grid.

        Args:
            x: m.
            y: m.
            radius: m.
        """
        if self.light:
            self._refine_light(x, y, radius)
        if self._terrain is None or len(self._tiles) <= 1:
            return
        wanted = {tile.key: tile for tile in near_tiles(self._tiles, x, y, radius)}
        for key in [key for key in self._fine if key not in wanted]:
            self._coarse[key].visible = True
            self._fine.pop(key).remove()
        for key, tile in wanted.items():
            if key not in self._fine:
                self._fine[key] = self._add("fine", tile, terrain_grid(self._terrain, tile.bounds, TRIANGLES))
                self._coarse[key].visible = False

    def _refine_light(self, x: float, y: float, radius: float) -> None:
        """Move the dense part of the grid of light drawing to a position."""
        assert self._terrain is not None
        if self._centre is not None and max(abs(x - self._centre[0]), abs(y - self._centre[1])) < LIGHT_MOVE * radius:
            return
        self._centre = (x, y)
        old, self._near = self._near, None
        self._drawn += 1
        grid = graded_grid(self._terrain, self._centre, LIGHT_RADIUS * radius, LIGHT_CELLS)
        self._near = self._show(f"/terrain/light_{self._drawn % 2}", grid_mesh(grid, **self._paint))
        if old is not None:
            old.remove()

    def _add(self, kind: str, tile: Tile, grid: Grid) -> Any:
        """Add the mesh of a tile to the scene, with colours and a skirt."""
        mesh = grid_mesh(grid, skirt=self._skirt, **self._paint)
        return self._show(f"/terrain/{kind}_{tile.key[0]}_{tile.key[1]}", mesh)

    def _show(self, node: str, mesh: TerrainMesh) -> Any:
        """Add a mesh to the scene."""
        if len(mesh.faces) == 0:
            return self.scene.add_frame(node, show_axes=False)
        content = _glb(_coloured(mesh, self.offset), self.light)
        return self.scene.add_glb(node, content, cast_shadow=False, receive_shadow=not self.light)

    def remove(self) -> None:
        """Remove all meshes."""
        for mesh in (*self._coarse.values(), *self._fine.values(), *([] if self._near is None else [self._near])):
            mesh.remove()
        self._coarse, self._fine, self._tiles, self._near, self._centre = {}, {}, [], None, None


def _coloured(mesh: TerrainMesh, offset: Array) -> Any:
    """Return a mesh as trimesh's, relative to the origin of the scene."""
    import trimesh

    linear = np.round(255 * mesh.colours**2.2)  # browsers take the colours of vertices as linear, not as sRGB
    colours = np.concatenate([linear, np.full((len(linear), 1), 255)], axis=1).astype(np.uint8)
    return trimesh.Trimesh(mesh.vertices - offset, mesh.faces, vertex_colors=colours, process=False)


def _glb(mesh: Any, light: bool) -> bytes:
    """Return a mesh as GLB of a rough material, or of unlit colours in light drawing."""
    from trimesh.exchange.gltf import export_glb

    def paint(tree: dict[str, Any]) -> None:
        rough = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0}}  # the format's default is a metal
        tree["materials"] = [rough | {"doubleSided": True}]
        if light:
            tree["extensionsUsed"] = [_UNLIT]
            tree["materials"][0]["extensions"] = {_UNLIT: {}}
        for one in tree["meshes"]:
            for primitive in one["primitives"]:
                primitive["material"] = 0

    return bytes(export_glb(mesh.scene(), tree_postprocessor=paint))


def colour_choices(maps: xr.Dataset | None) -> list[str]:
    """Return the ways in which a terrain can be coloured.

    Args:
        maps: map of the terrain, or None.

    Returns:
        Names for `TerrainView.build`.
    """
    layers = [] if maps is None else [str(name) for name, v in maps.data_vars.items() if set(v.dims) == {"y", "x"}]
    return [*MODES[1:], *layers]


def usual_colour(maps: xr.Dataset | None) -> str:
    """Return the way in which a terrain is coloured at first.

    Args:
        maps: map of the terrain, or None.

    Returns:
        passable for a map that has it, else hillshade.
    """
    return "passable" if maps is not None and "passable" in maps else "hillshade"


def legend_html(legend: Legend | None, note: str) -> str:
    """Return the legend of a terrain as HTML.

    Args:
        legend: the scale, or None for a shaded terrain.
        note: spacing of the grid that is drawn.

    Returns:
        Title, colours and numbers; angles in degrees.
    """
    body = ""
    if legend is not None and legend.classes:
        square = "display:inline-block;width:12px;height:12px;margin-right:6px"
        rows = "".join(
            f'<div><span style="{square};background:{_css(colour)}"></span>{escape(meaning)}</div>'
            for colour, meaning in zip(legend.colours, legend.classes, strict=True)
        )
        body = f"<b>{escape(legend.label)}</b>{rows}"
    elif legend is not None:
        factor, unit = (180 / math.pi, "°") if legend.units == "rad" else (1.0, "" if legend.units == "1" else legend.units)
        chosen = np.linspace(0, len(legend.colours) - 1, 9).round().astype(int)
        stops = ",".join(_css(legend.colours[k]) for k in chosen)
        values = (legend.low, (legend.low + legend.high) / 2, legend.high)
        ends = "".join(f"<span>{factor * value:.4g}</span>" for value in values)
        body = (
            f"<b>{escape(legend.label)}</b> {escape(f'[{unit}]' if unit else '')}"
            f'<div style="height:10px;background:linear-gradient(90deg,{stops});margin:3px 0"></div>'
            f'<div style="display:flex;justify-content:space-between">{ends}</div>'
        )
    return (
        f'<div data-key="legend" style="padding:0 .8em;font-size:12px">{body}<div style="opacity:.65">{escape(note)}</div></div>'
    )


def _css(colour: Array) -> str:
    """Return a colour (3,), components 0 to 1, as `#rrggbb`."""
    return "#" + "".join(f"{round(255 * float(c)):02x}" for c in colour)
