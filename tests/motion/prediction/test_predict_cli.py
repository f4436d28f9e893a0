"""Command `rockerbogie predict`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rockerbogie.cli import main

RAMP = ["predict", "--terrain", "surface:ramp", "--rover", "osr", "--path", "-1,0 1,0", "--step", "0.1"]


def test_a_drive_is_written_and_summarised(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*RAMP, "--friction", "0.8", "-o", str(tmp_path / "out"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["end"] == "REACHED_END"
    assert result["motor_work"] == pytest.approx(result["height_gain"] + result["dissipation"], abs=1.0)
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        ["map.png", "prediction.csv", "prediction.nc", "prediction.png"]
    )


def test_a_rover_that_stays_in_place_is_reported(capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["predict", "--terrain", "surface:rocks?k=0.05&seed=1&size=30", "--rover", "perseverance", "--soil", "dry-sand"]
    assert main([*argv, "--path", "-6,0 -2,0", "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert 0.0 < result["stays_from"] < 0.7 * result["duration"]
    assert result["distance"] < 1.0
    assert main([*argv, "--path", "-6,0 -2,0"]) == 0
    assert "it stays there: its wheels turn" in " ".join(capsys.readouterr().out.split())
    assert main([*argv, "--path", "-6,0 -5.9,0", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["stays_from"] is None


def test_a_drive_that_ends_early_exits_1(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*RAMP, "--friction", "0.8", "--torque", "0.05"]) == 1
    shown = capsys.readouterr()
    assert "motors are too weak" in " ".join((shown.out + shown.err).split())


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ([], "--friction"),
        (["--friction", "-1"], "friction is -1"),
        (["--soil", "custard"], "custard"),
        (["--friction", "0.5", "--speed", "0"], "speed is 0"),
        (["--friction", "0.5", "--start", "500,0"], "does not start"),
    ],
)
def test_wrong_input_exits_2_with_a_sentence(options: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*RAMP, *options]) == 2
    assert text in capsys.readouterr().err
