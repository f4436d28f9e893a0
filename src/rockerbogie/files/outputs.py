"""Guards for output files: inputs and files of other programs are never overwritten."""

from __future__ import annotations

import json
import mmap
import os
import re
import tempfile
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

from ..errors import RockerbogieError
from .version import __version__

#: Text in every file of this package: in its metadata, in a comment or in an attribute.
SOURCE = f"rockerbogie {__version__}"
_MARK = re.compile(rb"rockerbogie(_version| \d)")
#: First columns of the CSV tables that this package writes: a CSV file cannot hold a mark.
_TABLES = (
    "time [s],distance [m],x [m],y [m],",
    "x [m],y [m],yaw [rad],distance [m],cost [m],tilt [rad]",
    "place,x [m],y [m],yaw [deg],status,",
    "case,channel,logged [deg],",
    "time [s],distance [m],known slip,mean slip,",
    "soil,slope [deg],heading [deg],",
)
#: Files that users edit after they were written: they are not replaced without `force`.
_EDITED = frozenset({".toml", ".urdf", ".sdf", ".xml", ".obj", ".md", ".py", ".usd", ".usda"})
#: Files beside a raster that GDAL reads along with it, by the ending they add to its name.
_SIDECARS = (".aux.xml", ".ovr", ".msk")
#: Entries that GDAL copies from the raster into an .aux.xml, along with statistics.
_COPIED = frozenset({"Histograms", "Description", "UnitType", "ColorInterp"})
_RASTERS = frozenset({".tif", ".tiff", ".png", ".nc"})


def check_outputs(
    outputs: Iterable[str | Path],
    inputs: Iterable[str | Path] = (),
    *,
    force: bool = False,
    remedy: str = "give another output name, or --force (force=True) to replace it",
) -> None:
    """Check that writing `outputs` replaces no input and no file of another program.

    Links, relative paths and names that differ only in case are resolved. Existing files that this package wrote may be
    replaced. Folders that do not exist yet are not made here; that they can be made and written is checked.

    Args:
        outputs: every file (or .zarr folder) that is about to be written.
        inputs: every file or folder that is read.
        force: allow files of other programs to be replaced; inputs and folders never are.
        remedy: end of the message for a file of another program.

    Raises:
        RockerbogieError: an output is an input, lies in an input folder, is a folder, is named twice, was not written by
            this package (without `force`), or cannot be written.
    """
    read = [path for name in inputs for path in _files_of(os.fspath(name))]
    seen: set[str] = set()
    for path in map(Path, outputs):
        _check_not_input(path, read)
        key = _key(path)
        if key in seen:
            raise RockerbogieError(f"{str(path)!r} would be written twice: give the outputs different names")
        seen.add(key)
        if path.is_dir() and path.suffix.lower() != ".zarr":
            raise RockerbogieError(f"{str(path)!r} is a folder: give the name of a file")
        if path.is_dir() and not (path / "zarr.json").exists() and not (path / ".zgroup").exists():
            raise RockerbogieError(f"{str(path)!r} is a folder but not a Zarr group: give another name")
        for file in [path, *(side for side in sidecars(path) if not _is_statistics(side))]:
            if os.path.lexists(file) and not force and not is_ours(file):
                raise RockerbogieError(f"{str(file)!r} exists and {_why(file)}: {remedy}")
        _check_writable(path)


def _files_of(name: str) -> list[Path]:
    """Return the existing file of an input: itself, or the one in GDAL's name (netcdf:f.nc:z)."""
    if os.path.lexists(name):
        return [Path(name)]
    parts = [re.sub(r"^(/vsi[a-z0-9]+/)+", "", part) for part in re.split(r"[:\"]", name)]
    found = [next((p for p in (Path(part), *Path(part).parents) if p.is_file()), None) for part in parts if part]
    return [path for path in found if path is not None]


def sidecars(path: Path) -> list[Path]:
    """Return the existing sidecars of a raster: statistics, overviews, a mask.

    Args:
        path: the raster.

    Returns:
        Paths of the files beside it.
    """
    if path.suffix.lower() not in _RASTERS:
        return []
    return [side for side in (path.with_name(path.name + ending) for ending in _SIDECARS) if side.is_file()]


def remove_sidecars(path: Path) -> None:
    """Remove the sidecars of a raster that was replaced: they describe the old one.

    Args:
        path: the raster.
    """
    for side in sidecars(path):
        side.unlink(missing_ok=True)


def is_ours(path: Path) -> bool:
    """Return True if this package wrote a file (or Zarr group) that people do not edit.

    Args:
        path: a file or folder.

    Returns:
        True if it has the mark of this package.
    """
    suffix = path.suffix.lower()
    if path.is_dir():
        return _is_our_zarr(path)
    if suffix in _EDITED or not path.is_file():
        return False
    try:
        with open(path, "rb") as stream:
            if suffix == ".csv":
                return stream.readline(4096).decode("utf-8", "replace").startswith(_TABLES)
            if os.fstat(stream.fileno()).st_size == 0:
                return False
            with mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as content:
                return _MARK.search(content) is not None
    except OSError:
        return False


def _is_our_zarr(path: Path) -> bool:
    """Return True for a Zarr group with our attribute and nothing but arrays in it."""
    try:
        about = json.loads((path / "zarr.json").read_text(encoding="utf-8"))
        others = [item for item in path.iterdir() if item.name != "zarr.json" and not (item / "zarr.json").is_file()]
    except (OSError, ValueError):
        return False
    return "rockerbogie_version" in about.get("attributes", {}) and not others


def _is_statistics(path: Path) -> bool:
    """Return True for an .aux.xml with statistics only: GDAL computes them again."""
    if not path.name.endswith(".aux.xml"):
        return False
    try:
        root = ElementTree.parse(path).getroot()
    except (OSError, ElementTree.ParseError):
        return False
    for band in root:
        if band.tag != "PAMRasterBand":
            return False
        for part in band:
            keys = [str(item.get("key")) for item in part] if part.tag == "Metadata" and not part.get("domain") else None
            if part.tag not in _COPIED and (keys is None or not all(key.startswith("STATISTICS_") for key in keys)):
                return False
    return True


def _why(path: Path) -> str:
    """Return the reason for which an existing file is not replaced."""
    if path.suffix.lower() in _EDITED and not path.name.endswith(".aux.xml"):
        return "may have been edited"
    return "was not written by rockerbogie"


def _key(path: Path) -> str:
    """Return a name that is equal for two spellings of one file, whatever the case."""
    return os.path.realpath(path).casefold()


def _check_not_input(path: Path, read: list[Path]) -> None:
    """Raise if an output is an input or lies in an input folder."""
    key = _key(path)
    for file in read:
        same = path.exists() and file.exists() and os.path.samefile(path, file)
        if same or key == _key(file):
            raise RockerbogieError(f"the output {str(path)!r} is the input {str(file)!r}: give another output name")
        if file.is_dir() and key.startswith(_key(file) + os.sep):
            raise RockerbogieError(f"the output {str(path)!r} lies in the input folder {str(file)!r}: give another folder")


def _check_writable(path: Path) -> None:
    """Raise if a file cannot be made in its folder, or in the nearest folder that exists."""
    if path.is_file() and not os.access(path, os.W_OK):
        raise RockerbogieError(f"cannot write {str(path)!r}: it is read-only")
    folder = Path(os.path.realpath(path)).parent
    while not os.path.lexists(folder) and folder != folder.parent:
        folder = folder.parent
    if not folder.is_dir():
        raise RockerbogieError(f"cannot write {str(path)!r}: {str(folder)!r} is not a folder")
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise RockerbogieError(f"cannot write {str(path)!r}: {error.strerror or error}") from None
