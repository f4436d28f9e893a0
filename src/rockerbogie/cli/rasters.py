"""Options of commands that read a raster, and terrain from a file or a surface's name."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from ..errors import RockerbogieError, TerrainError
from ..terrain.surface_names import build_surface
from .common import SURFACE, Whole

if TYPE_CHECKING:
    from ..terrain.heightfield import Terrain

Bounds = tuple[float, float, float, float]


@dataclass(frozen=True)
class RasterOptions:
    """Options of a raster file.

    Parameters
    ----------
    band
        Band of the file that holds the heights, from 1.
    window
        Read only this part: xmin,ymin,xmax,ymax in metres, in the coordinates of the terrain.
    cell
        Side of a cell, m, for a file without georeference. Its south-west corner is then 0,0.
    """

    band: Whole = 1
    window: Annotated[str | None, Parameter(allow_leading_hyphen=True)] = None
    cell: float | None = None

    @property
    def given(self) -> dict[str, Any]:
        """Options that differ from their defaults, as arguments of `Terrain.from_raster`."""
        values = {"band": self.band, "window": parse_bounds(self.window, "--window"), "cell": self.cell}
        return {name: value for name, value in values.items() if value is not None and (name, value) != ("band", 1)}

    @property
    def file_options(self) -> dict[str, Any]:
        """Options of a file that is read in windows: band and cell."""
        return {"band": self.band, "cell": self.cell} if self.window is None else {}


Raster = Annotated[RasterOptions | None, Parameter(name="*", group="Raster files")]


def load_terrain(name: str, linear: bool | None, raster: RasterOptions | None = None) -> Terrain:
    """Return the terrain of a raster file or of `surface:NAME`.

    Args:
        name: as given on the command line.
        linear: True for bilinear, False for cubic; None: cubic for files, a surface's own default for surfaces.
        raster: options of the file.

    Returns:
        The terrain.

    Raises:
        TerrainError: no such file or surface; a file that is not a height field; raster options for a surface.
    """
    from ..terrain import surfaces
    from ..terrain.heightfield import Terrain

    options: dict[str, Any] = {} if linear is None else {"interpolation": "linear" if linear else "cubic"}
    given = raster.given if raster else {}
    if name.startswith(SURFACE):
        if given:
            raise TerrainError(f"--{', --'.join(given)} is for raster files; {name} is a built-in surface: leave it out")
        return build_surface(name.removeprefix(SURFACE), options.get("interpolation"))
    if name in surfaces.__all__ and not Path(name).exists():
        raise TerrainError(f"no file named {name!r}; did you mean the built-in surface {SURFACE + name!r}?")
    return Terrain.from_raster(name, **options, **given)


def raster_or_surface(name: str, linear: bool | None, raster: RasterOptions | None) -> Terrain | str:
    """Return a surface or a file's window in memory; else the file's name, to be read in parts.

    Args:
        name: as given on the command line.
        linear: as `load_terrain`.
        raster: options of the file.

    Returns:
        A terrain in memory, or the name of a file.

    Raises:
        TerrainError: as `load_terrain`.
    """
    from ..terrain import surfaces

    built_in = name.startswith(SURFACE) or (name in surfaces.__all__ and not Path(name).exists())
    return load_terrain(name, linear, raster) if built_in or (raster and raster.window) else name


def parse_bounds(text: str | None, option: str) -> Bounds | None:
    """Return xmin, ymin, xmax, ymax (m) of an option; None if it is not given.

    Args:
        text: "xmin,ymin,xmax,ymax".
        option: its name, for the error.

    Returns:
        Four numbers, m, or None.

    Raises:
        RockerbogieError: not four numbers.
    """
    if text is None:
        return None
    try:
        xmin, ymin, xmax, ymax = (float(part) for part in text.split(","))
    except ValueError:
        raise RockerbogieError(f"{option} {text!r} is not xmin,ymin,xmax,ymax in metres, as in 0,0,500,300") from None
    return xmin, ymin, xmax, ymax
