"""Terrain: height maps, their files, their roughness, and named surfaces."""

from __future__ import annotations

from . import surfaces
from .heightfield import Terrain
from .window import Interpolation

__all__ = ["Interpolation", "Terrain", "surfaces"]
