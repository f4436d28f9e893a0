"""One HTML file that replays a run, a pose or a map offline.

It holds the data as base64 and a WebGL page without libraries (replay.html).

docs/replay.md gives the reasons for a page of its own instead of a library.
"""

from __future__ import annotations

import base64
import json
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Array
from ...errors import RockerbogieError
from ...files.outputs import SOURCE
from ...rover.model import Rover
from ...settling.pose import Pose
from ...settling.status import MEANING, Status
from ...statics.climb import Climb
from ...terrain.heightfield import Terrain
from .climb_run import climb_run
from .colours import MISSING, Legend
from .mesh import Part, vertex_normals
from .rover_mesh import LINKS, rover_parts
from .subject import Records, good, plots_of, records_of, surroundings
from .terrain_mesh import CUT, SOIL, Grid, block_base, coloured_values, terrain_grid

if TYPE_CHECKING:
    import xarray as xr

    from ...motion.path_files import Route

#: Greatest number of triangles of the terrain on a page.
TRIANGLES = 240_000
#: Layers of a map that a page offers, if the map has them.
LAYERS = (
    *("passable", "best_tilt", "worst_tilt", "worst_clearance", "worst_margin", "slope", "roughness", "reachable", "reach_cost"),
    *("required_friction", "tip_margin", "max_torque", "slip"),
)
#: First direction of the camera: azimuth from +x and elevation, rad.
VIEW = (np.radians(-58.0), np.radians(24.0))
#: Elevation of the first view of a map, rad.
MAP_ELEVATION = np.radians(50.0)


def page(
    subject: Pose | Climb | xr.Dataset,
    *,
    rover: Rover | None = None,
    terrain: Terrain | None = None,
    route: Route | None = None,
    title: str | None = None,
    triangles: int = TRIANGLES,
) -> str:
    """Return a page that shows a pose, a run or a map, in one piece.

    Args:
        subject: from `settle`, `drive`, `simulate`, `climb`, `traversability` or `read_map`.
        rover: of a run that was read from a file.
        terrain: of a run that was read from a file, or under a map (without it, a map is flat).
        route: from `plan`, drawn over a map.
        title: default: the names of rover and terrain.
        triangles: greatest number of triangles of the terrain.

    Returns:
        HTML.

    Raises:
        RockerbogieError: nothing that can be shown.
    """
    if isinstance(subject, Climb):
        subject = climb_run(subject)
    if not isinstance(subject, Pose) and "x" in getattr(subject, "dims", ()) and "y" in getattr(subject, "dims", ()):
        data, text = _map_data(subject, terrain, route, triangles)
    else:
        if not isinstance(subject, Pose) and not hasattr(subject, "data_vars"):
            raise RockerbogieError(f"a {type(subject).__name__} cannot be shown: give a pose, a run or a map")
        data, text = _run_data(records_of(subject, rover, terrain), triangles)
    heading = escape(text if title is None else title)
    packed = json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    template = files("rockerbogie.figures.scene").joinpath("replay.html").read_text(encoding="utf-8")
    for mark, value in (("@SOURCE@", SOURCE), ("@TITLE@", heading), ("@DATA@", packed)):
        template = template.replace(mark, value)
    return template


def _b64(values: ArrayLike, kind: str) -> str:
    """Return an array as base64 of little-endian numbers."""
    return base64.b64encode(np.ascontiguousarray(values, dtype=np.dtype(kind).newbyteorder("<")).tobytes()).decode("ascii")


def _run_data(records: Records, triangles: int) -> tuple[dict[str, Any], str]:
    """Return the data of a page with a rover, and its title."""
    rover, terrain, n = records.rover, records.terrain, len(records.time)
    bounds = surroundings(records)
    grid = terrain_grid(terrain, bounds, triangles)
    origin = _origin(grid)
    used = [link for link in LINKS if any(part.link == link for part in rover_parts(rover))]
    frames = records.frames[:, [LINKS.index(link) for link in used]]
    known = np.asarray(np.isfinite(frames).all(axis=(1, 2, 3)))
    frames = np.where(known[:, None, None, None], frames, np.eye(4))
    data = _common(grid, origin, _layers(grid, None, ("height", "slope")), rover) | {
        "about": _about(records, grid),
        "links": [_link(link, [part for part in rover_parts(rover) if part.link == link]) for link in used],
        "run": {
            "n": n, "unit": records.unit, "clock": "time" in records.data.coords,
            "time": _b64(records.time, "f4"), "at": _b64(records.at, "f4"),
            "place": _b64(frames[..., :3, 3] - np.where(known[:, None, None], origin, 0.0), "f4"),
            "turn": _b64(np.round(32767 * quaternions(frames[..., :3, :3])), "i2"),
            "known": _b64(known, "u1"), "status": _b64(records.status, "u1"),
            "contact": _b64(np.nan_to_num(records.contact - origin, nan=1e9), "f4"), "lifted": _b64(records.lifted, "u1"),
            "codes": {int(s): [Status(int(s)).name, MEANING[Status(int(s))][0], good(int(s))] for s in np.unique(records.status)},
        },
    }  # fmt: skip
    data["plots"] = [] if n < 2 else [
        plot | {"lines": [line | {"values": _b64(line["values"], "f4")} for line in plot["lines"]]} for plot in plots_of(records)
    ]  # fmt: skip
    if n == 1:
        data["numbers"] = _numbers(records)
        data["state"] = [
            f"{Status(int(records.status[0])).name}: {MEANING[Status(int(records.status[0]))][0]}",
            good(int(records.status[0])),
        ]
    elif records.unit:
        data["ribbon"] = _ribbon(terrain, records.place[:, :2], 0.012 * rover.wheelbase, origin)
    return data, f"{rover.name} on {terrain.name}"


def _map_data(maps: xr.Dataset, terrain: Terrain | None, route: Route | None, triangles: int) -> tuple[dict[str, Any], str]:
    """Return the data of a page with a map, and its title."""
    names = [name for name in LAYERS if name in maps and set(maps[name].dims) == {"y", "x"}]
    if not names:
        raise RockerbogieError(f"the map has none of the layers {', '.join(LAYERS)}: make one of them with traversability")
    x, y = maps["x"].values, maps["y"].values
    half = [0.5 * float(np.abs(np.diff(at)).max()) if len(at) > 1 else 0.5 for at in (x, y)]
    bounds = (float(x.min()) - half[0], float(y.min()) - half[1], float(x.max()) + half[0], float(y.max()) + half[1])
    if terrain is None:
        every = max(1, int(np.ceil(np.sqrt(2 * x.size * y.size / triangles))))
        at = [np.sort(axis)[every // 2 :: every] for axis in (x, y)]
        grid = Grid(at[0], at[1], np.zeros((len(at[1]), len(at[0]))), f"cells of {2 * half[0]:.3g} m, flat: no terrain was given")
    else:
        grid = terrain_grid(terrain, bounds, triangles)
    origin = _origin(grid)
    shown = (*names, *(() if terrain is None else ("height", *(() if "slope" in names else ("slope",)))))
    data = _common(grid, origin, _layers(grid, maps, shown)[1:], None)
    rover = str(maps.attrs.get("rover", "rover"))
    data["about"] = f"map of {len(x)} by {len(y)} cells · {grid.note}"
    if route is not None and terrain is not None:
        data["ribbon"] = _ribbon(terrain, np.stack([route.x, route.y], axis=-1), 0.006 * data["extent"], origin)
    kept = {str(key).replace("_", " "): value for key, value in maps.attrs.items() if key not in ("title", "Conventions")}
    rows = [[key, f"{value:g}" if isinstance(value, float) else str(value)] for key, value in kept.items() if np.isscalar(value)]
    data["numbers"] = [row for row in rows if len(row[1]) < 60][:12]
    return data, f"{rover} on {maps.attrs.get('terrain', 'terrain')}"


def _origin(grid: Grid) -> Array:
    """Return whole metres near the middle of the grid, from which positions are counted."""
    z = float(np.nanmin(grid.z)) if np.isfinite(grid.z).any() else 0.0
    return np.asarray(np.floor([(grid.x[0] + grid.x[-1]) / 2, (grid.y[0] + grid.y[-1]) / 2, z]))


def _common(grid: Grid, origin: Array, layers: list[dict[str, Any]], rover: Rover | None) -> dict[str, Any]:
    """Return the data that all pages have: terrain, layers, sizes and view."""
    known = np.isfinite(grid.z)
    low, high = (float(grid.z[known].min()), float(grid.z[known].max())) if known.any() else (0.0, 0.0)
    span = max(high - low, 1e-6)
    levels = np.where(known, np.round(65534 * (np.where(known, grid.z, low) - low) / span), 65535)
    size = np.array([np.ptp(grid.x), np.ptp(grid.y), high - low])
    extent = float(np.linalg.norm(size))
    step = _round_step(float(size[:2].max()) / 20)
    centre = np.array([(grid.x[0] + grid.x[-1]) / 2, (grid.y[0] + grid.y[-1]) / 2, (low + high) / 2]) - origin
    base = block_base(np.where(known, grid.z, np.nan) if known.any() else np.zeros(1))
    body = 1.0 if rover is None else rover.wheelbase + 2 * float(rover.wheel_radius.max())
    return {
        "view": [VIEW[0], MAP_ELEVATION if rover is None else VIEW[1]],
        "centre": centre.tolist(), "extent": extent, "grid": step, "offset": (origin[:2] % step).tolist(),
        "span": extent if rover is None else 1.2 * body,
        "lift": 0.0 if rover is None else float(rover.hubs[:, 2].mean() + rover.body_box[1, 2]) / 2,
        "terrain": {
            "x": _b64(grid.x - origin[0], "f4"), "y": _b64(grid.y - origin[1], "f4"), "z": _b64(levels, "u2"),
            "low": low - origin[2], "high": low + span - origin[2], "base": base - origin[2],
            "soil": _rgb(SOIL), "cut": _rgb(CUT), "missing": _rgb(MISSING), "layers": layers,
        },
    }  # fmt: skip


def _round_step(rough: float) -> float:
    """Return 1, 2, 5 or 10 times a power of ten, the next above a length."""
    power = 10.0 ** np.floor(np.log10(max(rough, 1e-9)))
    return float(next(m * power for m in (1, 2, 5, 10) if m * power >= rough * 0.999))


def _rgb(colour: ArrayLike) -> list[int]:
    """Return a colour as three bytes."""
    return [round(255 * float(c)) for c in np.asarray(colour)]


def _layers(grid: Grid, maps: xr.Dataset | None, names: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the colourings of the terrain that the page offers; the first is plain."""
    out: list[dict[str, Any]] = [{"name": "plain", "label": "", "units": "", "colours": None, "values": None, "classes": []}]
    for name in names:
        values, legend = coloured_values(grid.x, grid.y, grid.z, name, maps)
        out.append({"name": name.replace("_", " ")} | _layer(values, legend))
    return out


def _layer(values: Array, legend: Legend) -> dict[str, Any]:
    """Return one colouring: a table of colours, and the index of each vertex (255: missing)."""
    last = len(legend.colours) - 1 if legend.classes else 254
    known = np.isfinite(values)
    share = values if legend.classes else (values - legend.low) / max(legend.high - legend.low, 1e-300) * last
    index = np.where(known, np.clip(np.round(np.where(known, share, 0.0)), 0, last), 255)
    scale, units = (180 / np.pi, "°") if legend.units == "rad" else (1.0, "" if legend.units == "1" else legend.units)
    return {
        "label": legend.label, "units": units, "classes": list(legend.classes), "values": _b64(index, "u1"),
        "low": f"{scale * legend.low:.4g}", "high": f"{scale * legend.high:.4g}", "gaps": bool((~known).any()),
        "colours": _b64(np.round(255 * legend.colours[: last + 1]), "u1"),
    }  # fmt: skip


def _link(name: str, parts: list[Part]) -> dict[str, str]:
    """Return the triangles of one link with normals and colours at the vertices."""
    first = np.cumsum([0, *(len(part.vertices) for part in parts)])
    normal = np.concatenate([vertex_normals(part.vertices, part.faces) for part in parts])
    colour = np.concatenate([np.tile(_rgb(part.colour), (len(part.vertices), 1)) for part in parts])
    faces = np.concatenate([part.faces + start for part, start in zip(parts, first, strict=False)])
    place = np.concatenate([part.vertices for part in parts])
    return {
        "name": name, "place": _b64(place, "f4"), "normal": _b64(np.round(127 * normal), "i1"), "colour": _b64(colour, "u1"),
        "faces": _b64(faces, "u4"),
    }  # fmt: skip


def _ribbon(terrain: Terrain, track: Array, width: float, origin: Array) -> str:
    """Return the two sides of a ribbon along a track on the terrain, in turn."""
    step = np.gradient(track, axis=0) if len(track) > 1 else np.zeros_like(track)
    across = np.stack([-step[:, 1], step[:, 0]], axis=-1)
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    sides = np.stack([track + sign * 0.5 * width * across for sign in (1, -1)], axis=1)
    height = terrain.height(sides[..., 0], sides[..., 1]) + 0.3 * width
    return _b64(np.concatenate([sides, height[..., None]], axis=-1) - origin, "f4")


def _about(records: Records, grid: Grid) -> str:
    """Return the line under the title: the path, the number of records, and what is drawn."""
    n = len(records.time)
    parts = []
    if n > 1 and records.unit == "m":
        parts.append(f"{records.at[-1] - records.at[0]:.4g} m")
    if n > 1:
        taken = f", 1 in {records.every} shown" if records.every > 1 else ""
        parts.append(f"{records.data.attrs.get('source', '').split(' ')[-1] or 'poses'}: {n} records{taken}")
    if "verdict" in records.data.attrs:
        parts.append(str(records.data.attrs["verdict"]))
    return " · ".join([*parts, f"terrain {grid.note}", "left blue, right vermilion"])


def _numbers(records: Records) -> list[list[str]]:
    """Return the numbers of one pose as text."""
    data = records.data.isel({records.data["z"].dims[0]: 0})
    rows = [[name, f"{float(data[name]):.4f} m"] for name in "xyz"]
    rows += [[name, f"{np.degrees(float(data[name])):+.2f}°"] for name in ("roll", "pitch", "yaw", "rocker")]
    rows += [
        [f"bogie {side}", f"{np.degrees(float(v)):+.2f}°"]
        for side, v in zip(("left", "right"), data["bogie"].values, strict=True)
    ]
    if "clearance" in data:
        rows.append(["clearance", f"{float(data['clearance']):.3f} m"])
    return rows


def quaternions(R: ArrayLike) -> Array:
    """Return unit quaternions of rotation matrices.

    Args:
        R: (..., 3, 3).

    Returns:
        (..., 4) w, x, y, z.
    """
    r = np.asarray(R, dtype=float)
    d = [r[..., k, k] for k in range(3)]
    square = np.stack([1 + d[0] + d[1] + d[2], 1 + d[0] - d[1] - d[2], 1 - d[0] + d[1] - d[2], 1 - d[0] - d[1] + d[2]], axis=-1)
    a, b, c = r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]
    p, q, s = r[..., 1, 0] + r[..., 0, 1], r[..., 0, 2] + r[..., 2, 0], r[..., 2, 1] + r[..., 1, 2]
    rows = [[square[..., 0], a, b, c], [a, square[..., 1], p, q], [b, p, square[..., 2], s], [c, q, s, square[..., 3]]]
    table = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)  # each row is a multiple of the quaternion
    best = np.argmax(square, axis=-1)[..., None, None]
    out = np.take_along_axis(table, np.broadcast_to(best, (*best.shape[:-1], 4)), axis=-2)[..., 0, :]
    return np.asarray(out / np.linalg.norm(out, axis=-1, keepdims=True))
