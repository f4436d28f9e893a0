"""Tests of the dark theme: every mark can be seen on the dark page."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.colors import to_rgba
from matplotlib.text import Text

import rockerbogie as rb
from rockerbogie.figures.theme import on_dark
from support.helpers import assert_close

WEIGHTS = np.array([0.2126, 0.7152, 0.0722])


def luminance(colour: object) -> float:
    """Return the relative luminance of a colour as WCAG defines it."""
    rgb = np.array(to_rgba(colour)[:3])  # type: ignore[arg-type]
    return float(np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) @ WEIGHTS)


def contrast(a: object, b: object) -> float:
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


def test_text_and_lines_stand_out_from_the_dark_page() -> None:
    rover, terrain = rb.load_rover("osr"), rb.surfaces.sine()
    run = rb.drive(rover, terrain, rb.Path.straight((-0.5, 0), 0, 1), step=0.1)
    for draw in (lambda **how: rb.plot.run(run, **how), lambda **how: rb.plot.rover(rover, **how)):
        light, figure = draw(), draw(theme="dark")
        figure.draw_without_rendering()
        page = figure.get_facecolor()
        assert luminance(page) < 0.02
        for text in figure.findobj(Text):
            if text.get_text().strip() and text.get_visible():
                assert contrast(text.get_color(), page) > 3, text.get_text()
        pairs = [
            pair
            for axes in zip(light.axes, figure.axes, strict=True)
            for pair in zip(*(ax.get_lines() for ax in axes), strict=True)
        ]
        seen = [dark for plain, dark in pairs if contrast(plain.get_color(), "white") > 2.5]  # others are halos
        assert len(seen) > 10
        for line in seen:
            assert contrast(line.get_color(), page) > 2.5


def test_greys_are_inverted_and_hues_kept() -> None:
    assert luminance(on_dark("white")) < 0.02
    assert luminance(on_dark("black")) > 0.7
    blue = np.array(on_dark("#0072B2"))
    assert np.argmax(blue[:3]) == 2
    assert_close(on_dark("#F0E442"), to_rgba("#F0E442"), 1e-9, "1", "light hues stay")
    assert on_dark("none") == "none"


def test_unknown_theme_is_refused() -> None:
    with pytest.raises(rb.RockerbogieError, match="light or dark"):
        rb.plot.rover(rb.load_rover("osr"), theme="blue")  # type: ignore[arg-type]
