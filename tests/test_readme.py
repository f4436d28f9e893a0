"""Commands of the README, run in its order in an empty folder."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from rockerbogie.cli import COMMANDS, main

README = Path(__file__).resolve().parents[1] / "README.md"
#: Commands that take minutes, run until they are stopped, or need logs from Mars: their own tests run them.
SLOW = ("reproduce", "lab", "ros", "bench", "compile", "benchmark", "fit-soil")


def commands() -> list[list[str]]:
    """Return the command lines of the README's section on the command line."""
    text = README.read_text(encoding="utf-8").split("## Command line\n", 1)[1]
    block = re.search(r"```sh\n(.*?)```", text, re.DOTALL)
    assert block is not None
    return [shlex.split(line, comments=True)[1:] for line in block[1].splitlines() if line.startswith("rockerbogie ")]


def test_every_command_is_shown() -> None:
    assert {argv[0] for argv in commands()} == set(COMMANDS)


def test_extras_are_those_of_the_project() -> None:
    import tomllib

    project = tomllib.loads((README.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    shown = set(re.findall(r"^\| `(\w+)` \|", README.read_text(encoding="utf-8"), re.MULTILINE))
    assert shown == set(project["optional-dependencies"]) - {"dev", "docs"}


def test_the_examples_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    rasterio = pytest.importorskip("rasterio", reason="needs the geo extra")
    for name, extra in (("pyogrio", "geo"), ("zarr", "scale"), ("rosbags", "ros")):
        pytest.importorskip(name, reason=f"needs the {extra} extra")
    monkeypatch.chdir(tmp_path)
    x, y = np.meshgrid(np.arange(101) * 0.1, np.arange(81) * 0.1)  # gentle hills, 10 m by 8 m
    z = 0.15 * np.sin(x / 1.5) * np.cos(y / 2)
    profile = {"driver": "GTiff", "height": 81, "width": 101, "count": 1, "dtype": "float32", "crs": "EPSG:32633"}
    with rasterio.open("dem.tif", "w", **profile, transform=rasterio.Affine(0.1, 0, -0.05, 0, -0.1, 8.05)) as raster:
        raster.write(z[::-1].astype("float32"), 1)
    for argv in commands():
        if argv[0] in SLOW:
            assert main([argv[0], "--help"]) == 0
            continue
        assert main(argv) == 0, (argv, capsys.readouterr().err)
        capsys.readouterr()
        for option in ("-o", "--film", "--html"):
            if option in argv:
                assert Path(argv[argv.index(option) + 1]).exists(), argv
