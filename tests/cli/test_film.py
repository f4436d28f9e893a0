"""Tests of --film: a film of a drive, and of a simulated drive."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from rockerbogie.cli import main
from rockerbogie.figures.theme import on_dark


@pytest.mark.parametrize("command", ["drive", "simulate"])
def test_a_film_of_a_run_is_written(command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = tmp_path / "new" / "run.gif"
    line = [command, "-t", "surface:plane", "--path", "0,0 0.1,0", "--speed", "0.05", "--film", str(film)]
    assert main(line) == 0
    assert str(film) in capsys.readouterr().out.split("\n")
    with Image.open(film) as pictures:
        assert pictures.n_frames > 10


def test_a_film_for_a_dark_page_has_dark_paper_and_light_ink(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = tmp_path / "run.gif"
    line = ["drive", "-t", "surface:plane", "--path", "0,0 0.1,0", "--speed", "0.05", "--film", str(film), "--theme", "dark"]
    assert main(line) == 0
    with Image.open(film) as pictures:
        shown = np.asarray(pictures.convert("RGB"), dtype=float)
    paper = shown[-2, 2]
    assert np.abs(paper - 255 * np.array(on_dark("white")[:3])).max() < 8
    assert np.abs(shown[2, 2] - paper).max() < 8, "sky and chart are on one page"
    chart = shown[-190:]
    assert chart[..., 0][np.ptp(chart, axis=-1) < 12].max() > 180, "axis labels are light"


def test_video_of_a_pose_goes_around_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    film = tmp_path / "pose.gif"
    assert main(["settle", "-t", "surface:rocks", "-r", "osr", "--video", str(film)]) == 0
    assert str(film) in capsys.readouterr().out.split("\n")
    with Image.open(film) as pictures:
        assert pictures.n_frames == 48
        first = np.asarray(pictures.convert("RGB"), dtype=float)
        pictures.seek(24)
        assert np.abs(np.asarray(pictures.convert("RGB"), dtype=float) - first).mean() > 5, "seen from the other side"


@pytest.mark.parametrize(("ending", "start"), [("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_pictures_are_written_for_print_and_for_dark_pages(
    ending: str, start: bytes, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["drive", "-t", "surface:sine", "--path", "0,0 0.2,0", "-o", str(tmp_path), "--format", ending]
    assert main(line) == 0
    capsys.readouterr()
    light = (tmp_path / f"profile.{ending}").read_bytes()
    assert light.startswith(start)
    assert main([*line, "--theme", "dark"]) == 0, "pictures of this package may be replaced"
    assert (tmp_path / f"profile.{ending}").read_bytes() != light
    assert not list(tmp_path.glob("*.png"))
    assert main([*line, "--theme", "blue"]) == 2


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
