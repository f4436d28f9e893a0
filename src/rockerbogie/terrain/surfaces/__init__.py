"""Named surfaces: the paper's, simple shapes, synthetic Mars; lengths in m, angles in rad.

Every surface is a `Terrain`. Unless stated otherwise a map has the side `size` (one number, or x and y) and (0, 0) at its
centre. `spacing` is the distance of its nodes, `interpolation` as in `Terrain.from_array`. Shapes with a `direction` are
constant across it and vary along s = x cos(direction) + y sin(direction). Random surfaces depend on `seed` only: the same
arguments give the same terrain.

A face is never steeper than its height over one cell. A cubic surface oscillates on both sides of a sharp edge, by a
factor of 0.27 less per cell. So surfaces with edges are "linear" by default, and smooth ones "cubic".
"""

from __future__ import annotations

from .mars import fractal, mars, rocks
from .shapes import ditch, paper, plane, ramp, rough, sine, step

__all__ = ["ditch", "fractal", "mars", "paper", "plane", "ramp", "rocks", "rough", "sine", "step"]
