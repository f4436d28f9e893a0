"""Figures of poses, runs, maps and rovers; `scene/` holds meshes without matplotlib."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import plot as plot


def __getattr__(name: str) -> Any:
    """Return the module of public drawing functions, loaded at first use."""
    if name != "plot":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return import_module(".plot", __name__)
