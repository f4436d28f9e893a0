"""One tile of a map: settle the rover at every cell and heading, and sum up over headings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..rover.model import Rover
from ..settling.settle import Mode, settle
from ..settling.status import Status
from ..terrain.heightfield import Terrain
from .cells import Cells, Tile
from .ground import Ground, Span, nodes_under, reach
from .layers import LAYERS
from .limits import Limits, exceeded

Array = NDArray[np.float64]
#: Takes a layer's values: its name, their place in it, and they.
Take = Callable[[str, tuple[slice, ...], NDArray[Any]], None]

#: Headings of a tile settled at once: bounds the memory whatever their number.
HEADINGS = 4


@dataclass(frozen=True, eq=False)
class Job:
    """What is asked of every cell."""

    rover: Rover
    cells: Cells
    headings: Array  # (n,) rad
    limits: Limits
    mode: Mode
    layers: tuple[str, ...]

    def shape(self, layer: str, tile: Tile) -> tuple[int, ...]:
        """A layer's shape over a tile."""
        return (len(self.headings), *tile.shape) if LAYERS[layer].per_heading else tile.shape

    def window(self, ground: Ground, tiles: list[Tile]) -> tuple[Span, Span]:
        """The nodes, rows and columns, that poses on these tiles may read."""
        margin, whole = reach(self.rover), ground.whole
        x = self.cells.x((min(t.cols[0] for t in tiles), max(t.cols[1] for t in tiles)))
        y = self.cells.y((min(t.rows[0] for t in tiles), max(t.rows[1] for t in tiles)))
        return (
            nodes_under(y[0], y[-1], whole.origin[1], whole.spacing[1], whole.shape[0], margin),
            nodes_under(x[0], x[-1], whole.origin[0], whole.spacing[0], whole.shape[1], margin),
        )

    def settle(self, terrain: Terrain, tile: Tile, take: Take) -> None:
        """Work out one tile and hand over its layers."""
        x, y = self.cells.x(tile.cols), self.cells.y(tile.rows)
        look_below = self.limits.clearance is not None or not {"clearance", "worst_clearance"}.isdisjoint(self.layers)
        summary = _Summary((len(y), len(x)), len(self.headings))
        for start in range(0, len(self.headings), HEADINGS):
            part = slice(start, min(start + HEADINGS, len(self.headings)))
            yaw = self.headings[part]
            pose = settle(self.rover, terrain, x, y[:, None], yaw[:, None, None], mode=self.mode)
            tilt = _plain(pose.tilt)
            clearance = _plain(pose.clearance) if look_below else None
            over = exceeded(pose, self.limits, tilt, clearance)
            summary.add(yaw, pose.status, tilt, clearance, over)
            layers: dict[str, NDArray[Any] | None] = {
                "status": pose.status, "tilt": tilt, "roll": pose.roll, "pitch": pose.pitch, "rocker": pose.rocker,
                "bogie_left": pose.bogie[..., 0], "bogie_right": pose.bogie[..., 1], "clearance": clearance, "exceeded": over,
            }  # fmt: skip
            for name, values in layers.items():
                if name in self.layers and values is not None:
                    take(name, (part, *tile.region), values)
        for name, values in summary.layers().items():
            if name in self.layers:
                take(name, tile.region, values)


class _Summary:
    """What the headings of a tile have in common, heading by heading: so that it does not depend on how they come."""

    def __init__(self, shape: tuple[int, int], headings: int) -> None:
        self.headings = headings
        self.passed = np.zeros(shape, dtype=np.int64)
        self.known = np.zeros(shape, dtype=bool)
        self.worst_tilt, self.best_tilt, self.worst_clearance, self.best_heading = (np.full(shape, np.nan) for _ in range(4))
        self.least = np.full(shape, np.inf)  # tilt of a passable heading
        self.worst = np.zeros(shape, dtype=np.uint8)

    def add(self, yaw: Array, status: NDArray[np.uint8], tilt: Array, clearance: Array | None, over: NDArray[np.uint8]) -> None:
        """More headings: (n,), and layers (n, rows, cols)."""
        for k in range(len(yaw)):
            passes = over[k] == 0
            self.passed += passes
            self.known |= (status[k] != Status.NO_DATA) & (status[k] != Status.OFF_MAP)
            np.fmax(self.worst_tilt, tilt[k], out=self.worst_tilt)
            np.fmin(self.best_tilt, tilt[k], out=self.best_tilt)
            if clearance is not None:
                np.fmin(self.worst_clearance, clearance[k], out=self.worst_clearance)
            better = passes & (tilt[k] < self.least)
            np.copyto(self.least, tilt[k], where=better)
            np.copyto(self.best_heading, yaw[k], where=better)
            np.bitwise_or(self.worst, over[k], out=self.worst)

    def layers(self) -> dict[str, NDArray[Any]]:
        """The summaries, by name."""
        share = (self.passed / self.headings).astype(np.float32)
        share[~self.known] = np.nan
        return {
            "passable": share,
            "worst_tilt": _plain(self.worst_tilt),
            "best_tilt": _plain(self.best_tilt),
            "best_heading": self.best_heading,
            "worst_clearance": _plain(self.worst_clearance),
            "worst_exceeded": self.worst,
        }


def _plain(values: Array) -> Array:
    """The same with every nan the same nan: NumPy gives them signs that depend on where in an array they stand."""
    np.copyto(values, np.nan, where=np.isnan(values))
    return values
