"""Forces on a rover in slow motion: contact forces, required friction, tip margins, climbs."""

from __future__ import annotations

from . import obstacles

__all__ = ["obstacles"]
