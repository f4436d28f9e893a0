"""Wrong calls get one sentence that says what is wrong and how to mend it, never numpy's own."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb


@pytest.fixture(scope="module")
def rover():
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def poses(rover):
    return rb.settle(rover, rb.surfaces.plane(), [0.0, 1.0], 0.0, 0.0)


TWIST, RATES = np.zeros(6), np.zeros(6)


@pytest.mark.parametrize(
    "twist, rates, more, says",
    [
        (np.zeros(5), RATES, {}, r"twist has shape \(5,\); its last axis must be 6"),
        ("fast", RATES, {}, "twist must be numbers, not 'fast'"),
        (TWIST, np.zeros(4), {}, r"wheel_rates has shape \(4,\)"),
        (TWIST, 1.0, {}, r"wheel_rates has shape \(\)"),
        (np.zeros((3, 6)), RATES, {}, r"do not broadcast together: pose \(2,\), twist \(3,\)"),
        (TWIST, RATES, {"bogie_rates": np.zeros(3)}, r"bogie_rates has shape \(3,\); its last axis must be 2"),
        (TWIST, RATES, {"rocker_rate": np.zeros(3)}, r"pose \(2,\), rocker_rate \(3,\)"),
        (TWIST, RATES, {"steering_rates": 0.1}, r"steering_rates has shape \(\)"),
        (TWIST, [0, 0, np.inf, 0, 0, 0], {}, "wheel_rates holds 1 infinite values; mark a missing reading with nan"),
    ],
)
def test_wheel_slip_says_what_does_not_fit(rover, poses, twist, rates, more, says):
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.wheel_slip(rover, poses, twist, rates, **more)


@pytest.mark.parametrize(
    "readings, says",
    [
        ({"wheel_rates": [np.inf, 1, 1, 1, 1, 1]}, "wheel_rates holds 1 infinite values; mark a missing reading with nan"),
        ({"gyro": [0, -np.inf, 0]}, "gyro holds 1 infinite values"),
        ({"rocker_rate": np.inf}, "rocker_rate holds 1 infinite values"),
        ({"gyro": ["a", 0, 0]}, "gyro must be numbers"),
        ({"wheel_rates": np.ones((3, 6))}, r"do not broadcast together: pose \(2,\), wheel_rates \(3,\)"),
        ({"expected_slip": np.zeros((5, 3))}, r"expected_slip has shape \(5, 3\); its last axes must be \(6, 3\)"),
    ],
)
def test_body_twist_says_what_does_not_fit(rover, poses, readings, says):
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.body_twist(rover, poses, **readings)


def test_a_nan_reading_is_no_reading(rover, poses):
    five = rb.body_twist(rover, poses, wheel_rates=[np.nan, 1, 1, 1, 1, 1])
    assert np.isfinite(five.twist).all()
    assert np.isnan(five.residual[:, 0, 0]).all(), "the slip of a wheel whose motor is not read is not known"
    assert np.isfinite(five.residual[:, 1:]).all()


@pytest.mark.parametrize("name", [None, 5, ["curiosity"]])
def test_no_name_is_no_rover(name):
    with pytest.raises(rb.RoverError, match=r"names no rover: give a preset \(curiosity, .*\) or the path of a file"):
        rb.load_rover(name)


SIZES = {"wheel_radius": 0.1, "bogie_pivot": (-0.2, 0.3, 0.1), "hubs": [(0.5, 0.3, 0), (0, 0.3, 0), (-0.4, 0.3, 0)]}


@pytest.mark.parametrize(
    "change, says",
    [
        (
            {"rocker_pivot": (0, -0.3, 0.2)},
            "rocker_pivot has its left pivot at y = -0.3 m, right of its right one: give the left",
        ),
        ({"rocker_pivot": [(0, -0.3, 0.2), (0, 0.3, 0.2)]}, "rocker_pivot has its left pivot at y = -0.3 m"),
        ({"bogie_pivot": (-0.2, -0.3, 0.1)}, "bogie_pivot has its left pivot at y = -0.3 m"),
        ({"hubs": np.multiply(SIZES["hubs"], (1, -1, 1))}, "a left hub does not stand left .* of its right one: y points left"),
    ],
)
def test_the_right_side_is_not_the_left(change, says):
    good = SIZES | {"rocker_pivot": (0, 0.3, 0.2)}
    assert rb.Rover.from_pivots(**good).hubs[0, 1] == 0.3
    with pytest.raises(rb.RoverError, match=says):
        rb.Rover.from_pivots(**(good | change))


def test_a_simulation_that_goes_nowhere_is_no_success(capsys):
    from rockerbogie.cli import main

    call = ["simulate", "--rover", "rocky7", "--terrain", "surface:plane", "--path", "0,0 0.6,0", "--speed", "0.2"]
    assert main([*call, "--friction", "0"]) == 1
    said = capsys.readouterr().err
    assert "short of the path's end, 0.60 m away: on friction 0 its wheels slip" in said
    assert main(call) == 0
    assert capsys.readouterr().err == ""
