"""Commands `settle` and `drive` in equilibrium mode: forces, lifted wheels, joint limits."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from support.helpers import assert_close

AT = ("0.6", "0.3")  # before the step of `surface:step`, with a wheel off the ground


@pytest.fixture
def stiff(tmp_path: Path) -> tuple[Path, rb.Rover]:
    """A rover file whose bogies hardly move, and its rover."""
    rover = rb.load_rover("rocky7").replace(bogie_limits=np.array([-0.2, 0.2]), name="stiff")
    (tmp_path / "stiff.toml").write_text(rb.to_toml(rover), encoding="utf-8")
    return tmp_path / "stiff.toml", rb.load_rover(tmp_path / "stiff.toml")


def run(capsys: pytest.CaptureFixture[str], *argv: object) -> str:
    assert main([str(a) for a in argv]) == 0
    return capsys.readouterr().out


def settle_call(file: Path, mode: str) -> list[object]:
    return ["settle", "-t", "surface:step", "-r", file, f"--at={','.join(AT)}", "--yaw", 22.9, "--mode", mode]


def test_json_holds_forces_lifted_wheels_and_limits(stiff, capsys: pytest.CaptureFixture[str]) -> None:
    file, rover = stiff
    record = json.loads(run(capsys, *settle_call(file, "equilibrium"), "--json"))
    pose = rb.settle(rover, rb.surfaces.step(), *map(float, AT), np.radians(22.9), mode="equilibrium")
    assert record["status"] == "WHEEL_LIFTED"
    assert record["wheel_lifted"] == pose.wheel_lifted.tolist()
    assert record["joint_stop"] == pose.joint_stop.tolist()
    assert record["joints"] == ["rocker", "bogie_left", "bogie_right"]
    assert_close(record["support"], pose.support, 1e-12, "N", "the library's forces")
    assert_close(record["support_share"], [*pose.support / sum(pose.support), 0.0], 1e-12, "1", "shares of wheels and body")
    for wheel, lifted in enumerate(pose.wheel_lifted):
        assert (record["contact_angle"][wheel] is None) == lifted
        assert (record["contact_point"][wheel] == [None] * 3) == lifted
    assert max(record["gap"]) > 1e-3


def test_table_shows_forces_lifted_wheels_and_limits(stiff, capsys: pytest.CaptureFixture[str]) -> None:
    file, rover = stiff
    text = run(capsys, *settle_call(file, "equilibrium"))
    pose = rb.settle(rover, rb.surfaces.step(), *map(float, AT), np.radians(22.9), mode="equilibrium")
    assert "touches" not in text
    rows = {name: next(line for line in text.splitlines() if line.split()[:1] == [name]) for name in rover.wheel_names}
    for name, lifted, force in zip(rover.wheel_names, pose.wheel_lifted, pose.support, strict=True):
        assert ("off the ground" in rows[name]) == lifted
        assert f"{force:.1f} N" in rows[name]
        assert f"{100 * force / pose.support.sum():.1f} %" in rows[name]
    ends = {-1: "low", 1: "high"}
    for joint, side in zip(("rocker", "bogie left", "bogie right"), pose.joint_stop.tolist(), strict=True):
        assert (f"{joint} at its" in text) == (side != 0)
        if side:
            assert f"{joint} at its {ends[side]} limit of {np.degrees(0.2) * side:.3g}°" in text


def test_contact_mode_shows_joints_beyond_their_limits(stiff, capsys: pytest.CaptureFixture[str]) -> None:
    file, _ = stiff
    text = run(capsys, *settle_call(file, "contact"))
    assert "JOINT_STOP" in text
    assert "beyond its" in text
    assert "force" not in text
    assert "support" not in json.loads(run(capsys, *settle_call(file, "contact"), "--json"))


def test_drive_takes_a_mode_and_continuous_steering(stiff, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, _ = stiff
    call = ["drive", "-t", "surface:step", "-r", file, "--path", "0,0 1.5,0.2", "--step", "0.05", "--json"]
    contact = json.loads(run(capsys, *call))
    rest = json.loads(run(capsys, *call, "--mode", "equilibrium", "--continuous-steering"))
    assert contact["status"]["JOINT_STOP"] > 0
    assert rest["status"]["WHEEL_LIFTED"] > 0
    limit = 0.2 + 1e-9
    assert max(abs(contact["extremes"]["bogie_left"][k]) for k in ("min", "max")) > limit
    assert max(abs(rest["extremes"]["bogie_left"][k]) for k in ("min", "max")) <= limit
