"""Command `rockerbogie soils`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rockerbogie.cli import main


def test_soils_are_listed_shown_and_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["soils"]) == 0
    assert "dry-sand" in capsys.readouterr().out
    assert main(["soils", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["dry-sand"]["cohesion"] == 1040.0
    picture = tmp_path / "sand.png"
    assert (
        main(["soils", "dry-sand", "--load", "300", "--gravity", "mars", "--slip-angle", "10", "--json", "-o", str(picture)]) == 0
    )
    record = json.loads(capsys.readouterr().out)
    assert record["forces"]["status"] == ["COMPUTED"] * len(record["forces"]["slip"])
    assert picture.stat().st_size > 10_000
    assert main(["soils", "dry-sand", "--load", "1e7"]) == 0
    assert "cannot carry" in capsys.readouterr().out


@pytest.mark.parametrize(
    "arguments, words",
    [
        (["mud"], "no soil named"),
        (["dry-sand", "--radius", "250"], "radius is 250 m"),
        (["-o", "x.png"], "one soil"),
        (["dry-sand", "-o", "x.txt"], "should end in"),
        (["dry-sand", "--gravity", "pluto"], "gravity"),
    ],
)
def test_wrong_calls_exit_2(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["soils", *arguments]) == 2
    assert words in capsys.readouterr().err
