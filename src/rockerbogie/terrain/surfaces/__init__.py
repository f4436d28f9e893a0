"""Named ground: the paper's, simple shapes for tests and lessons, and made-up Mars. Every size is a keyword; SI, radians.

Every surface is a `Terrain`. Unless it says otherwise a map is `size` metres across (one number, or x and y) with
(0, 0) in its middle; `spacing` is its node distance and `interpolation` what `Terrain.from_array` takes. Shapes with a
`direction` run level across it and change along s = x cos(direction) + y sin(direction). What is drawn at random is
drawn from `seed` alone: the same arguments give the same ground.

A node is the least a grid can say: a face is never steeper than its height over one cell, and a cubic surface swings
to both sides of a kink (by 0.27 a cell, dying off). So what has edges is "linear" here, and what is smooth "cubic".
"""

from __future__ import annotations

from .mars import fractal, mars, rocks
from .shapes import ditch, paper, plane, ramp, rough, sine, step

__all__ = ["ditch", "fractal", "mars", "paper", "plane", "ramp", "rocks", "rough", "sine", "step"]
