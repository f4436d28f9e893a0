"""Reproduction of section III: its files, its self-contained report and its verdicts."""

from __future__ import annotations

import base64
import csv
import json
import re
from contextlib import redirect_stdout
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from PIL import Image

import rockerbogie as rb
from rockerbogie.bench.paper import reproduce as paper
from rockerbogie.bench.paper.claims import Claim, Crossing, check_claims
from rockerbogie.bench.paper.report import ErrorRow, Picture, write_report
from rockerbogie.cli import main
from support.helpers import assert_close

FILES = {
    "figure6.png", "figure7.png", "figure8.png", "figure9.png", "crossing.gif", "report.html",
    "model.nc", "model.csv", "simulation.nc", "simulation.csv",
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    """Return the folder that `rockerbogie reproduce` wrote, and its printed JSON."""
    folder = tmp_path_factory.mktemp("paper") / "out"
    with redirect_stdout(StringIO()) as printed:
        assert main(["reproduce", "-o", str(folder), "--json"]) == 0
    return folder, json.loads(printed.getvalue())


@pytest.fixture(scope="module")
def crossing() -> Crossing:
    """Return the model's run with a station every 4 mm."""
    rover, terrain = rb.load_rover(paper.ROVER), rb.surfaces.paper()
    run = rb.drive(rover, terrain, rb.Path.straight((0, 0), 0, paper.DISTANCE), step=0.004)
    return Crossing.of(rover, terrain, run, paper.BUMP_START, paper.BUMP_START + paper.BUMP_LENGTH)


class Page(HTMLParser):
    """An HTML page: the sources it loads, its links and its text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loads: list[str] = []
        self.links: list[str] = []
        self.open: list[str] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        held = {name: value or "" for name, value in attrs}
        if tag not in ("img", "meta", "br"):
            self.open.append(tag)
        if tag in ("img", "script", "iframe", "source", "video"):
            self.loads.append(held.get("src", ""))
        if tag == "link":
            self.loads.append(held.get("href", ""))
        if tag == "a":
            self.links.append(held["href"])
        if tag == "img":
            assert len(held["alt"]) > 20

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag, f"</{tag}> closes something else"

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "title"):
            self.words.append(data)


def test_all_files_are_written(made: tuple[Path, dict[str, object]]) -> None:
    folder, _ = made
    assert {f.name for f in folder.iterdir()} == FILES
    for n in (6, 7, 8, 9):
        with Image.open(folder / f"figure{n}.png") as image:
            assert image.width > 1000
            assert len(image.convert("RGB").quantize(64).getcolors()) > 30
    with Image.open(folder / "crossing.gif") as film:
        assert film.n_frames >= 48
        first = np.asarray(film.convert("RGB"), dtype=int)
        film.seek(film.n_frames // 2)
        assert (np.abs(np.asarray(film.convert("RGB"), dtype=int) - first).max(axis=-1) > 60).mean() > 0.01, "nothing moves"


def printed_rows(printed: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Return the printed errors by channel."""
    return {row["channel"]: row for row in printed["errors"]}


def test_model_keeps_the_limits(made: tuple[Path, dict[str, object]]) -> None:
    folder, printed = made
    rows = printed_rows(printed)
    assert set(rows) == {"roll", "pitch", "rocker", "bogie left", "bogie right", "z"}
    with (
        xr.open_dataset(folder / "model.nc", engine="h5netcdf") as model,
        xr.open_dataset(folder / "simulation.nc", engine="h5netcdf") as sim,
    ):
        assert "MuJoCo" in sim.attrs["source"]
        assert "MuJoCo" not in model.attrs["source"]
        pose = rb.settle(
            rb.load_rover(paper.ROVER), rb.surfaces.paper(), sim["x"].values, sim["y"].values, sim["yaw"].values,
            steering=sim["steering"].values,
        )  # fmt: skip
        for name, limit in {"roll": 0.01, "pitch": 0.03, "rocker": 0.01}.items():
            apart = np.degrees(getattr(pose, name) - sim[name].values)
            rms = float(np.sqrt(np.mean(apart**2)))
            assert 0 < rms <= limit
            assert np.abs(apart).max() <= 0.15
            assert_close(rows[name]["rms"], rms, 1e-9, "deg", "the table states this difference")
        apart = np.degrees(pose.bogie - sim["bogie"].values)
        assert (np.sqrt(np.mean(apart**2, axis=0)) <= 0.04).all()
        assert np.abs(apart).max() <= 0.15
        assert np.sqrt(np.mean((pose.z - sim["z"].values) ** 2)) <= 1.5e-3
        assert float(sim["x"].max()) > 3.5, "the simulated rover reaches the end"


def test_the_bounds_of_the_readme_hold(made: tuple[Path, dict[str, object]]) -> None:
    """The simulation differs between processors, so the README states bounds."""
    readme = (Path(__file__).resolve().parents[3] / "README.md").read_text(encoding="utf-8")
    table = re.search(r"\| below \|(.*)\|\n\|[-|]+\|\n\| RMS \|(.*)\|\n\| maximum \|(.*)\|\n", readme)
    assert table is not None
    heads, *bounds = ([cell.strip() for cell in line.split("|")] for line in table.groups())
    assert heads == ["roll", "pitch", "rocker", "bogies", "height"]
    rows = printed_rows(made[1])
    channels = [["roll"], ["pitch"], ["rocker"], ["bogie left", "bogie right"], ["z"]]
    for kind, cells in zip(("rms", "worst"), bounds, strict=True):
        for names, cell in zip(channels, cells, strict=True):
            bound = float(re.fullmatch(r"([\d.]+)(°| mm)", cell)[1])  # type: ignore[index]
            found = max(rows[name][kind] for name in names)
            assert bound / 10 < found < bound, f"{kind} of {names}: {found:g}, and the README states {cell}"


def test_csv_and_netcdf_hold_the_same_values(made: tuple[Path, dict[str, object]]) -> None:
    folder, _ = made
    for name in ("model", "simulation"):
        with open(folder / f"{name}.csv", encoding="utf-8", newline="") as stream:
            rows = list(csv.DictReader(stream))
        with xr.open_dataset(folder / f"{name}.nc", engine="h5netcdf") as data:
            for column, values in (("pitch [rad]", data["pitch"]), ("bogie_left [rad]", data["bogie"].sel(side="left"))):
                assert_close([float(row[column]) for row in rows], values.values, 1e-9, "rad", "the same run, ten digits")


def test_report_is_self_contained(made: tuple[Path, dict[str, object]]) -> None:
    folder, printed = made
    text = (folder / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"https?://|url\(|@import|<script", text)
    page = Page(text)
    assert len(page.loads) == 5
    for source in page.loads:
        kind, _, content = source.partition(";base64,")
        assert kind in ("data:image/png", "data:image/gif")
        Image.open(BytesIO(base64.b64decode(content, validate=True))).verify()
    assert {folder / link for link in page.links} <= set(folder.iterdir())
    words = " ".join(" ".join(page.words).split())
    for pair in printed["claims"]:  # type: ignore[attr-defined]
        model, simulated = pair["model"], pair["simulation"]
        verdicts = [
            f"{of}: {'true' if claim['holds'] else 'not true'}" for of, claim in (("model", model), ("simulation", simulated))
        ]
        after = words.partition(model["says"])[2]
        assert re.search(rf"^.{{20,600}}{verdicts[0]}\W+{verdicts[1]}", after), model["says"]
    for row in printed["errors"]:  # type: ignore[attr-defined]
        assert f"{row['channel']} {row['rms']:.4f} {row['rms_limit']:g} {row['worst']:.4f}" in words


def test_all_statements_hold_except_one(crossing: Crossing) -> None:
    """The left contact angle does not jump: this hill, unlike the ramp, starts with slope 0."""
    claims = check_claims(crossing)
    assert [c.figure for c in claims] == [7, 7, 8, 8, 8, 9, 9, 9, 9]
    assert [c.says for c in claims if not c.holds] == [
        "The left contact angle changes abruptly where the front wheel reaches the bump."
    ]


def by_words(crossing: Crossing, words: str) -> Claim:
    (found,) = [c for c in check_claims(crossing) if words in c.says]
    return found


def test_statements_can_be_untrue(crossing: Crossing) -> None:
    """Each verdict depends on the data: changed data change it."""
    c, x = crossing, crossing.x
    swapped = replace(c, bogie=c.bogie[:, ::-1], contact_angle=c.contact_angle[:, [1, 0, 3, 2, 5, 4]])
    spoiled = {
        "Pitch and roll turn negative": [replace(c, pitch=-c.pitch), replace(c, roll=-c.roll), replace(c, roll=c.roll * 0)],
        "Pitch stays negative": [replace(c, pitch=-c.pitch), replace(c, pitch=c.pitch - 3 * (np.abs(c.pitch) > 0.1))],
        "right bogie's angle is zero": [replace(c, bogie=c.bogie + 0.2), replace(c, bogie=c.bogie * 0)],
        "harmonic": [swapped, replace(c, bogie=c.bogie * (x < 1.8)[:, None])],
        "goes through a transition": [replace(c, bogie=c.bogie * 0 + np.sin(3 * x)[:, None])],
        "right contact angle changes abruptly": [swapped, replace(c, contact_angle=c.contact_angle * 0.2)],
        "tends to a positive value": [
            replace(c, contact_angle=-c.contact_angle),
            replace(c, contact_angle=c.contact_angle * 0 - 2),
        ],
        "right contact angle is zero": [replace(c, contact_angle=c.contact_angle + 2), swapped],
    }
    for words, cases in spoiled.items():
        assert by_words(c, words).holds
        for k, case in enumerate(cases):
            assert not by_words(case, words).holds, f"{words}: case {k}"
    assert by_words(swapped, "The left contact angle changes abruptly").holds


def test_limits_can_be_missed(tmp_path: Path) -> None:
    row = ErrorRow("roll", "deg", 0.02, 0.1, 0.01, 0.15)
    assert not row.within
    assert not replace(row, rms=0.005, worst=0.2).within
    assert not replace(row, rms=np.nan).within
    assert replace(row, rms=0.01, worst=0.15).within
    assert not paper.Reproduction([row], [], tmp_path).close

    picture = tmp_path / "p.png"
    Image.new("RGB", (4, 4)).save(picture)
    claim = Claim(7, "A < b & c.", True, "1 < 2")
    write_report(
        tmp_path / "r.html", lead="<lead>", errors=[row], claims=[(claim, replace(claim, holds=False, because="2 > 1"))],
        pictures=[Picture(picture, "four by four black pixels", "four")], facts={}, data={},
    )  # fmt: skip
    text = " ".join(Page((tmp_path / "r.html").read_text(encoding="utf-8")).words)
    assert "beyond" in text
    assert "0 of 1 error limits met" in text
    assert "A < b & c." in text
    assert "simulation: not true" in text
    assert "2 > 1" in text, "where they differ, the simulation's reason is given too"
