"""Surfaces with parameters on the command line: terrain as in Python, errors with a list."""

from __future__ import annotations

import inspect
import math
import re

import numpy as np
import pytest
from test_cli import complaint

import rockerbogie as rb
from rockerbogie.cli.rasters import load_terrain
from rockerbogie.terrain.surface_names import ANGLES, listing, parameters


@pytest.mark.parametrize("name", rb.surfaces.__all__)
def test_listed_surfaces_are_accepted(name: str) -> None:
    """Type out the default values of the listing: they give the default surface."""
    text = re.sub(r" \(degrees\)", "", listing(name).split(" takes ")[1]).replace(", ", "&")
    assert set(re.findall(r"(\w+)=", text)) == set(parameters(name))
    fast = {"size=40": "size=4", "size=10&": "size=4&"}
    for old, new in fast.items():
        text = text.replace(old, new)
    typed = load_terrain(f"surface:{name}?{text}", None)
    sizes = {"size": 4.0} if "size=4" in text else {}
    plain = getattr(rb.surfaces, name)(**sizes)
    assert typed.interpolation == plain.interpolation
    if name != "paper":  # its sizes are irrational, so four digits give another grid
        assert typed.z.shape == plain.z.shape
        np.testing.assert_allclose(typed.z, plain.z, atol=0.02)


def test_parameters_are_taken_in_their_units() -> None:
    typed = load_terrain("surface:plane?slope=10&aspect=90&size=4,6", None)
    plain = rb.surfaces.plane(math.radians(10), math.radians(90), size=(4.0, 6.0))
    np.testing.assert_array_equal(typed.z, plain.z)
    rocks = load_terrain("surface:rocks?k=0.2&seed=3&size=4", True)
    np.testing.assert_array_equal(rocks.z, rb.surfaces.rocks(0.2, 3, size=4.0, interpolation="linear").z)


def test_all_angle_parameters_are_converted_from_degrees() -> None:
    """A parameter whose documentation or default says rad is converted from degrees."""
    for name in rb.surfaces.__all__:
        text = inspect.getdoc(getattr(rb.surfaces, name)) or ""
        for key in parameters(name):
            if re.search(rf"`{key}` rad", text):
                assert key in ANGLES, f"{name}: {key}"


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("rocks?kk=0.1", "no parameter 'kk'; surface:rocks takes k=0.1, seed=0"),
        ("rocks?k=many", "k is 'many'; give a number"),
        ("rocks?seed=1.5", "seed is '1.5'; give a whole number"),
        ("rocks?k", "is not NAME?parameter=value"),
        ("rocks?k=nan", "give a number"),
        ("plane?size=1,2,3", "one or two numbers"),
        ("plane?slope=95", "slope"),
        ("rockz?k=1", "did you mean 'rocks'"),
    ],
)
def test_impossible_surfaces_are_refused_in_one_sentence(text: str, hint: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert hint in complaint(capsys, "settle", "-t", f"surface:{text}")
