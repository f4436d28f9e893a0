"""Rovers by preset name, from TOML files, and from robot files."""

from __future__ import annotations

import os
import tomllib
import warnings
from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from ...errors import RoverError, unknown_name
from ..model import Rover
from .import_build import ImportResult, build_rover
from .meshes import MeshFolder
from .mjcf_read import read_mjcf
from .safe_xml import MAX_BYTES, parse_xml
from .sdf_read import read_sdf
from .toml_read import read_toml
from .tree import Tree
from .urdf_read import read_urdf

__all__ = ["import_rover", "load_rover", "presets", "read_details", "read_trees"]

READERS = {"robot": read_urdf, "sdf": read_sdf, "mujoco": read_mjcf}
#: The first bytes of files that hold robots and are not XML, and what they are.
NOT_XML = {b"PXR-USDC": "USD", b"#usda": "USD", b"PK\x03\x04": "a zip archive (USDZ?)"}
USD = (".usd", ".usda", ".usdc", ".usdz")


def presets() -> dict[str, Path]:
    """Return the folders of the package's rovers by name.

    Each holds `rover.toml` and `README.md`.

    Returns:
        Folders by name.
    """
    root = Path(str(files("rockerbogie.rover").joinpath("presets")))
    return {folder.name: folder for folder in sorted(root.iterdir()) if (folder / "rover.toml").is_file()}


def read_details(name_or_path: str | Path) -> dict[str, str]:
    """Return the `title` and `grade` in a rover's TOML file; nothing for other files.

    Args:
        name_or_path: a preset's name or a file.

    Returns:
        Texts by key.
    """
    path = presets().get(str(name_or_path), Path(name_or_path))
    path = path / "rover.toml" if path.is_dir() else path
    if path.suffix.lower() != ".toml":
        return {}
    tree = tomllib.loads(_decoded(_read(path), path.name))
    return {key: tree[key] for key in ("title", "grade") if isinstance(tree.get(key), str)}


def load_rover(name_or_path: str | Path) -> Rover:
    """Return a rover by the name of a preset, or from a file.

    Files are `.toml`, `.urdf`, `.sdf` or `.xml` (MJCF).

    If anything in a robot file was guessed or repaired, or looks wrong, a warning lists it, with what was dropped;
    `import_rover` returns the whole report and takes corrections.

    Args:
        name_or_path: a preset's name or a file.

    Returns:
        The rover.

    Raises:
        RoverError: no such preset or file, or a file that does not describe a possible rover.
    """
    known = presets()
    if not isinstance(name_or_path, str | os.PathLike):
        raise RoverError(f"{name_or_path!r:.60} names no rover: give a preset ({', '.join(sorted(known))}) or the path of a file")
    text = str(name_or_path)
    if text in known:
        return read_toml(_read(known[text] / "rover.toml").decode(), name=text)
    path = Path(name_or_path)
    if not path.suffix and len(path.parts) <= 1 and not path.is_file():
        raise RoverError(f"{unknown_name('rover', text, known)} Or give the path of a .toml, .urdf, .sdf or MJCF .xml file.")
    if path.suffix.lower() == ".toml":
        return read_toml(_decoded(_read(path), path.name), name=path.stem)
    result = import_rover(path)
    counts = {label: getattr(result, label) for label in ("guessed", "repaired", "dropped", "warnings")}
    if result.guessed or result.repaired or result.warnings:
        numbers = ", ".join(f"{len(lines)} {label}" for label, lines in counts.items() if lines)
        lines = [f"  {label.removesuffix('s')}: {line}" for label in counts for line in counts[label]]
        warnings.warn("\n".join([f"{path.name}: {numbers}", *lines]), stacklevel=2)
    return result.rover


def import_rover(
    path: str | Path,
    *,
    scale: float = 1.0,
    forward: str | None = None,
    up: str | None = None,
    joints: dict[str, Sequence[str]] | None = None,
    **override: Any,
) -> ImportResult:
    """Return a rover from a robot file, with a report.

    It is found by structure (which hinge stays what), not by names.

    The rover's frame has its origin at the origin of the body's link. Meshes are read from files beside the robot file.

    Args:
        path: a URDF (expanded, if from xacro), SDF or MJCF file.
        scale: metres in the file's unit of length: 0.001 for millimetres.
        forward, up: the rover's directions as axes of the file's root frame ("x", "-y", ...), if they are found wrong.
        joints: names of the joints that are "wheels" (6), "bogies" (2) or "rockers" (2), or all that steer ("steering"), if the
            search goes wrong. Fixed joints may be named.
        override: any argument of `Rover.from_pivots`, in metres and radians in the rover's own frame, to be used in
            place of the file's.

    Returns:
        The rover, with the report of what was found, guessed, repaired and dropped, and warnings.

    Raises:
        RoverError: a file that is refused, holds no rocker-bogie, or describes an impossible one.
    """
    file = Path(path)
    trees = read_trees(_read(file), file.name, MeshFolder(file.parent))
    return build_rover(trees, file.name, scale=scale, forward=forward, up=up, joints=joints, **override)


def read_trees(data: bytes | str, what: str, meshes: MeshFolder | None = None) -> list[Tree]:
    """Return the connected trees of a robot file's text, the largest first.

    The root element tells the format.

    Args:
        data: the text.
        what: the file's name, for messages.
        meshes: reader of the mesh files it refers to; None: mesh files are not read.

    Returns:
        The trees.

    Raises:
        RoverError: refused XML, another format, or a faulty description.
    """
    raw = data if isinstance(data, bytes) else data[:16].encode()
    kind = next((kind for start, kind in NOT_XML.items() if raw.startswith(start)), "USD" if what.lower().endswith(USD) else "")
    if kind:
        raise RoverError(
            f"{what}: it is {kind}, which is not read: export the robot as URDF, SDF or MJCF from the program it is from"
        )
    root = parse_xml(data, what).tag
    if root not in READERS:
        raise RoverError(
            f"{what}: its root element is <{root[:40]}>; URDF begins with <robot>, SDF with <sdf>, MJCF with <mujoco>"
        )
    return READERS[root](data, what, meshes)


def _read(path: Path) -> bytes:
    """Return the bytes of a file.

    Raises:
        RoverError: it cannot be read or is too large.
    """
    try:
        size = path.stat().st_size / 1e6
        if size > MAX_BYTES / 1e6:
            raise RoverError(f"{path.name}: {size:.0f} MB; a rover takes well under one, the limit is {MAX_BYTES / 1e6:.0f} MB")
        return path.read_bytes()
    except OSError as error:
        raise RoverError(f"cannot read rover file {str(path)!r}: {error.strerror or error}") from None


def _decoded(data: bytes, what: str) -> str:
    """Return bytes as text.

    Raises:
        RoverError: not UTF-8.
    """
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise RoverError(f"{what}: it is not UTF-8 text") from None
