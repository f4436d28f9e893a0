"""Dark theme of figures: the same marks in colours for a dark page."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from matplotlib.collections import Collection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.text import Text

from ..errors import RockerbogieError

Theme = Literal["light", "dark"]
THEMES = ("light", "dark")
#: Lightness of the dark page, and of the ink that is black on a light one.
PAGE, INK = 0.09, 0.92
#: Colours whose channels differ by less are greys: they are inverted; others are only lightened.
GREY = 0.13
#: Least luminance of a colour on the dark page.
LEAST = 0.45


def check_theme(theme: str) -> None:
    """Check the name of a theme.

    Args:
        theme: light or dark.

    Raises:
        RockerbogieError: another name.
    """
    if theme not in THEMES:
        raise RockerbogieError(f"theme is {theme!r}: give {' or '.join(THEMES)}")


def darken(figure: Figure) -> None:
    """Change the colours of a figure to those for a dark page; images keep theirs.

    Args:
        figure: the figure, changed in place.
    """
    done: set[int] = set()
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            style = axis.get_tick_params()
            kept = {key: on_dark(style[key]) for key in ("color", "labelcolor", "grid_color") if key in style}
            usual = {"color": on_dark("#555555"), "labelcolor": on_dark("#222222"), "grid_color": on_dark("#e4e4e4")}
            axis.set_tick_params(**(usual | kept))
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):  # painted by their parameters
                done.update(map(id, tick.findobj()))
    for artist in figure.findobj():
        if id(artist) in done:
            continue
        done.add(id(artist))
        _repaint(artist)


def _repaint(artist: Any) -> None:
    """Change the colours of one artist."""
    for effect in artist.get_path_effects() or []:
        graphics = getattr(effect, "_gc", {})
        if "foreground" in graphics:
            graphics["foreground"] = on_dark(graphics["foreground"])
    if isinstance(artist, Text):
        artist.set_color(on_dark(artist.get_color()))
        if (box := artist.get_bbox_patch()) is not None:
            _repaint(box)
    elif isinstance(artist, Line2D):
        artist.set_color(on_dark(artist.get_color()))
        artist.set_markeredgecolor(on_dark(artist.get_markeredgecolor()))
        artist.set_markerfacecolor(on_dark(artist.get_markerfacecolor()))
    elif isinstance(artist, Patch):
        face, edge = on_dark(artist.get_facecolor()), on_dark(artist.get_edgecolor())
        artist.set_facecolor(face)
        artist.set_edgecolor(edge)
    elif isinstance(artist, Collection) and artist.get_array() is None:
        for colours, repaint in ((artist.get_facecolor(), artist.set_facecolor), (artist.get_edgecolor(), artist.set_edgecolor)):
            if len(found := [on_dark(c) for c in np.atleast_2d(colours)]):
                repaint(found)


def on_dark(colour: Any) -> Any:
    """Return the colour that stands for another one on a dark page.

    Args:
        colour: any that matplotlib takes; "none" stays.

    Returns:
        (4,) red, green, blue, alpha: greys inverted, dark colours lightened.
    """
    if isinstance(colour, str) and colour in ("none", "auto"):
        return colour
    red, green, blue, alpha = to_rgba(colour)
    rgb = np.array([red, green, blue])
    if float(np.ptp(rgb)) < GREY:
        level = PAGE + (INK - PAGE) * (1.0 - float(rgb.mean()))
        return (level, level, min(1.0, level + 0.012), alpha)
    light = float(rgb @ (0.2126, 0.7152, 0.0722))
    if light < LEAST:
        rgb = rgb + (1.0 - rgb) * (LEAST - light) / (1.0 - light)
    return (*(float(v) for v in rgb), alpha)
