"""Common style of all pictures: colours for the colour-blind, and thin axes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from ..files.outputs import SOURCE, remove_sidecars
from .theme import Theme, darken

# Palette of Okabe and Ito; left is always blue, right always vermilion.
LEFT, RIGHT = "#0072B2", "#D55E00"
COLOURS = {
    "roll": "#009E73",
    "pitch": "#CC79A7",
    "tilt": "#222222",
    "rocker": "#555555",
    "bogie_left": LEFT,
    "bogie_right": RIGHT,
    "z": "#444444",
}
INK = "#222222"
ALARM = "#b00000"  # what fails
FORCE = "#009E73"  # arrows of forces
DPI = 150

_LOOK: dict[str, Any] = {
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.edgecolor": "#888888",
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "grid.linewidth": 0.8,
    "lines.linewidth": 1.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
}


def look() -> Any:
    """Return the context in which a figure is made; global settings stay unchanged outside.

    Returns:
        A context manager.
    """
    return rc_context(_LOOK)  # type: ignore[arg-type]


def save(made: Figure, file: str | Path, dpi: float | None = None, theme: Theme = "light") -> Path:
    """Write a figure as .png, .svg or .pdf; the same figure gives the same bytes.

    Args:
        made: the figure.
        file: the picture to write.
        dpi: pixels per inch of a .png; None for the figure's own.
        theme: light or dark page.

    Returns:
        The file.
    """
    if theme == "dark":
        darken(made)
    path = Path(file)
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    key = "Software" if path.suffix.lower() == ".png" else "Creator"
    with rc_context({"svg.hashsalt": "rockerbogie"}):
        made.savefig(path, dpi=dpi or "figure", metadata={key: SOURCE, **dates.get(path.suffix.lower(), {})})
    remove_sidecars(path)
    return path


def figure(width: float, height: float) -> Figure:
    """Return an empty figure; call it inside `look()`.

    Args:
        width: inches.
        height: inches.

    Returns:
        The figure.
    """
    return Figure(figsize=(width, height), dpi=DPI, facecolor="white")
