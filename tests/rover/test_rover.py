"""Tests of the mechanism: its descriptions, its derived quantities, its refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rockerbogie as rb
from support.helpers import assert_close, paper_rover, random_rover

PAPER = {
    "K1": 0.0, "K2": 0.0, "K3": 0.27, "K4": 0.29, "K5": 0.29, "K6": 0.2846, "K7": 0.245, "K8": 0.145,
    "K9": float(np.radians(30.7)), "K10": 0.10, "K11": 0.125,
}  # fmt: skip

PIVOTS: dict[str, Any] = {
    "name": "plain",
    "wheel_radius": 0.1,
    "wheel_width": 0.05,
    "rocker_pivot": (0.0, 0.25, 0.1),
    "bogie_pivot": (0.25, 0.25, 0.0),
    "hubs": [(-0.3, 0.3, -0.2), (0.1, 0.3, -0.2), (0.4, 0.3, -0.2)],
}


def same_rover(a: rb.Rover, b: rb.Rover, tol: float) -> None:
    for part in ("rocker_pivot", "bogie_pivot", "hubs", "wheel_radius", "wheel_width", "steering_offset", "body_box"):
        assert_close(getattr(a, part), getattr(b, part), tol, "m", f"{part} is the same rover's")


def test_dh_and_pivots_are_two_forms_of_one_rover() -> None:
    rover = rb.Rover.from_dh(**PAPER)
    back = rover.to_dh()
    for k, value in PAPER.items():
        assert_close(back[k], value, 1e-15, "m, rad", f"{k} goes out as it came in")
    pivots = rb.Rover.from_pivots(
        wheel_radius=0.1, rocker_pivot=rover.rocker_pivot[0], bogie_pivot=rover.bogie_pivot[0], hubs=rover.hubs[::2]
    )
    same_rover(pivots, rover, 1e-15)


def test_random_rovers_of_table_i_come_back() -> None:
    rng = np.random.default_rng(0)
    for _ in range(100):
        K = {f"K{i}": float(rng.uniform(0.2, 1.0)) for i in range(1, 12)}
        K |= {"K1": float(rng.normal()), "K2": float(rng.normal()), "K4": 1.0, "K10": 0.09, "K9": float(rng.uniform(-0.7, 0.7))}
        rover = rb.Rover.from_dh(**K)
        again = rb.Rover.from_dh(**rover.to_dh())
        same_rover(again, rover, 1e-14)
        angles = rng.uniform(-1, 1), rng.uniform(-1, 1, 2)
        assert_close(rb.wheel_frames(again, *angles), rb.wheel_frames(rover, *angles), 1e-14, "m", "same frames from both")


def test_a_rover_outside_table_i_says_where_its_table_is() -> None:
    with pytest.raises(rb.RoverError, match=r"not of Table I's form .* take its general table from rockerbogie.dh_table"):
        random_rover(np.random.default_rng(0)).to_dh()
    assert len(rb.dh_table(random_rover(np.random.default_rng(0)))) >= 15


def test_sides_axles_and_wheels_are_filled_in() -> None:
    rover = rb.Rover.from_pivots(**PIVOTS | {"wheel_radius": (0.1, 0.09, 0.08), "steering_offset": (0.01, 0.02)})
    assert_close(rover.hubs[1::2], rover.hubs[::2] * (1, -1, 1), 0.0, "m", "the right side mirrors the left")
    assert_close(rover.rocker_pivot[1], (0.0, -0.25, 0.1), 0.0, "m", "the right side mirrors the left")
    assert_close(rover.wheel_radius, (0.1, 0.1, 0.09, 0.09, 0.08, 0.08), 0.0, "m", "one radius for each axle")
    assert_close(rover.steering_offset[:2], [(0.01, 0.02), (0.01, -0.02)], 0.0, "m", "offsets mirror too")
    assert rover.steers.all()
    hubs, pivots = rover.hubs * 1.1, rover.rocker_pivot * 1.1
    both = rb.Rover.from_pivots(**PIVOTS | {"hubs": hubs, "rocker_pivot": pivots, "steers": (1, 0, 0, 0, 0, 1)})
    assert_close(both.hubs, hubs, 0.0, "m", "both sides given are kept")
    assert both.steers.tolist() == [True, False, False, False, False, True]
    for steers in ((True, False, True), np.array([1, 0, 1]), np.repeat([True, False, True], 2)):
        assert rover.replace(steers=steers).steers.tolist() == [True, True, False, False, True, True]


def test_wheels_are_named_after_where_they_stand() -> None:
    assert paper_rover().wheel_names == ("LR", "RR", "LM", "RM", "LF", "RF")
    ahead = rb.Rover.from_pivots(**PIVOTS | {"hubs": np.multiply(PIVOTS["hubs"], (-1, 1, 1)), "bogie_pivot": (-0.25, 0.25, 0)})
    assert ahead.wheel_names == ("LF", "RF", "LM", "RM", "LR", "RR")


def test_masses_are_shared_out_and_can_be_given() -> None:
    rover = rb.Rover.from_pivots(**PIVOTS, mass=50.0)
    assert_close(rover.mass, 50.0, 1e-12, "kg", "the shares add up to the whole")
    assert len(rover.links) == 11
    for link in rover.links:
        assert_close(link.inertia, link.inertia.T, 1e-15, "kg m²", "symmetric")
        principal = np.linalg.eigvalsh(link.inertia)
        assert principal[0] > 0
        assert principal[2] <= principal[0] + principal[1] + 1e-12, "a rigid part's moments obey the triangle inequality"
    body = rb.Link(20.0, np.array([0.1, 0.0, 0.2]), np.eye(3))
    assert rb.Rover.from_pivots(**PIVOTS, mass=50.0, body=body).body is body
    assert_close(rover.wheelbase, 0.7, 1e-15, "m", "outermost hubs")
    small, large = (rb.Rover.from_pivots(**PIVOTS | {"hubs": np.multiply(PIVOTS["hubs"], k)}).mass for k in (1.0, 2.0))
    assert_close(large / small, 8.0, 1e-12, "", "without a mass, it grows with the cube of the size")


@pytest.mark.parametrize("shape", [(), (1,), (3, 1, 2)])
def test_differential(shape: tuple[int, ...]) -> None:
    rho = np.random.default_rng(0).uniform(-0.5, 0.5, shape)
    ideal = rb.Rover.from_pivots(**PIVOTS)
    assert ideal.right_rocker(rho).shape == shape
    assert_close(ideal.right_rocker(rho), -rho, 0.0, "rad", "the ideal differential")
    bar = ideal.replace(differential=np.array([0.0, -1.0, 0.0, 0.5]))
    assert_close(bar.right_rocker(rho), -rho + 0.5 * rho**3, 1e-16, "rad", "a polynomial in the left rocker's angle")


def test_replace_checks_again() -> None:
    rover = rb.Rover.from_pivots(**PIVOTS)
    wide = rover.replace(wheel_width=np.full(6, 0.2))
    assert wide.wheel_width[0] == 0.2
    assert rover.wheel_width[0] == 0.05
    with pytest.raises(rb.RoverError, match="wheel_width is -0.2 m"):
        rover.replace(wheel_width=np.full(6, -0.2))


CLOSE = [(-0.3, 0.3, -0.2), (0.25, 0.3, -0.2), (0.4, 0.3, -0.2)]
ROCKER_NEAR = [(0.0, 0.3, -0.2), (0.1, 0.3, -0.2), (0.4, 0.3, -0.2)]
MISSES_SIDEWAYS = [(-0.3, 0.3, -0.2), (0.25, 0.4, -0.2), (0.4, 0.3, -0.2)]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"hubs": [(0, 0, 0)]}, r"hubs has shape \(1, 3\); give \(3, 3\) for the left side or \(6, 3\) in wheel order"),
        ({"rocker_pivot": (0, 0)}, r"rocker_pivot has shape \(2,\); give \(3,\) for the left side or \(2, 3\) for both"),
        ({"bogie_pivot": np.zeros((3, 3))}, r"bogie_pivot has shape \(3, 3\); give \(3,\)"),
        ({"wheel_radius": (0.1, 0.1)}, r"wheel_radius has shape \(2,\); give a number, \(3,\) per axle or \(6,\) per wheel"),
        ({"wheel_width": np.zeros((6, 1))}, r"wheel_width has shape \(6, 1\)"),
        ({"steers": (True, False)}, r"steers has shape \(2,\)"),
        ({"steers": (1, 2, 1)}, "steers must be true or false for each wheel, not"),
        ({"steering_offset": (0, 0, 0)}, r"steering_offset has shape \(3,\); give \(2,\), \(3, 2\) .* or \(6, 2\)"),
        ({"rocker_limits": (-1, 0, 1)}, r"rocker_limits has shape \(3,\); give \(2,\)"),
        ({"body_box": (0, 1)}, r"body_box has shape \(2,\); give \(2, 3\)"),
        ({"bogie_pivot": (np.nan, 0.25, 0)}, "bogie_pivot holds a value that is not finite"),
        ({"hubs": np.full((3, 3), np.inf)}, "hubs holds a value that is not finite"),
        ({"wheel_radius": 0.0}, "rover 'plain': wheel_radius is 0 m; give one above 0"),
        ({"wheel_radius": np.nan}, "wheel_radius holds a value that is not finite"),
        ({"wheel_width": -0.01}, "wheel_width is -0.01 m; give 0 or more"),
        ({"hubs": np.multiply(PIVOTS["hubs"], (1, -1, 1))}, "a left hub is not to the left .greater y. of its right one"),
        ({"bogie_pivot": (0.0, 0.3, 0.1)}, "bogie pivot and rocker pivot coincide in the side view"),
        ({"hubs": CLOSE}, "wheels LF and LM overlap: hubs 0.15 m apart, radii sum 0.2 m"),
        ({"hubs": ROCKER_NEAR}, "wheels LM and LR overlap: hubs 0.1 m apart, radii sum 0.2 m"),
        ({"bogie_limits": (0.1, 0.5)}, r"bogie_limits \(0.1, 0.5\) must hold the rest angle 0 between them"),
        ({"bogie_limits": (0.0, 0.0)}, r"bogie_limits \(0, 0\) must hold the rest angle 0 between them"),
        ({"rocker_limits": (-0.5, np.nan)}, r"rocker_limits \(-0.5, nan\) must hold the rest angle 0"),
        ({"rocker_limits": (-15.0, 0.3)}, "rocker_limits -15 rad is beyond a half turn: are these degrees?"),
        ({"bogie_limits": (-0.3, 20.0)}, "bogie_limits 20 rad is beyond a half turn: are these degrees?"),
        ({"differential": (0.0,)}, "differential needs 2 to 24 finite coefficients"),
        ({"differential": -1.0}, "differential needs 2 to 24 finite coefficients"),
        ({"differential": (0.0, np.nan)}, "differential needs 2 to 24 finite coefficients"),
        ({"differential": (0.0, 1.0)}, "differential must turn the right rocker against the left one"),
        ({"differential": (0.1, -1.0)}, r"differential must turn .*: c\[0\] = 0 and c\[1\] < 0"),
        ({"body_box": [(0, 0, 0), (1, 0, 1)]}, "body_box: its first corner must be below its second"),
        ({"body_box": [(0, 0, 0), (1, np.inf, 1)]}, "body_box holds a value that is not finite"),
        ({"wheel_names": ("a", "b", "c")}, "wheel_names needs six different names"),
        ({"wheel_names": ("a", "b", "c", "d", "e", "a")}, "wheel_names needs six different names"),
        ({"mass": -1.0}, "a link's mass is -0.6 kg; give 0 or more"),
        ({"mass": "heavy"}, "mass must be numbers, not 'heavy'"),
        ({"mass": np.nan}, "a link's mass is nan kg"),
        ({"mass": 0.0}, "the rover has no mass; give mass= in kg"),
        ({"wheel_radius": "big"}, "wheel_radius must be numbers, not 'big'"),
        ({"hubs": [(1, 2, 3), (4, 5)]}, "hubs must be numbers"),
        ({"differential": "bar"}, "differential must be numbers, not 'bar'"),
        ({"rockers": [rb.Link(1.0, np.zeros(3), np.eye(3))]}, "rockers needs 2 links, got 1"),
        ({"wheels": [rb.Link(1.0, np.zeros(3), np.eye(3))] * 4}, "wheels needs 6 links, got 4"),
        ({"body": rb.Link(1.0, np.zeros(2), np.eye(3))}, r"a link's com has shape \(2,\); give \(3,\)"),
        ({"body": rb.Link(1.0, np.zeros(3), np.zeros((3, 2)))}, r"a link's inertia has shape \(3, 2\); give \(3, 3\)"),
        ({"body": rb.Link(1.0, np.full(3, np.nan), np.eye(3))}, "a link's com holds a value that is not finite"),
    ],
)  # fmt: skip
def test_a_rover_that_cannot_be_is_refused(change: dict[str, Any], sentence: str) -> None:
    with pytest.raises(rb.RoverError, match=sentence):
        rb.Rover.from_pivots(**PIVOTS | change)


def test_wheels_that_pass_beside_each_other_may_overlap_in_the_side_view() -> None:
    assert rb.Rover.from_pivots(**PIVOTS | {"hubs": MISSES_SIDEWAYS}).hubs.shape == (6, 3)
