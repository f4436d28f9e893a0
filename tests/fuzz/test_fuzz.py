"""Small counts of mutated rasters and logs.

`tools/fuzz_files.py` runs the full counts; tests/rover has those of robot files.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from fuzz import mutate_logs, mutate_rasters


def test_mutated_rasters() -> None:
    pytest.importorskip("rasterio", reason="needs the geo extra")
    tally = mutate_rasters.run(100, seed=7)
    assert min(tally["read"], tally["refused"]) > 10, "both ways are met"


def test_mutated_logs() -> None:
    pytest.importorskip("rosbags", reason="needs the ros extra")
    tally = mutate_logs.run(80, seed=7)
    assert min(tally["right"], tally["refused"]) > 10, "both ways are met"


@pytest.mark.parametrize("kind", mutate_logs.KINDS)
def test_unmutated_logs_give_the_lap(kind: str, tmp_path: Path) -> None:
    """The rules of the mutated logs hold for the original."""
    pytest.importorskip("rosbags", reason="needs the ros extra")
    file = tmp_path / kind
    if kind == "log.csv":
        rows = zip(*mutate_logs.columns().values(), strict=True)
        file.write_text("\n".join([",".join(mutate_logs.columns()), *(",".join(map(repr, map(float, row))) for row in rows)]))
    else:
        file.write_bytes(mutate_logs.netcdf() if kind == "log.nc" else mutate_logs.bag(kind == "log.db3"))
    assert mutate_logs.check(file)[0] == "right"
