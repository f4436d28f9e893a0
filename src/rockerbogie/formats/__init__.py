"""Rovers in and out of files: presets by name, TOML of our own, and the robot formats."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from ..errors import RoverError, unknown_name
from ..rover import Rover
from .toml import read_toml

__all__ = ["load_rover", "presets"]


def presets() -> dict[str, Path]:
    """The rovers that come with the package: name to the folder that holds its `rover.toml` and `README.md`."""
    root = Path(str(files("rockerbogie").joinpath("rovers")))
    return {folder.name: folder for folder in sorted(root.iterdir()) if (folder / "rover.toml").is_file()}


def load_rover(name_or_path: str | Path) -> Rover:
    """A rover by the name of a preset, or from a file (`.toml`).

    Raises:
        RoverError: no such preset or file, or a file that does not describe a rover that can be.
    """
    known = presets()
    text = str(name_or_path)
    if text in known:
        path = known[text] / "rover.toml"
    else:
        path = Path(name_or_path)
        if not path.suffix and len(path.parts) == 1:
            raise RoverError(unknown_name("rover", text, known) + " Or give the path of a .toml file.")
    return read_toml(_read(path), name=path.parent.name if text in known else path.stem)


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        reason = (
            "it is not UTF-8 text" if isinstance(error, UnicodeDecodeError) else getattr(error, "strerror", None) or str(error)
        )
        raise RoverError(f"cannot read rover file {str(path)!r}: {reason}") from None
