"""Rovers in files: presets by name, TOML, and the robot formats URDF, SDF, MJCF and USD."""

from __future__ import annotations

from .import_build import LABELS, Import, ImportResult, build_rover
from .load import import_rover, load_rover, presets, read_details, read_trees
from .sdf_write import differential_system, to_sdf
from .toml_write import schema, to_toml
from .urdf_write import to_urdf
from .usd_write import to_usd

__all__ = [
    "LABELS",
    "Import",
    "ImportResult",
    "build_rover",
    "differential_system",
    "import_rover",
    "load_rover",
    "presets",
    "read_details",
    "read_trees",
    "schema",
    "to_sdf",
    "to_toml",
    "to_urdf",
    "to_usd",
]
