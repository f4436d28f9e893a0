"""Rovers: the mechanism, its checks, its frames, and the files it is read from and written to."""

from __future__ import annotations

from .model import IDEAL_DIFFERENTIAL, Link, Rover

__all__ = ["IDEAL_DIFFERENTIAL", "Link", "Rover"]
