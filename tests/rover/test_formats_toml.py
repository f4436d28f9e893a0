"""Tests of the package's own rover files.

Keys carry units, every wrong file is named in one sentence, comments explain the keys.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.rover.formats import load_rover, presets, to_toml
from rockerbogie.rover.formats.toml_keys import KEYS
from rockerbogie.rover.formats.toml_read import read_toml
from support.helpers import assert_close

GOOD = """
name = "mine"
[wheels]
radius_m = 0.1
[linkage]
rocker_pivot_m = [0.1, 0.2, 0.3]
bogie_pivot_m = [-0.2, 0.25, 0.15]
hubs_m = [[0.4, 0.3, 0.0], [0.0, 0.3, 0.0], [-0.4, 0.3, 0.0]]
"""
PART = "mass_kg = 1\ncom_m = [0,0,0]\ninertia_kg_m2 = [1,1,1,0,0,0]"


def test_a_small_file() -> None:
    rover = read_toml(GOOD)
    assert rover.name == "mine"
    assert_close(rover.hubs[1], (0.4, -0.3, 0.0), 0, "m", "mirrored")
    assert np.isinf(rover.rocker_limits).all()
    assert_close(rover.differential, (0.0, -1.0), 0, "", "left out: ideal")


def test_angles_are_degrees() -> None:
    rover = read_toml(GOOD + "[stops]\nrocker_deg = [-20, 25]\nbogie_deg = [-inf, 30.0]\n[differential]\nratio = 1.25\n")
    assert_close(np.degrees(rover.rocker_limits), (-20, 25), 1e-12, "deg", "in the file")
    assert_close(np.degrees(rover.bogie_limits), (-np.inf, 30), 1e-12, "deg", "one open side")
    assert_close(rover.differential, (0.0, -1.25), 0, "", "a ratio")


def test_a_bar_in_a_file() -> None:
    text = (presets()["perseverance"] / "rover.toml").read_text()
    with_bar = text.replace("# [differential]", "[differential]").replace("# bar_", "bar_").replace("# horn_m", "horn_m")
    assert with_bar != text
    rover = read_toml(with_bar)
    off = np.degrees(np.abs(rover.right_rocker(np.radians([14.5, 32.0])) + np.radians([14.5, 32.0])))
    assert off[0] <= 0.055
    assert_close(off[1], 1.0, 0.01, "deg", "the README's figure")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("a = ", "not TOML"),
        ("[wheel]\nradius_m = 1", r"no key or table named 'wheel'; did you mean 'wheels'\?"),
        (GOOD.replace("radius_m", "radius"), r"no key in \[wheels\] named 'radius'; did you mean 'radius_m'\?"),
        (GOOD.replace("radius_m = 0.1", 'radius_m = "0.1"'), r"wheels.radius_m is 0.1; give a number or 3 numbers or 6 numbers"),
        (GOOD.replace("0.25, 0.15]", "0.25]"), r"linkage.bogie_pivot_m is \[-0.2, 0.25\]; give 3 numbers or 2x3 numbers"),
        (GOOD.replace("[0.1, 0.2, 0.3]", "[0.1, 0.2, true]"), "give 3 numbers"),
        (GOOD.replace("[0.1, 0.2, 0.3]", "[[0.1, 0.2, 0.3], [0.1]]"), "give 3 numbers"),
        (GOOD.replace("radius_m = 0.1", "radius_m = nan"), "give a number"),
        (GOOD.replace("radius_m = 0.1", "radius_m = inf"), "wheel_radius holds a value that is not finite"),
        (GOOD.replace("radius_m = 0.1", "radius_m = 1e300"), "give a number"),
        (GOOD.replace("radius_m = 0.1", "radius_m = -0.1"), "wheel_radius is -0.1 m; give one above 0"),
        (GOOD.replace("radius_m = 0.1", "radius_m = 0.3"), r"wheels LR and LM overlap: hubs 0.4 m apart, radii sum 0.6 m"),
        (GOOD.replace("radius_m = 0.1\n", ""), "no wheels.radius_m: a rover needs its wheel radius"),
        ("format = 2" + GOOD, "format is 2; this version reads format 1"),
        ("wheels = 3", r"wheels must be a table: write \[wheels\]"),
        (GOOD + "[stops]\nbogie_deg = [10, 20]", "bogie_limits .* must hold the rest angle 0"),
        (GOOD + "[stops]\nbogie_deg = [-300, 300]", "beyond a half turn"),
        (GOOD + "[dh]\nK3_m = 1.0", r"\[dh\] already gives wheels.radius_m; give one or the other"),
        ("[dh]\nK3_m = 1.0", r"\[dh\] lacks K4, K5"),
        (GOOD + "[differential]\nratio = 1\ncoefficients = [0, -1]", "given in 2 ways"),
        (GOOD + "[differential]\nbar_end_m = [0, 0.8, 1]", "a differential bar needs bar_pivot_m, bar_end_m, horn_m"),
        (GOOD + "[differential]\nratio = -1", "must turn the right rocker against the left one"),
        (GOOD + "[mass]\ntotal_kg = 0", "the rover has no mass"),
        (GOOD + "[link.body]\nmass_kg = 1", r"\[link.body\] lacks com_m, inertia_kg_m2"),
        (GOOD + "[link.boddy]\nmass_kg = 1", r"no part under \[link\] named 'boddy'; did you mean 'body'\?"),
        (GOOD + "[link.rocker_left]\n" + PART, "gives 1 of the 2 rockers; give all or none"),
        (GOOD + "[link.body]\n" + PART.replace("[1,1,1", "[1,1,3"), "a link's inertia is one that no body can have"),
        (GOOD + "[link.body]\n" + PART.replace("[1,1,1", "[9e6,9e6,9e6"), "a moment of inertia of 9e.06 kg m2"),
        (GOOD + "[link.body]\n" + PART.replace("[0,0,0]", "[0,0,90]", 1), "a centre of mass would be 90 m from the wheels"),
        (GOOD.replace("0.4,", "400.0,"), r"its wheelbase would be 800 m, .*: is the file in millimetres\?"),
        (GOOD.replace("0.1, 0.2, 0.3]", "100.0, 200.0, 300.0]"), r"a rocker pivot would be 374.2 m from the wheels, .*metres\?"),
        ("x = " + "[" * 5000, "not TOML"),
    ],
)  # fmt: skip
def test_wrong_files_are_named(text: str, sentence: str) -> None:
    with pytest.raises(rb.RoverError, match=sentence):
        read_toml(text, "test")


def test_huge_text_is_refused() -> None:
    with pytest.raises(rb.RoverError, match="a rover takes a few thousand"):
        read_toml("#" * 1_000_001)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(rb.RoverError, match=r"cannot read rover file '.*none\.toml': No such file"):
        load_rover(tmp_path / "none.toml")
    with pytest.raises(rb.RoverError, match="cannot read rover file"):
        load_rover(tmp_path / "folder.toml" / "x.toml")
    (tmp_path / "latin.toml").write_bytes(b'name = "\xff"')
    with pytest.raises(rb.RoverError, match=r"latin\.toml: it is not UTF-8 text"):
        load_rover(tmp_path / "latin.toml")


def test_every_key_is_explained() -> None:
    """Every key of a whole file has its comment."""
    text = to_toml(load_rover("curiosity"), options=True)
    for key in KEYS:
        if f"{key.name} = " in text and key.table != "link":
            assert key.comment in text


def test_names_with_quotes_come_back() -> None:
    rover = load_rover("curiosity").replace(name='a "quoted" \\ name\nön two lines')
    assert read_toml(to_toml(rover)).name == rover.name


def test_torque_limit_of_the_motors_is_kept(tmp_path: Path) -> None:
    """One for all, per axle, per wheel; not stated is inf, and is not written."""
    rover = rb.load_rover("osr")
    assert np.isinf(rover.wheel_torque).all()
    assert "torque_n_m" not in to_toml(rover)
    for given, full in ((3.7, [3.7] * 6), ([3.0, 4.0, 5.0], [3, 3, 4, 4, 5, 5]), ([1.0, 2, 3, 4, 5, 6], [1, 2, 3, 4, 5, 6])):
        file = tmp_path / "rover.toml"
        file.write_text(to_toml(rover.replace(wheel_torque=given)), encoding="utf-8")
        np.testing.assert_array_equal(rb.load_rover(file).wheel_torque, full)
    with pytest.raises(rb.RoverError, match="wheel_torque is -1 N m; give limits above 0"):
        rover.replace(wheel_torque=-1.0)
