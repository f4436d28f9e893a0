"""Joints under other names, by a mapping or by a robot description."""

from __future__ import annotations

import re

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.ros.joints import JointReader, MotorNames, parse_names, read_description

ROVER = rb.load_rover("osr")


def test_the_names_of_the_exported_description_are_found():
    """Read the URDF of a rover back: each joint is its own column, with its own sign."""
    rover, names = read_description(rb.to_urdf(ROVER))
    assert rover.wheel_names == ROVER.wheel_names
    expected = {f"wheel_{w}_joint": f"wheel_angle_{w}" for w in ROVER.wheel_names}
    expected |= {f"steer_{w}_joint": f"steering_{w}" for w, on in zip(ROVER.wheel_names, ROVER.steers, strict=True) if on}
    expected |= {f"bogie_{side}_joint": f"bogie_{side}" for side in ("left", "right")} | {"rocker_left_joint": "rocker"}
    assert names == expected


def test_other_names_and_axes_in_a_description_are_found():
    """Rename joints and turn the axes of the right wheels: names and signs are found."""
    urdf = rb.to_urdf(ROVER)
    for w in ROVER.wheel_names:
        urdf = urdf.replace(f'"wheel_{w}_joint"', f'"drive_{w.lower()}"')
    turned = []
    for w in ("RF", "RM", "RR"):
        urdf, count = re.subn(
            rf'(<joint name="drive_{w.lower()}".*?<axis xyz=")0.0 1.0 0.0', r"\g<1>0.0 -1.0 0.0", urdf, flags=re.DOTALL
        )
        turned.append(count)
    assert turned == [1, 1, 1]
    _, names = read_description(urdf)
    for w in ROVER.wheel_names:
        assert names[f"drive_{w.lower()}"] == f"{'-' if w.startswith('R') else ''}wheel_angle_{w}"
    reader = JointReader(ROVER, names)
    values = reader.read(["drive_rf", "drive_lf", "unknown_joint"], [1.0, 2.0, 3.0], [])
    assert values == {"wheel_angle_RF": -1.0, "wheel_angle_LF": 2.0}
    motors = MotorNames.of(ROVER, names)
    assert motors.wheels == tuple(f"drive_{w.lower()}" for w in ROVER.wheel_names)
    assert motors.wheel_signs.tolist() == [-1.0 if w.startswith("R") else 1.0 for w in ROVER.wheel_names]


def test_a_mapping_reads_positions_and_rates():
    reader = JointReader(ROVER, parse_names(["fl=wheel_LF_joint", "corner=-steering_LF", ""]))
    assert reader.read(["fl", "corner"], [1.0, 0.2], [0.5, 0.0]) == {
        "wheel_angle_LF": 1.0,
        "wheel_rate_LF": 0.5,
        "steering_LF": -0.2,
    }
    assert reader.read(["fl"], [], [0.5]) == {"wheel_rate_LF": 0.5}
    assert np.isnan(reader.read(["fl"], [float("nan")], [])["wheel_angle_LF"])


def test_efforts_of_wheels_are_read_with_their_signs():
    reader = JointReader(ROVER, parse_names(["fl=-wheel_LF_joint"]))
    found = reader.efforts(["fl", "wheel_RM_joint", "steer_LF_joint"], [2.0, 3.0, 4.0])
    assert found == {ROVER.wheel_names.index("LF"): -2.0, ROVER.wheel_names.index("RM"): 3.0}
    assert reader.efforts(["fl"], []) == {}
    with pytest.raises(rb.RockerbogieError, match="1 names and 2 values of effort"):
        reader.efforts(["fl"], [1.0, 2.0])


@pytest.mark.parametrize("pair", ["fl", "=wheel_LF", "fl="])
def test_wrong_pairs_are_refused(pair):
    with pytest.raises(rb.RockerbogieError, match="THEIRS=OURS"):
        parse_names([pair])


def test_wrong_messages_are_refused():
    reader = JointReader(ROVER)
    with pytest.raises(rb.RockerbogieError, match="2 names and 1 values"):
        reader.read(["wheel_LF_joint", "wheel_RF_joint"], [1.0], [])
    with pytest.raises(rb.RockerbogieError, match="no column named"):
        JointReader(ROVER, {"fl": "nonsense"})


def test_a_description_without_a_rover_is_refused():
    with pytest.raises(rb.RockerbogieError):
        read_description('<robot name="box"><link name="base"/></robot>')
