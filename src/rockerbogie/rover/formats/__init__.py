"""Rovers in files: presets by name, TOML, and the robot formats URDF, SDF and MJCF."""

from __future__ import annotations

from .import_build import LABELS, Import, ImportResult, build_rover
from .load import import_rover, load_rover, presets, read_details, read_trees
from .sdf_write import to_sdf
from .toml_write import schema, to_toml
from .urdf_write import to_urdf

__all__ = [
    "LABELS",
    "Import",
    "ImportResult",
    "build_rover",
    "import_rover",
    "load_rover",
    "presets",
    "read_details",
    "read_trees",
    "schema",
    "to_sdf",
    "to_toml",
    "to_urdf",
]
