"""Tests of the package's rovers: folders that load and state their sources."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.errors import RoverError
from rockerbogie.rover.formats import load_rover, presets, read_details
from rockerbogie.rover.frames import wheel_frames

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


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"wheel_width": np.full(6, 2.2)}, r"wheels LR and RR overlap: hubs 0 m apart, radii sum 0\.5 m"),
        ({"differential": np.array([0.0, -1.0, 1.5])}, "differential stops turning the right rocker at .* narrow rocker_limits"),
        ({"differential": np.array([0.0, -1e-5])}, "by -0.01 to -100 of its angle; here it is -1e-05"),
        ({"hubs": np.zeros((6, 3))}, "a left hub is not to the left"),
    ],
)
def test_a_rover_that_cannot_be(change: dict[str, np.ndarray], sentence: str) -> None:
    with pytest.raises(RoverError, match=sentence):
        load_rover("curiosity").replace(**change)


@pytest.mark.parametrize("name", NAMES)
def test_the_folder_is_whole(name: str) -> None:
    """A README with the drawing, a source, a grade to each quantity and a numbered derivation."""
    folder = presets()[name]
    readme = (folder / "README.md").read_text(encoding="utf-8")
    assert readme.startswith(f"# {name}: ")
    assert (folder / "picture.png").stat().st_size > 8_000
    for part in ("](picture.png)", "Source", "| quantity | grade | why |", "From source to number", "\n1. ", "\n2. ", "tops"):
        assert part in readme
    assert set(read_details(name)) == {"title", "grade"}


@pytest.mark.parametrize("name", NAMES)
def test_settles_on_the_flat(name: str) -> None:
    """Every wheel down on a plane, the body no further off level than its hubs' heights say."""
    rover = load_rover(name)
    size = 4 * rover.wheelbase
    ground = rb.Terrain.from_array(np.zeros((41, 41)), spacing=size / 40, origin=(-size / 2, -size / 2))
    pose = rb.settle(rover, ground, 0.0, 0.0, 0.7)
    assert pose.status == rb.Status.CONVERGED
    np.testing.assert_allclose(pose.gap, 0, atol=1e-6)
    low = rover.hubs[:, 2] - rover.wheel_radius
    assert abs(float(pose.pitch)) <= 2 * np.ptp(low) / rover.wheelbase + 1e-9
    assert abs(float(pose.roll)) < 1e-9


def test_a_stop_beyond_reach() -> None:
    """A bogie's wheel that meets the rocker's before the joint limit is refused.

    At 3 deg they do not meet yet.
    """
    shape = {"wheel_radius": 0.19, "rocker_pivot": (0.1, 0.2, 0.3), "bogie_pivot": (-0.2, 0.25, 0.15)}
    hubs = [(0.4, 0.3, 0.0), (0.0, 0.3, 0.0), (-0.4, 0.3, 0.0)]
    rb.Rover.from_pivots(**shape, hubs=hubs, bogie_limits=np.radians([-3, 25]))
    with pytest.raises(
        RoverError, match=r"a bogie cannot reach its limit at -25 deg: wheels LM and LF meet before; narrow bogie_limits"
    ):
        rb.Rover.from_pivots(**shape, hubs=hubs, bogie_limits=np.radians([-25, 25]))
