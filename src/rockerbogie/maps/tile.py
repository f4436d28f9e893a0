"""One tile of a map: poses at every cell and heading, and summaries over headings."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..gravity import GRAVITY
from ..rover.model import Rover
from ..settling.settle import Mode, settle_with_contacts
from ..settling.status import Status
from ..statics.stability import force_values
from ..terrain.heightfield import Terrain
from .belly import UpperPlanes, clearance_at
from .cells import Cells, Tile
from .layers import LAYERS, WORST, kind_of
from .limits import BITS, Limits, exceeded, margin

Array = NDArray[np.float64]
#: Function for a layer's values: its name, their region on the map, the values.
Take = Callable[[str, tuple[slice, ...], NDArray[Any]], None]
#: Called after every batch of poses with the cells done (a fraction counts headings); raises to stop the work.
Tick = Callable[[float], None]

#: Headings of a tile settled in one pass: limits the memory for any number of headings.
HEADINGS = 4
#: Poses of a batch at first, at least and at most, and the time that a batch should take, s: work stops between batches.
FIRST_BATCH, MOST_BATCH, BATCH_TIME = 256, 1 << 16, 0.15
#: Layers that need the clearance itself; for all others it only matters if it is above its limit.
_CLEARANCES = frozenset({"clearance", "worst_clearance", "exceeded", "worst_exceeded"})
#: Layers that need the comparison with the limits.
_COMPARED = frozenset({"exceeded", "worst_exceeded", "passable", "best_heading"})
#: Heights per diameter of the disc over which roughness is computed.
ACROSS = 7


@dataclass(frozen=True, eq=False)
class Job:
    """The work for every cell of a map: rover, headings, limits, layers."""

    rover: Rover
    cells: Cells
    headings: Array  # (n,) rad
    limits: Limits
    mode: Mode
    layers: tuple[str, ...]
    gravity: float = GRAVITY["earth"]  # m/s²

    @property
    def forces(self) -> tuple[str, ...]:
        """Values of forces that the layers or limits need."""
        asked = {*self.limits.forces, *(name for name in WORST if {name, WORST[name]} & set(self.layers))}
        return tuple(name for name in WORST if name in asked)

    @property
    def compares(self) -> bool:
        """True if a layer needs the limits that poses exceed."""
        return not _COMPARED.isdisjoint(self.layers)

    def shape(self, layer: str, tile: Tile) -> tuple[int, ...]:
        """Return the shape of a layer over a tile.

        Args:
            layer: its name.
            tile: the cells.

        Returns:
            (headings, rows, cols) or (rows, cols).
        """
        return (len(self.headings), *tile.shape) if LAYERS[layer].per_heading else tile.shape

    def settle(self, terrain: Terrain, tile: Tile, take: Take, tick: Tick = lambda cells: None) -> None:
        """Settle the rover at every cell and heading of a tile, and pass its layers on.

        Poses are settled in batches; the result does not depend on their size.

        Args:
            terrain: a window that holds the tile and all that the rover reaches from it.
            tile: the cells.
            take: receives the layers.
            tick: called after every batch.
        """
        x, y = self.cells.x(tile.cols), self.cells.y(tile.rows)
        summary = _Summary(tile.shape, len(self.headings), kind_of("worst_exceeded", self.limits))
        planes = None
        if self.compares and self.limits.clearance is not None and _CLEARANCES.isdisjoint(self.layers):
            planes = UpperPlanes.of(self.rover, terrain, x, y, len(self.headings))
        pace = _Pace()
        for start in range(0, len(self.headings), HEADINGS):
            part = slice(start, min(start + HEADINGS, len(self.headings)))
            yaw = self.headings[part]
            wanted = [name for name in self.layers if LAYERS[name].per_heading]
            layers = {name: np.empty((len(yaw), *tile.shape), kind_of(name, self.limits)) for name in wanted}
            for rows, cols in pace.blocks(tile.shape, len(yaw)):
                done = self._batch(terrain, x[cols], y[rows], yaw, summary, (rows, cols), planes)
                for name in wanted:
                    layers[name][:, rows, cols] = done[name]
                tick(done["status"].size / len(self.headings))
            for name in wanted:
                take(name, (part, *tile.region), layers[name])
        found = summary.layers() | (self._relief(terrain, x, y) if not _RELIEF.isdisjoint(self.layers) else {})
        for name, values in found.items():
            if name in self.layers:
                take(name, tile.region, values)

    def _batch(
        self, terrain: Terrain, x: Array, y: Array, yaw: Array, summary: _Summary, at: tuple[slice, slice],
        planes: UpperPlanes | None,
    ) -> dict[str, NDArray[Any]]:  # fmt: skip
        """Return the layers (headings, rows, cols) of a batch, and add them to the summary."""
        places = x, y[:, None], yaw[:, None, None]
        pose, touch = settle_with_contacts(self.rover, terrain, *places, self.mode, self.gravity, keep=bool(self.forces))
        tilt = _plain(pose.tilt)
        bounded = self.compares and planes is None and self.limits.clearance is not None
        look_below = bounded or not _CLEARANCES.isdisjoint(self.layers)
        clearance = _plain(pose.clearance) if look_below else None
        forces = {name: _plain(values) for name, values in force_values(pose, self.forces, touch).items()}
        over = np.zeros(pose.shape, dtype=np.uint16)
        if self.compares:
            over = exceeded(pose, self.limits, tilt, clearance, forces)
        if planes is not None and self.limits.clearance is not None:
            doubtful = (over == 0) & ~planes.clear(pose, yaw, at, self.limits.clearance)
            over[doubtful] = np.where(clearance_at(pose, doubtful) > self.limits.clearance, 0, BITS["clearance"])
        room = margin(pose, self.limits, tilt) if not {"margin", "worst_margin"}.isdisjoint(self.layers) else None
        summary.add(at, yaw, pose.status, tilt, clearance, over, room, forces)
        layers: dict[str, NDArray[Any] | None] = {
            "status": pose.status, "tilt": tilt, "roll": pose.roll, "pitch": pose.pitch, "rocker": pose.rocker,
            "bogie_left": pose.bogie[..., 0], "bogie_right": pose.bogie[..., 1], "clearance": clearance, "exceeded": over,
            "margin": room, **forces,
        }  # fmt: skip
        return {name: values for name, values in layers.items() if values is not None}

    def _relief(self, terrain: Terrain, x: Array, y: Array) -> dict[str, Array]:
        """Return slope and aspect at the cells (rad), and roughness over a wheelbase (m)."""
        px, py = np.meshgrid(x, y)
        nx, ny, nz = np.moveaxis(terrain.normal(px, py), -1, 0)
        steep = np.arctan2(np.hypot(nx, ny), nz)
        aspect = np.where(steep > 1e-9, np.arctan2(ny, nx) % (2 * np.pi), np.nan)  # the direction in which it falls
        rough = np.full(px.shape, np.nan)
        if "roughness" in self.layers:
            u, v = disc(0.5 * self.rover.wheelbase)
            design = np.linalg.pinv(np.stack([u, v, np.ones_like(u)], axis=1))
            for row in range(len(y)):
                z = terrain.height(x[:, None] + u, y[row] + v)
                z = z - z.mean(axis=1, keepdims=True)  # sums of large heights would round
                plane = (z[:, None, :] * design).sum(axis=-1)  # no BLAS: its rounding depends on the shape
                rest = z - (plane[:, :1] * u + plane[:, 1:2] * v + plane[:, 2:])
                rough[row] = np.sqrt((rest**2).mean(axis=1))
        return {"slope": _plain(steep), "aspect": _plain(aspect), "roughness": _plain(rough)}


#: Layers of the terrain alone.
_RELIEF = frozenset({"slope", "aspect", "roughness"})


def disc(radius: float) -> tuple[Array, Array]:
    """Return the offsets of the heights from which roughness is computed: a grid cut to a disc.

    Args:
        radius: of the disc, m.

    Returns:
        x and y (n,), m.
    """
    at = np.linspace(-radius, radius, ACROSS)
    u, v = np.meshgrid(at, at)
    inside = np.hypot(u, v) <= radius * (1 + 1e-9)
    return u[inside], v[inside]


class _Pace:
    """Sizes of batches so that each takes about `BATCH_TIME`: a stop waits no longer than that."""

    def __init__(self) -> None:
        self.poses = FIRST_BATCH

    def blocks(self, shape: tuple[int, int], headings: int) -> Iterator[tuple[slice, slice]]:
        """Yield blocks of cells that cover the shape, each sized by the time of the last."""
        row = col = 0
        while row < shape[0]:
            began, cells = time.perf_counter(), max(self.poses // headings, 1)
            if col == 0 and cells >= shape[1]:
                rows, cols = slice(row, min(row + cells // shape[1], shape[0])), slice(0, shape[1])
            else:
                rows, cols = slice(row, row + 1), slice(col, min(col + cells, shape[1]))
            yield rows, cols
            row, col = (rows.stop, 0) if cols.stop == shape[1] else (row, cols.stop)
            share = BATCH_TIME / max(time.perf_counter() - began, 1e-6)
            self.poses = int(np.clip(self.poses * min(share, 4.0), headings, MOST_BATCH))


class _Summary:
    """Layers of a tile over all headings, added one by one: batches do not change the result."""

    def __init__(self, shape: tuple[int, int], headings: int, mask: str) -> None:
        self.headings = headings
        self.passed = np.zeros(shape, dtype=np.int64)
        self.known = np.zeros(shape, dtype=bool)
        names = ("worst_tilt", "best_tilt", "worst_clearance", "best_heading", "worst_margin")
        self.worst_tilt, self.best_tilt, self.worst_clearance, self.best_heading, self.worst_margin = (
            np.full(shape, np.nan) for _ in names
        )
        self.least = np.full(shape, np.inf)  # tilt of a passable heading
        self.worst = np.zeros(shape, dtype=mask)
        self.forces = {name: np.full(shape, np.nan) for name in WORST}

    def add(
        self, at: tuple[slice, slice], yaw: Array, status: NDArray[np.uint8], tilt: Array, clearance: Array | None,
        over: NDArray[np.uint16], room: Array | None, forces: Mapping[str, Array],
    ) -> None:  # fmt: skip
        """Add the headings of a block of cells to the summary.

        Args:
            at: rows and columns of the block.
            yaw: (n,) headings, rad.
            status, tilt, clearance: (n, rows, cols) of their poses: codes, rad, m.
            over: (n, rows, cols) a bit for each limit that is exceeded.
            room: (n, rows, cols) least distance of an angle from its limit, rad.
            forces: name -> (n, rows, cols) layers of forces.
        """
        best, least, worst = self.best_heading[at], self.least[at], self.worst[at]
        for k in range(len(yaw)):
            passes = over[k] == 0
            self.passed[at] += passes
            self.known[at] |= (status[k] != Status.NO_DATA) & (status[k] != Status.OFF_MAP)
            np.fmax(self.worst_tilt[at], tilt[k], out=self.worst_tilt[at])
            np.fmin(self.best_tilt[at], tilt[k], out=self.best_tilt[at])
            if clearance is not None:
                np.fmin(self.worst_clearance[at], clearance[k], out=self.worst_clearance[at])
            if room is not None:
                np.fmin(self.worst_margin[at], room[k], out=self.worst_margin[at])
            for name, values in forces.items():
                worst_of = np.fmin if name == "tip_margin" else np.fmax
                worst_of(self.forces[name][at], values[k], out=self.forces[name][at])
            better = passes & (tilt[k] < least)
            np.copyto(least, tilt[k], where=better)
            np.copyto(best, yaw[k], where=better)
            np.bitwise_or(worst, over[k].astype(worst.dtype), out=worst)

    def layers(self) -> dict[str, NDArray[Any]]:
        """Return the summaries by name."""
        share = (self.passed / self.headings).astype(np.float32)
        share[~self.known] = np.nan
        return {
            "passable": share,
            "worst_tilt": _plain(self.worst_tilt),
            "best_tilt": _plain(self.best_tilt),
            "best_heading": self.best_heading,
            "worst_clearance": _plain(self.worst_clearance),
            "worst_exceeded": self.worst,
            "worst_margin": _plain(self.worst_margin),
            **{WORST[name]: _plain(values) for name, values in self.forces.items()},
        }


def _plain(values: Array) -> Array:
    """Return the same values with one kind of NaN: its sign depends on its place in an array."""
    np.copyto(values, np.nan, where=np.isnan(values))
    return values
