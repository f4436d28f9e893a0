"""The stopwatch runs, and says what it measured; how fast is no test's business."""

import json

import numpy as np
import pytest

from rockerbogie import bench
from rockerbogie.cli import main


def test_a_case_is_timed_beside_the_paper_s_way_on_the_same_places() -> None:
    case = bench.cases()[0]
    result = bench.run_case(case, poses=200, baseline_poses=2)
    assert result.settled == 1.0
    assert result.worst_gap <= 1e-6
    assert 0 < result.us_p50 <= result.us_p99
    assert all(np.isfinite(ratio) and ratio > 1 for ratio in result.ratios.values())


def test_every_case_settles_nearly_everywhere() -> None:
    for case in bench.cases():
        x, y, yaw = bench.places(case, 100)
        status = bench.settle(case.rover, case.terrain, x, y, yaw).status
        assert (np.isin(status, (0, 3))).mean() >= 0.97, case.name


@pytest.mark.parametrize("content", ["{}", "not json", '{"cases": [{"name": 1}]}'])
def test_a_foreign_file_to_compare_with_is_refused(content: str, tmp_path, capsys) -> None:
    file = tmp_path / "old.json"
    file.write_text(content)
    assert main(["bench", "--compare", str(file)]) == 2
    assert "was not written by" in capsys.readouterr().err


def test_a_missing_file_to_compare_with_is_refused(tmp_path, capsys) -> None:
    assert main(["bench", "--compare", str(tmp_path / "none.json")]) == 2
    assert "--save" in capsys.readouterr().err


def test_figures_are_plain_json() -> None:
    result = bench.run_case(bench.cases()[0], poses=100, baseline_poses=1)
    again = json.loads(json.dumps(bench.as_json([result])))
    assert again[0]["name"] == "smooth cubic, thin disc"
