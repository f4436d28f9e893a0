"""What the commands share: how ground, places and files are named on the command line, progress, JSON."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from ..errors import RockerbogieError, TerrainError, unknown_name

if TYPE_CHECKING:
    from ..terrain.heightfield import Terrain

#: `--terrain surface:NAME` is a built-in surface at its usual size.
SURFACE = "surface:"

TerrainName = Annotated[str, Parameter(name=["--terrain", "-t"])]
RoverName = Annotated[str, Parameter(name=["--rover", "-r"])]
Folder = Annotated[Path | None, Parameter(name=["--output", "-o"])]
Linear = Annotated[bool | None, Parameter(name="--linear", negative="--cubic")]
Json = Annotated[bool, Parameter(name="--json", negative="")]


def load_terrain(name: str, linear: bool | None) -> Terrain:
    """The ground from a raster file, or `surface:NAME`. Not said linear or cubic: cubic for files, a surface's own way for it.

    Raises:
        TerrainError: no such file or surface, or a file that holds no height field.
    """
    from ..terrain import surfaces
    from ..terrain.heightfield import Terrain

    way: dict[str, Any] = {} if linear is None else {"interpolation": "linear" if linear else "cubic"}
    if name.startswith(SURFACE):
        wanted = name.removeprefix(SURFACE)
        if wanted not in surfaces.__all__:
            raise TerrainError(unknown_name("surface", wanted, surfaces.__all__))
        terrain: Terrain = getattr(surfaces, wanted)(**way)
        return terrain
    if name in surfaces.__all__ and not Path(name).exists():
        raise TerrainError(f"no file named {name!r}; did you mean the built-in surface {SURFACE + name!r}?")
    return Terrain.from_raster(name, **way)


def parse_point(text: str, option: str) -> tuple[float, float]:
    """A place `x,y`, m.

    Raises:
        RockerbogieError: not two finite numbers.
    """
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise RockerbogieError(f"{option} {text!r} is not a place: give x,y in metres, as in 1.5,-2") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise RockerbogieError(f"{option} {text!r} is not finite: give x,y in metres, as in 1.5,-2")
    return x, y


def middle(terrain: Terrain) -> tuple[float, float]:
    """The middle of the map, m."""
    xmin, ymin, xmax, ymax = terrain.bounds
    return (xmin + xmax) / 2, (ymin + ymax) / 2


def map_span(terrain: Terrain) -> str:
    """Where the map lies, in words."""
    xmin, ymin, xmax, ymax = terrain.bounds
    return f"the map spans ({xmin:.10g}, {ymin:.10g}) to ({xmax:.10g}, {ymax:.10g}) m"


def make_folder(folder: Path) -> Path:
    """The folder to write to, made if it is not there.

    Raises:
        RockerbogieError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RockerbogieError(f"cannot make the folder {str(folder)!r}: {error.strerror}") from None
    return folder


@contextmanager
def progress() -> Iterator[Progress]:
    """A progress bar on stderr, silent where stderr is no terminal. `task = p.add_task("settling", total=n)`."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        yield bar


def print_json(value: Any) -> None:
    """Print JSON on stdout; nan becomes null, for JSON has no nan."""
    print(json.dumps(_plain(value), indent=2, allow_nan=False, ensure_ascii=False), file=sys.stdout)


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
