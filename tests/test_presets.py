"""The rovers that come with the package: data folders that load, and say where their numbers come from."""

from __future__ import annotations

import numpy as np
import pytest

from rockerbogie.errors import RoverError
from rockerbogie.formats import load_rover, presets
from rockerbogie.frames import wheel_frames

NAMES = ["curiosity", "elhami-dashti", "osr", "perseverance", "rocky7", "sawppy"]


def test_the_six_are_there() -> None:
    assert list(presets()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_loads(name: str) -> None:
    rover = load_rover(name)
    assert rover.name == name
    np.testing.assert_allclose(wheel_frames(rover, 0.0, [0.0, 0.0])[:, :3, 3], rover.hubs, atol=1e-15)


def test_paper_axles() -> None:
    """The axles at zero of the paper's own constants, to the digits it can be worked out to."""
    hubs = load_rover("elhami-dashti").hubs
    np.testing.assert_allclose(hubs[::2, 0], [-0.290, 0.1197, 0.4897], atol=5e-5)
    np.testing.assert_allclose(hubs[::2, 2], [-0.2900, -0.2903, -0.2903], atol=5e-5)
    assert load_rover("elhami-dashti").to_dh()["K9"] == pytest.approx(np.deg2rad(30.7), abs=1e-15)


@pytest.mark.parametrize(
    ("name", "steering"),
    [("elhami-dashti", [1, 1, 0, 0, 0, 0]), ("rocky7", [1, 1, 0, 0, 0, 0]), ("curiosity", [1, 1, 0, 0, 1, 1])],
)
def test_who_steers(name: str, steering: list[int]) -> None:
    assert load_rover(name).steers.tolist() == [bool(s) for s in steering]


def test_did_you_mean() -> None:
    with pytest.raises(RoverError, match="did you mean 'curiosity'"):
        load_rover("curiousity")
