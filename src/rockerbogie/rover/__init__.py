"""Rovers: the mechanism, its checks, its frames, and its file formats."""

from __future__ import annotations

from .model import IDEAL_DIFFERENTIAL, Link, Rover

__all__ = ["IDEAL_DIFFERENTIAL", "Link", "Rover"]
