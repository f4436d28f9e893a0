"""Golden outputs: a subset equals the stored file, and the comparison finds differences."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rockerbogie as rb

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tools"))
import golden_cases

import golden

#: 404 contact poses, 7 equilibrium poses, motion and exports of one rover.
SUBSET = (
    "contact/curiosity/fractal/cubic",
    "contact/sawppy/rocks/linear",
    "contact/custom/holes/cubic",
    "contact/rocky7/noise/linear",
    "equilibrium/curiosity/rocks/linear",
    "equilibrium/osr/fractal/cubic",
    "equilibrium/custom/boulders/linear",
    "motion/perseverance",
    "exports/custom",
)
VALUES = np.linspace(1.0, 2.0, 6 * 200).reshape(200, 6)


def test_stored_outputs_are_unchanged() -> None:
    if not golden.FILE.exists():
        pytest.skip(f"{golden.FILE.name} is absent: python tools/golden.py write makes it")
    command = [sys.executable, golden.__file__, "check", *(word for name in SUBSET for word in ("--only", name))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    compared = re.search(r"(\d+) outputs compared, 0 differ", done.stdout)
    assert compared is not None, done.stdout
    assert int(compared[1]) >= 100


def test_cases_cover_every_surface_and_preset() -> None:
    assert set(rb.surfaces.__all__) <= set(golden_cases.SURFACES)
    presets = Path(rb.__file__).parent / "rover" / "presets"
    if presets.is_dir():
        assert {folder.name for folder in presets.iterdir() if folder.is_dir()} == set(golden_cases.PRESETS)
    assert set(SUBSET) <= set(golden_cases.groups())


@pytest.fixture
def checked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Return `checked(before, after, exact)`, which compares outputs with a file of outputs."""

    def run(before: dict[str, Any], after: dict[str, Any], exact: bool = True) -> golden.Report:
        for outputs, act in ((before, golden.write), (after, None)):
            monkeypatch.setattr(golden_cases, "groups", lambda outputs=outputs: {"case": lambda: iter(outputs.items())})
            if act:
                act(tmp_path / "golden.npz", ["case"])
        return golden.check(golden.Golden(tmp_path / "golden.npz"), ["case"], exact)

    return run


def changed(row: int, by: Any) -> np.ndarray:
    """Return VALUES with one element of a row changed."""
    values = VALUES.copy()
    values[row, 3] = by(values[row, 3])
    return values


def up(value: float) -> float:
    """Return the next larger number."""
    return float(np.nextafter(value, np.inf))


@pytest.mark.parametrize("row", [0, 1, 8, 199])
@pytest.mark.parametrize("name", ["q", "gap"])
def test_one_bit_is_found_in_every_row(checked: Any, name: str, row: int) -> None:
    report = checked({name: VALUES}, {name: changed(row, up)})
    assert list(report.differing) == [f"case/{name}"]
    how = report.differing[f"case/{name}"]
    if name == "q" or row % golden.STRIDE == 0:
        assert "1 of" in how
        assert "2.22e-16" in how
        assert f"first at [{row}, 3]" in how
    else:
        low = row // golden.CHUNK * golden.CHUNK
        assert f"first of rows {low} to" in how


def test_equal_outputs_do_not_differ(checked: Any) -> None:
    outputs = {"q": VALUES, "gap": VALUES, "text": "a 1.5\nb", "flags": np.array([True, False]), "number": 3.0}
    report = checked(outputs, outputs)
    assert (report.compared, report.differing, report.extra) == (5, {}, [])


def test_other_environment_allows_small_differences_only(checked: Any) -> None:
    assert not checked({"q": VALUES, "t": "a 1.5"}, {"q": changed(9, up), "t": "a 1.5000000000001"}, exact=False).differing
    assert list(checked({"q": VALUES}, {"q": changed(9, lambda v: v + 1e-8)}, exact=False).differing) == ["case/q"]
    assert list(checked({"t": "a 1.5"}, {"t": "a 1.6"}, exact=False).differing) == ["case/t"]


def test_tip_margins_may_differ_by_their_accuracy_in_another_environment(checked: Any) -> None:
    stays = np.array([True, False])
    before = {"mars.cubic.tip_margin": VALUES, "mars.cubic.stays": stays}
    close = {"mars.cubic.tip_margin": changed(8, lambda v: v + 5e-5), "mars.cubic.stays": ~stays}
    assert len(checked(before, close).differing) == 2
    assert not checked(before, close, exact=False).differing
    far = {**before, "mars.cubic.tip_margin": changed(8, lambda v: v + 1e-3)}
    assert list(checked(before, far, exact=False).differing) == ["case/mars.cubic.tip_margin"]


@pytest.mark.parametrize("before, after", [(0.0, -0.0), (1.0, np.nan), (np.nan, 1.0), (np.inf, -np.inf)])
def test_zero_signs_and_nan_differ(checked: Any, before: float, after: float) -> None:
    report = checked({"q": changed(5, lambda v: before)}, {"q": changed(5, lambda v: after)})
    assert list(report.differing) == ["case/q"]


def test_every_nan_is_the_same(checked: Any) -> None:
    other = np.array([0x7FF8000000000001], dtype=np.uint64).view(float)[0]
    assert not checked({"q": changed(5, lambda v: np.nan)}, {"q": changed(5, lambda v: other)}).differing


def test_shapes_types_and_missing_outputs_differ(checked: Any) -> None:
    report = checked(
        {"shape": VALUES, "type": VALUES, "text": "one\ntwo", "gone": VALUES, "kind": VALUES},
        {"shape": VALUES[:-1], "type": VALUES.astype(np.float32), "text": "one\nthree", "kind": "one", "new": VALUES},
    )
    assert set(report.differing) == {f"case/{name}" for name in ("shape", "type", "text", "gone", "kind")}
    assert report.extra == ["case/new"]
