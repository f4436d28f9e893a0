"""Tests of --film: a film of a drive, and of a simulated drive."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from rockerbogie.cli import main


@pytest.mark.parametrize("command", ["drive", "simulate"])
def test_a_film_of_a_run_is_written(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = tmp_path / "new" / "run.gif"
    line = [command, "-t", "surface:plane", "--path", "0,0 0.1,0", "--speed", "0.05", "--film", str(film)]
    assert main(line) == 0
    assert str(film) in capsys.readouterr().out.split("\n")
    with Image.open(film) as pictures:
        assert pictures.n_frames > 10


@pytest.mark.parametrize("command", ["drive", "simulate"])
def test_a_film_of_another_kind_is_refused_before_any_work(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, "-t", "surface:plane", "--film", str(tmp_path / "run.avi")]) == 2
    assert "is not the name of a film: end it in .gif or .mp4" in capsys.readouterr().err
    theirs = tmp_path / "run.gif"
    theirs.write_bytes(b"GIF89a of another program")
    assert main([command, "-t", "surface:plane", "--film", str(theirs)]) == 2
    assert "--force" in capsys.readouterr().err
