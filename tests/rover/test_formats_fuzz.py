"""A few hundred spoilt robot files (tests/fuzz/mutate.py runs as many as one likes): a rover that can be, or one sentence."""

from __future__ import annotations

import pytest

from fuzz.mutate import run


@pytest.mark.parametrize("seed", [101, 102])
def test_spoilt_files(seed: int) -> None:
    tally = run(300, seed)
    assert tally["refused"] + tally["taken"] == 300
    assert min(tally["refused"], tally["taken"]) > 30, "both ways are met"
