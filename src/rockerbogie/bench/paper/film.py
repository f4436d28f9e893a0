"""Film of the paper's crossing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ...figures.film import write_film
from ...rover.model import Rover
from ...terrain.heightfield import Terrain
from .figures import VIEW, crossing_bounds, tracks

if TYPE_CHECKING:
    import xarray as xr


def crossing_gif(
    file: Path,
    rover: Rover,
    terrain: Terrain,
    run: xr.Dataset,
    *,
    frames: int = 64,
    progress: Callable[[float], None] = lambda share: None,
) -> None:
    """Write the crossing as a film with the tracks of the last two wheels.

    Args:
        file: the .gif to write.
        rover: the rover that crossed.
        terrain: the paper's two bumps.
        run: from `drive`.
        frames: number of pictures.
        progress: called with the share done, 0 to 1.
    """
    write_film(
        file, rover, terrain, run, frames=frames, view=VIEW, bounds=crossing_bounds(run, rover, terrain),
        tracks=tracks(terrain, run), progress=lambda done, total: progress(done / total),
    )  # fmt: skip
