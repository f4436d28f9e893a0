"""Charts as SVG text: lines over one axis, with a cursor."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Array

#: Colours of Okabe and Ito that colour-blind readers can tell apart; the first two are the colours of left and right.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#B8860B", "#56B4E9")
WIDTH, HEIGHT = 360, 150
LEFT, RIGHT, TOP, BOTTOM = 36, 8, 20, 24
#: Most points of one line; a longer line is drawn by the extremes of its pieces.
MOST_POINTS = 240


class Line(NamedTuple):
    """One line of a chart: name and values (n,)."""

    name: str
    values: Array


def chart(title: str, unit: str, x: ArrayLike, x_label: str, lines: Sequence[Line], cursor: float | None = None) -> str:
    """Draw lines as SVG.

    Args:
        title: of the chart.
        unit: of the values.
        x: (n,) increasing.
        x_label: label with the unit of x.
        lines: values (n,) each; NaN leaves a gap.
        cursor: x of the vertical line, at which the legend shows the values.

    Returns:
        SVG text that fits the width of its container.
    """
    px = np.asarray(x, dtype=float)
    low, high = _range([line.values for line in lines])
    start, end = (float(px[0]), float(px[-1])) if px.size else (0.0, 1.0)
    end = end if end > start else start + 1.0
    wide, tall = WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM

    def at(values: Array, least: float, most: float, size: float) -> Array:
        return size * (values - least) / (most - least)

    parts = [f'<text x="{LEFT}" y="12" font-size="11" font-weight="600">{escape(title)} [{escape(unit)}]</text>']
    for tick in _ticks(low, high, 4):
        y = TOP + tall - float(at(np.asarray(tick), low, high, tall))
        parts.append(f'<line x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" y2="{y:.1f}" stroke="currentColor" opacity=".15"/>')
        parts.append(f'<text x="{LEFT - 4}" y="{y + 3:.1f}" font-size="9" text-anchor="end">{tick:g}</text>')
    for tick in _ticks(start, end, 5):
        tx = LEFT + float(at(np.asarray(tick), start, end, wide))
        parts.append(f'<text x="{tx:.1f}" y="{HEIGHT - 13}" font-size="9" text-anchor="middle">{tick:g}</text>')
    parts.append(f'<text x="{LEFT + wide / 2}" y="{HEIGHT - 3}" font-size="9" text-anchor="middle">{escape(x_label)}</text>')
    for k, line in enumerate(lines):
        cx, cy = _thinned(px, line.values)
        sx, sy = LEFT + at(cx, start, end, wide), TOP + tall - at(cy, low, high, tall)
        path = _path(sx, sy)
        dash = ' stroke-dasharray="4 2"' if k >= 3 else ""
        parts.append(f'<path d="{path}" fill="none" stroke="{COLOURS[k % len(COLOURS)]}" stroke-width="1.4"{dash}/>')
    if cursor is not None and px.size:
        cx1 = LEFT + wide * (min(max(cursor, start), end) - start) / (end - start)
        parts.append(f'<line class="cursor" x1="{cx1:.1f}" x2="{cx1:.1f}" y1="{TOP}" y2="{TOP + tall}" stroke="currentColor"/>')
    legend = _legend(px, lines, cursor)
    return (
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" style="width:100%;display:block" fill="currentColor" role="img" '
        f'aria-label="{escape(title)}">{"".join(parts)}</svg>{legend}'
    )


def _legend(x: Array, lines: Sequence[Line], cursor: float | None) -> str:
    """Return names, colours and values at the cursor as HTML."""
    items = []
    for k, line in enumerate(lines):
        value = math.nan
        if cursor is not None and x.size:
            value = float(np.interp(cursor, x, line.values))
        text = "" if math.isnan(value) else f" {value:.3g}"
        mark = "╌" if k >= 3 else "—"
        items.append(f'<span style="color:{COLOURS[k % len(COLOURS)]}">{mark} {escape(line.name)}{text}</span>')
    return (
        '<div style="display:flex;flex-wrap:wrap;gap:0 10px;font-size:11px;padding:0 8px 6px 36px;'
        f'font-variant-numeric:tabular-nums">{"".join(items)}</div>'
    )


def _range(values: Sequence[Array]) -> tuple[float, float]:
    """Return the lowest and highest finite value with room around them."""
    joined = np.concatenate([np.ravel(v) for v in values]) if values else np.zeros(0)
    finite = joined[np.isfinite(joined)]
    if finite.size == 0:
        return -1.0, 1.0
    low, high = float(finite.min()), float(finite.max())
    room = max(0.06 * (high - low), 1e-3 * max(abs(low), abs(high)), 1e-9)
    return low - room, high + room


def _ticks(low: float, high: float, count: int) -> list[float]:
    """Return about `count` round numbers between two numbers."""
    rough = (high - low) / count
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    first = math.ceil(low / step)
    return [round(k * step, 12) + 0.0 for k in range(first, math.floor(high / step) + 1)]


def _thinned(x: Array, y: Array) -> tuple[Array, Array]:
    """Return at most `MOST_POINTS` points of a line: the extremes of each piece."""
    if x.size <= MOST_POINTS:
        return x, y
    edges = np.linspace(0, x.size, MOST_POINTS // 2 + 1).astype(int)
    keep: list[int] = [0, x.size - 1]
    for low, high in itertools.pairwise(edges):
        piece = y[low:high]
        if np.isnan(piece).all():
            keep.append(low)
        else:
            keep += [low + int(np.nanargmin(piece)), low + int(np.nanargmax(piece))]
    chosen = np.unique(keep)
    return x[chosen], y[chosen]


def _path(x: Array, y: Array) -> str:
    """Return the path of a line in SVG, with a new piece after each gap."""
    words, pen = [], "M"
    for px, py in zip(x, y, strict=True):
        if math.isnan(py):
            pen = "M"
            continue
        words.append(f"{pen}{px:.1f} {py:.1f}")
        pen = "L"
    return "".join(words)
