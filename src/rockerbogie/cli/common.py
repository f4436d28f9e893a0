"""Shared parts of the commands: options, positions, output guards, progress, JSON."""

from __future__ import annotations

import json
import math
import re
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter, Token
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from ..errors import RockerbogieError
from ..files.outputs import check_outputs, remove_sidecars
from ..files.version import __version__

if TYPE_CHECKING:
    import xarray as xr

    from ..terrain.heightfield import Terrain

#: `--terrain surface:NAME` is a built-in surface at its usual size; `surface:NAME?size=20&seed=3` one with other parameters.
SURFACE = "surface:"
#: Inputs that are text, and the names of files in them.
_TEXTS = frozenset({".toml", ".urdf", ".sdf", ".xml", ".csv", ".json"})
_INCLUDED = re.compile(r'\bfile(?:name)?="(?:file://)?([^"]+)"')

TerrainName = Annotated[str, Parameter(name=["--terrain", "-t"])]
RoverName = Annotated[str, Parameter(name=["--rover", "-r"])]
Folder = Annotated[Path | None, Parameter(name=["--output", "-o"])]
Linear = Annotated[bool | None, Parameter(name="--linear", negative="--cubic")]
Json = Annotated[bool, Parameter(name="--json", negative="")]
Force = Annotated[bool, Parameter(name="--force", negative="")]


def _whole_number(_kind: object, tokens: Sequence[Token]) -> int:
    """Return an option's text as a whole number; cyclopts alone rounds 1.5 to 2."""
    try:
        return int(tokens[0].value)
    except ValueError:
        raise ValueError(f"{tokens[0].value!r} is not a whole number") from None


Whole = Annotated[int, Parameter(converter=_whole_number)]


def parse_point(text: str, option: str) -> tuple[float, float]:
    """Return the position `x,y` of an option, m.

    Args:
        text: "x,y".
        option: name of the option, for the error.

    Returns:
        x and y, m.

    Raises:
        RockerbogieError: not two finite numbers.
    """
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise RockerbogieError(f"{option} {text!r} is not a position: give x,y in metres, as in 1.5,-2") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise RockerbogieError(f"{option} {text!r} is not finite: give x,y in metres, as in 1.5,-2")
    return x, y


def middle(terrain: Terrain) -> tuple[float, float]:
    """Return the centre of the map.

    Args:
        terrain: the terrain.

    Returns:
        x and y, m.
    """
    xmin, ymin, xmax, ymax = terrain.bounds
    return (xmin + xmax) / 2, (ymin + ymax) / 2


def map_span(terrain: Terrain) -> str:
    """Return the extent of the map as text.

    Args:
        terrain: the terrain.

    Returns:
        A clause with its corners, m.
    """
    xmin, ymin, xmax, ymax = terrain.bounds
    return f"the map spans ({xmin:.10g}, {ymin:.10g}) to ({xmax:.10g}, {ymax:.10g}) m"


def make_folder(folder: Path) -> Path:
    """Make a folder if it does not exist, and return it.

    Args:
        folder: the folder.

    Returns:
        The folder.

    Raises:
        RockerbogieError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RockerbogieError(f"cannot make the folder {str(folder)!r}: {error.strerror}") from None
    return folder


def in_folder(folder: Path | None, *names: str) -> list[Path]:
    """Return the files of these names in a folder; no files if there is no folder.

    Args:
        folder: the folder, or None.
        names: file names.

    Returns:
        Paths of the files; an empty list without a folder.
    """
    return [] if folder is None else [folder / name for name in names]


def guard_outputs(outputs: Iterable[Path], *inputs: str | Path | None, force: bool = False) -> None:
    """Check before any work that outputs replace no input and no file of another program.

    Args:
        outputs: every file that the command will write.
        inputs: files and folders that it reads, by the names given on the command line; `surface:NAME`, names of presets and
            None are skipped.
        force: allow files of other programs to be replaced.

    Raises:
        RockerbogieError: as `rockerbogie.files.outputs.check_outputs`.
    """
    check_outputs(outputs, [file for name in inputs if name is not None for file in _files_of(str(name))], force=force)


def _files_of(name: str) -> list[Path]:
    """Return the files behind an input: itself, a raster's sources, a robot file's includes."""
    if name.startswith(SURFACE):
        return []
    path = Path(name)
    files = [path] if path.is_file() or _is_data_folder(path) else []
    if path.suffix.lower() in _TEXTS:
        with suppress(OSError):
            text = path.read_text(encoding="utf-8", errors="replace")
            files += [path.parent / found for found in _INCLUDED.findall(text) if (path.parent / found).exists()]
        return files
    if path.is_file() or ":" in name or name.startswith("/vsi"):
        with suppress(Exception):  # no rasterio, or not a raster: the command itself reports the error
            import rasterio

            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                with rasterio.open(name) as raster:
                    files += [Path(file) for file in raster.files]
    return files


def _is_data_folder(path: Path) -> bool:
    """Return True for a Zarr group or a ROS bag; another folder only shares a preset's name."""
    if not path.is_dir():
        return False
    names = [item.name for item in path.iterdir()]
    return any(name in ("zarr.json", ".zgroup", "metadata.yaml") or name.endswith((".mcap", ".db3")) for name in names)


def save_netcdf(dataset: xr.Dataset, file: Path) -> None:
    """Write a Dataset as NetCDF, with the version of this package among its attributes.

    Args:
        dataset: data to write.
        file: ends in .nc; replaced if it exists.
    """
    dataset.assign_attrs(rockerbogie_version=__version__).to_netcdf(file, engine="h5netcdf")
    remove_sidecars(file)


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a progress bar on stderr; show nothing if stderr is not a terminal.

    Returns:
        The bar, as a context: `task = bar.add_task("settling", total=n)`.
    """
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeRemainingColumn())
    with Progress(*columns, console=console, disable=not console.is_terminal, transient=True) as bar:
        yield bar


def print_json(value: Any) -> None:
    """Print JSON on stdout. NaN and infinity become null, as JSON has neither.

    Args:
        value: numbers, text, arrays, paths, lists and dicts of them.
    """
    print(json.dumps(_plain(value), indent=2, allow_nan=False, ensure_ascii=False), file=sys.stdout)


def _plain(value: Any) -> Any:
    """Return a value as types that JSON has."""
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


def parse_gravity(text: str) -> float:
    """Return gravity, m/s².

    Args:
        text: earth, mars, moon or a number.

    Returns:
        From 0.001 to 100, m/s².

    Raises:
        RockerbogieError: another name, or a number outside that range.
    """
    from ..gravity import GRAVITY, check_gravity

    try:
        value = GRAVITY[text] if text in GRAVITY else float(text)
    except ValueError:
        raise RockerbogieError(f"--gravity {text!r} is not known; give {', '.join(GRAVITY)} or a number in m/s²") from None
    return check_gravity(value)
