"""Rovers and terrain from presets, built-in surfaces and uploaded files."""

from __future__ import annotations

import re
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from ..errors import RockerbogieError, RoverError, TerrainError
from ..rover.formats.import_build import build_rover
from ..rover.formats.load import load_rover, presets, read_trees
from ..rover.formats.toml_read import read_toml
from ..rover.model import Rover
from ..terrain import surfaces
from ..terrain.heightfield import Terrain
from ..terrain.raster import open_raster
from ..terrain.surface_names import build_surface

#: Largest file that a visitor may send, bytes.
MOST_BYTES = 64 * 1024 * 1024
#: Most nodes of a terrain that a visitor may load or generate.
MOST_NODES = 6_000_000
ROVER_ENDINGS = (".toml", ".urdf", ".sdf", ".xml")
TERRAIN_ENDINGS = (".tif", ".tiff")
#: First bytes of TIFF and BigTIFF files. GDAL reads other contents too, among them files that refer to files of this machine.
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def rover_names() -> list[str]:
    """Return the names of the built-in rovers.

    Returns:
        Names, sorted.
    """
    return list(presets())


def surface_names() -> list[str]:
    """Return the names of the built-in surfaces.

    Returns:
        Names in the order of the package.
    """
    return list(surfaces.__all__)


def preset_rover(name: str) -> tuple[Rover, list[str]]:
    """Load a built-in rover.

    Args:
        name: of the preset.

    Returns:
        The rover and an empty list of notes.

    Raises:
        RoverError: no such preset.
    """
    if name not in presets():
        raise RoverError(f"no rover named {name!r}")
    return load_rover(name), []


def uploaded_rover(file_name: str, content: bytes) -> tuple[Rover, list[str]]:
    """Read a rover from the contents of a file; meshes that it refers to are not read.

    Args:
        file_name: ends in .toml, .urdf, .sdf or .xml.
        content: the file's contents.

    Returns:
        The rover and notes on what was guessed, repaired or dropped.

    Raises:
        RoverError: another ending, a file that is too large, or no possible rover.
    """
    name = plain_name(file_name)
    ending = PurePosixPath(name).suffix.lower()
    if ending not in ROVER_ENDINGS:
        raise RoverError(f"{name}: its ending is not one of {', '.join(ROVER_ENDINGS)}, so it is not read as a rover")
    if len(content) > MOST_BYTES:
        raise RoverError(f"{name}: {len(content) / 1e6:.0f} MB are more than the limit of {MOST_BYTES / 1e6:.0f} MB")
    if ending == ".toml":
        try:
            text = content.decode()
        except UnicodeDecodeError:
            raise RoverError(f"{name}: it is not UTF-8 text") from None
        return read_toml(text, name=PurePosixPath(name).stem), []
    result = build_rover(read_trees(content, name), name)
    return result.rover, [*result.guessed, *result.repaired, *result.dropped, *result.warnings]


def uploaded_terrain(file_name: str, content: bytes) -> tuple[Terrain, list[str]]:
    """Read a terrain from the contents of a GeoTIFF.

    The contents are written to a temporary folder that is removed before the function returns.

    Args:
        file_name: ends in .tif or .tiff.
        content: the file's contents.

    Returns:
        The terrain and notes on missing data, steps and projection.

    Raises:
        TerrainError: another format, a file or grid that is too large, or no height field.
    """
    name = plain_name(file_name)
    if PurePosixPath(name).suffix.lower() not in TERRAIN_ENDINGS or content[:4] not in _TIFF:
        raise TerrainError(f"{name}: it is not a GeoTIFF; convert it with gdal_translate {name} dem.tif")
    if len(content) > MOST_BYTES:
        raise TerrainError(f"{name}: {len(content) / 1e6:.0f} MB are more than the limit of {MOST_BYTES / 1e6:.0f} MB")
    with tempfile.TemporaryDirectory(prefix="rockerbogie-lab-") as folder, _notes() as notes:
        file = Path(folder) / name
        file.write_bytes(content)
        rows, cols = open_raster(file).shape
        if rows * cols > MOST_NODES:
            raise TerrainError(
                f"{name}: {cols} × {rows} nodes are more than the limit of {MOST_NODES:,}; crop it with gdal_translate -projwin"
            )
        terrain = Terrain.from_raster(file)
    return terrain, notes


def surface(text: str) -> Terrain:
    """Build a built-in surface.

    Args:
        text: NAME or NAME?parameter=value&…, as after `surface:` on the command line.

    Returns:
        The terrain.

    Raises:
        TerrainError: unknown name or parameter, a wrong value, or too many nodes.
    """
    name, _, query = text.partition("?")
    values = dict(pair.partition("=")[::2] for pair in query.split("&") if pair)
    try:
        sides = [float(part) for part in values.get("size", "").split(",") if part]
        spacing = float(values.get("spacing", "nan"))
    except ValueError:
        sides, spacing = [], float("nan")
    if sides and spacing > 0 and max(sides) ** 2 / spacing**2 > MOST_NODES and len(sides) == 1:
        raise TerrainError(
            f"surface:{name} of {sides[0]:g} m with nodes every {spacing:g} m has more than {MOST_NODES:,} nodes: "
            "give a smaller size or a larger spacing"
        )
    return build_surface(text, None)


def plain_name(file_name: str) -> str:
    """Return a file name without folders and special characters.

    Args:
        file_name: as the browser sends it.

    Returns:
        At most 80 letters, digits, dots, dashes and underscores.
    """
    last = file_name.replace("\\", "/").rsplit("/", 1)[-1]
    clean = re.sub(r"[^\w.\-]+", "_", last, flags=re.ASCII).lstrip(".")
    return clean[-80:] or "file"


def without_paths(message: str) -> str:
    """Return a message in which paths of this machine are shortened to file names.

    Args:
        message: text of an error or a warning.

    Returns:
        The text on one line.
    """
    return re.sub(r"(?<![\w.])(?:/[\w.\-+ ]+)+/([\w.\-+]+)", r"\1", " ".join(message.split()))


@contextmanager
def _notes() -> Iterator[list[str]]:
    """Collect warnings as texts instead of showing them."""
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield notes
    notes += [without_paths(str(one.message)) for one in caught]


def message_of(error: Exception) -> str:
    """Return the text that a visitor sees for an error.

    Args:
        error: raised by a reader or a computation.

    Returns:
        The sentence of a `RockerbogieError` without paths; a general sentence for other errors.
    """
    if isinstance(error, RockerbogieError):
        return without_paths(str(error))
    return f"unexpected {type(error).__name__}; details are in the terminal of the server"
