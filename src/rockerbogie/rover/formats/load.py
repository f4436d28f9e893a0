"""Rovers in and out of files: presets by name, TOML of our own, and the robot formats."""

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
from .mjcf import read_mjcf
from .safe_xml import MAX_BYTES, parse_xml
from .sdf import read_sdf
from .toml_read import read_toml
from .tree import Tree
from .urdf import read_urdf

__all__ = ["import_rover", "load_rover", "presets", "read_details", "read_tree"]


def presets() -> dict[str, Path]:
    """The rovers that come with the package: name to the folder that holds its `rover.toml` and `README.md`."""
    root = Path(str(files("rockerbogie.rover").joinpath("presets")))
    return {folder.name: folder for folder in sorted(root.iterdir()) if (folder / "rover.toml").is_file()}


def read_details(name_or_path: str | Path) -> dict[str, str]:
    """What a TOML rover's file says of it in words: its `title` and `grade`; nothing for other files."""
    path = presets().get(str(name_or_path), Path(name_or_path))
    path = path / "rover.toml" if path.is_dir() else path
    if path.suffix.lower() != ".toml":
        return {}
    tree = tomllib.loads(_decoded(_read(path), path.name))
    return {key: tree[key] for key in ("title", "grade") if isinstance(tree.get(key), str)}


def load_rover(name_or_path: str | Path) -> Rover:
    """A rover by the name of a preset, or from a file: `.toml`, or a robot description (`.urdf`, `.sdf`, `.xml` MJCF).

    Where a robot description had to be guessed at or mended, a warning says so; `import_rover` tells what, and lets you
    overrule it.

    Raises:
        RoverError: no such preset or file, or a file that does not describe a rover that can be.
    """
    known = presets()
    if not isinstance(name_or_path, str | os.PathLike):
        raise RoverError(f"{name_or_path!r:.60} names no rover: give a preset ({', '.join(sorted(known))}) or the path of a file")
    text = str(name_or_path)
    if text in known:
        return read_toml(_read(known[text] / "rover.toml").decode(), name=text)
    path = Path(name_or_path)
    if not path.suffix and len(path.parts) == 1 and not path.exists():
        raise RoverError(f"{unknown_name('rover', text, known)} Or give the path of a .toml, .urdf, .sdf or MJCF .xml file.")
    if path.suffix.lower() == ".toml":
        return read_toml(_decoded(_read(path), path.name), name=path.stem)
    result = import_rover(path)
    if result.guessed or result.repaired:
        warnings.warn(
            f"{path.name}: {len(result.guessed)} things guessed, {len(result.repaired)} mended; import_rover says which",
            stacklevel=2,
        )
    return result.rover


def import_rover(
    path: str | Path,
    *,
    scale: float = 1.0,
    forward: str | None = None,
    up: str | None = None,
    joints: dict[str, Sequence[str]] | None = None,
    **overrule: Any,
) -> ImportResult:
    """A rover from a robot description, found by structure: which hinge carries what, not how it is called.

    Args:
        path: a URDF (expanded, if from xacro), SDF or MJCF file.
        scale: metres in the file's unit of length: 0.001 for millimetres.
        forward, up: the rover's directions as axes of the file's root frame ("x", "-y", ...), where they are taken wrong.
        joints: names of the joints that are "wheels" (6), "bogies" (2) or "rockers" (2; fixed ones may be named), or all
            that steer ("steering"), where the search goes wrong.
        overrule: any argument of `Rover.from_pivots`, in metres and radians in the rover's own frame, to be used in
            place of what the file says.

    Returns:
        The rover, with what was found, guessed and mended, line by line.

    Raises:
        RoverError: a file that is refused, holds no rocker-bogie, or describes one that cannot be.
    """
    file = Path(path)
    return build_rover(
        read_tree(_read(file), file.name), file.name, scale=scale, forward=forward, up=up, joints=joints, **overrule
    )


def read_tree(data: bytes | str, what: str) -> Tree:
    """The kinematic tree of a robot description, by its root element."""
    readers = {"robot": read_urdf, "sdf": read_sdf, "mujoco": read_mjcf}
    root = parse_xml(data, what).tag
    if root not in readers:
        raise RoverError(
            f"{what}: its root element is <{root[:40]}>; URDF begins with <robot>, SDF with <sdf>, MJCF with <mujoco>"
        )
    return readers[root](data, what)


def _read(path: Path) -> bytes:
    try:
        size = path.stat().st_size / 1e6
        if size > MAX_BYTES / 1e6:
            raise RoverError(f"{path.name}: {size:.0f} MB; a rover takes well under one, the limit is {MAX_BYTES / 1e6:.0f} MB")
        return path.read_bytes()
    except OSError as error:
        raise RoverError(f"cannot read rover file {str(path)!r}: {error.strerror or error}") from None


def _decoded(data: bytes, what: str) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise RoverError(f"{what}: it is not UTF-8 text") from None
