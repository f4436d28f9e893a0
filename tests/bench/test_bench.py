"""The stopwatch runs, and says what it measured; how fast is no test's business."""

import json

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie import bench
from rockerbogie.bench import baselines, costs
from rockerbogie.bench.tables import tables
from rockerbogie.cli import main

GROWTH = {"poses": "poses", "nodes": "nodes", "cells": "radius_over_cell"}


def test_a_case_is_timed_beside_baselines_at_the_same_positions() -> None:
    case = bench.cases()[0]
    result = bench.run_case(case, poses=200, baseline_poses=2, drops=1)
    assert result.settled == 1.0
    assert result.worst_gap <= 1e-6
    assert result.within_1e_6 == 1.0
    assert 0 <= result.within_1e_9 <= 1
    assert result.us_p50 <= result.us_p99
    assert set(result.ratios) == {"hub", "point", "coarse", "rim", "mujoco"}
    assert all(np.isfinite(ratio) and ratio > 1 for ratio in result.ratios.values())
    gap = result.baseline_gap
    assert gap["rim"] < 1e-6 < 1e-4 < min(gap["coarse"], gap["hub"])
    assert result.worst_gap < gap["rim"]
    assert all(share == 1.0 for share in result.baseline_solved.values()), "smooth ground is easy for all of them"
    assert result.poses_per_s == pytest.approx(1e6 / result.us)


def test_every_case_settles_at_nearly_all_positions() -> None:
    for case in bench.cases():
        x, y, yaw = bench.places(case, 100)
        status = rb.settle(case.rover, case.terrain, x, y, yaw).status
        assert (np.isin(status, (0, 3))).mean() >= 0.97, case.name


def test_a_raster_is_one_more_case_without_positions_over_missing_data(tmp_path) -> None:
    rasterio = pytest.importorskip("rasterio", reason="rasterio writes the raster")
    z = np.zeros((60, 80), dtype="float32")
    z[:, 40:] = np.nan
    file = tmp_path / "dem.tif"
    with rasterio.open(
        file, "w", driver="GTiff", width=80, height=60, count=1, dtype="float32", nodata=np.nan, crs="EPSG:32633",
        transform=rasterio.transform.from_origin(5e5, 4e6, 1.0, 1.0),
    ) as out:  # fmt: skip
        out.write(z, 1)
    case = bench.cases(rb.Terrain.from_raster(file, interpolation="linear"))[-1]
    assert case.name == "dem, whole tread"
    x, y, _ = bench.places(case, 300)
    assert np.isfinite(case.terrain.height(x, y)).all()


def test_a_simulated_drop_that_does_not_come_to_rest_gives_no_time(monkeypatch: pytest.MonkeyPatch) -> None:
    case = bench.cases()[0]
    x, y, yaw = bench.places(case, 1)
    monkeypatch.setattr(baselines, "MOST_BLOCKS", 1)
    drop = baselines.drop_baseline(case, x, y, yaw)
    assert np.isnan(drop.seconds)
    assert drop.solved == 0


def test_pinocchio_without_its_call_cost_is_faster_than_with_it() -> None:
    pytest.importorskip("pinocchio", reason="Pinocchio (pin) is what Jacobians are timed against; it is not installed")
    found = baselines.pinocchio_seconds(rb.load_rover("elhami-dashti"), 200, 5)
    assert found is not None
    assert 0 < found[0] < found[1]


def test_memory_is_the_size_of_the_pose_arrays() -> None:
    found = costs.memory(40_000)
    assert found["kept_mb"] == pytest.approx(49, abs=3), "six numbers and a status"
    assert found["kept_mb"] <= found["peak_mb"] < 100


@pytest.fixture(scope="module")
def figures() -> dict:
    """Figures of one small case; fixed numbers stand for parts that are not timed here."""
    from dataclasses import asdict

    return {
        "schema": bench.SCHEMA, "machine": bench.machine(),
        "cases": [asdict(bench.run_case(bench.cases()[0], poses=100, baseline_poses=1, drops=1))],
        "calls": {"single_us": 15.0, "empty_us": 12.0, "first_settle_s": 0.8},
        "jacobians": {"poses": 2000, "us": 0.1, "many": 10, "us_many": 0.2, "us_many_new_memory": 0.3},
        "memory": {"poses": 10, "kept_mb": 49.0, "peak_mb": 73.0},
        "growth": {name: [{key: 1.3, "us": 1.0}] for name, key in GROWTH.items()},
    }  # fmt: skip


def test_results_are_json_and_format_as_tables(figures: dict, tmp_path) -> None:
    again = json.loads(json.dumps(figures))
    made = tables(again, {"smooth cubic, thin disc": 12.0})
    assert made[0].rows[0][0] == "smooth cubic, thin disc"
    assert made[2].headings[-1] == "before"
    assert made[2].rows[0][-1] == "12"
    for table in made:
        assert all(len(row) == len(table.headings) for row in table.rows)
        lines = table.markdown().splitlines()
        assert len({line.count("|") for line in lines[2:]}) == 1


def test_a_baseline_that_fails_gives_no_ratio(figures: dict) -> None:
    case = {**figures["cases"][0], "baseline_solved": {"hub": 1.0, "point": 0.4, "coarse": 1.0, "rim": 0.0, "mujoco": 1.0}}
    row = dict(zip((made := tables({**figures, "cases": [case]})[2]).headings, made.rows[0], strict=True))
    assert row["point"].endswith("*")
    assert row["rim"] == "fails"


@pytest.mark.parametrize("content", ["{}", "not json", '{"cases": [{"name": 1}]}'])
def test_a_foreign_file_to_compare_with_is_refused(content: str, tmp_path, capsys) -> None:
    file = tmp_path / "old.json"
    file.write_text(content)
    assert main(["bench", "--compare", str(file)]) == 2
    assert "was not written by" in capsys.readouterr().err


def test_results_of_another_schema_are_not_compared(figures: dict, tmp_path, capsys) -> None:
    file = tmp_path / "old.json"
    file.write_text(json.dumps({**figures, "schema": bench.SCHEMA - 1}))
    assert main(["bench", "--compare", str(file)]) == 2
    assert "save it again" in capsys.readouterr().err


def test_a_missing_file_to_compare_with_is_refused(tmp_path, capsys) -> None:
    assert main(["bench", "--compare", str(tmp_path / "none.json")]) == 2
    assert "--save" in capsys.readouterr().err


def test_too_few_poses_are_refused(capsys) -> None:
    assert main(["bench", "--poses", "3"]) == 2
    assert "--poses is 3" in capsys.readouterr().err


def test_tables_are_written_between_markers(figures: dict, tmp_path, capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "figures", lambda *_, **__: iter([("all", 1, figures)]))
    page = tmp_path / "page.md"
    page.write_text("before\n<!-- bench -->\nold\n<!-- end of bench -->\nafter\n")
    kept = tmp_path / "kept.json"
    assert main(["bench", "--markdown", str(page), "--save", str(kept)]) == 0
    text = page.read_text()
    assert text.startswith("before\n<!-- bench -->\n")
    assert text.endswith("<!-- end of bench -->\nafter\n")
    assert "| smooth cubic, thin disc |" in text
    assert "old" not in text
    assert main(["bench", "--markdown", str(page), "--compare", str(kept)]) == 0
    assert "before" in capsys.readouterr().out
    assert page.read_text().count("| smooth cubic, thin disc |") == 4, "one run's tables: times, residuals, ratios, errors"
    page.write_text("no marks")
    assert main(["bench", "--markdown", str(page)]) == 2
    assert "end of bench" in capsys.readouterr().err
    assert main(["bench", "--markdown", str(tmp_path / "none.md")]) == 2
