"""Tables of docs/forces.md and docs/stability.md that tools/compare_parked.py writes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
#: Largest difference of normal forces between the docs and a sample of their poses, of the weight in percent.
ROUNDED = 0.01


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    pytest.importorskip("mujoco", reason="needs mujoco")
    spec = importlib.util.spec_from_file_location("compare_parked", ROOT / "tools" / "compare_parked.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rows(tool: ModuleType, kind: str) -> dict[str, list[str]]:
    """Return the rows of a table by rover."""
    page, name = tool.TABLES[kind]
    text = (ROOT / "docs" / page).read_text().partition(f"<!-- {name} -->")[2].partition(f"<!-- end of {name} -->")[0]
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.split("\n") if line.startswith("|")]
    return {line[0]: line[1:] for line in lines[2:]}


def test_normal_forces_are_those_of_the_table(tool: ModuleType) -> None:
    table = rows(tool, "loads")
    assert set(table) == set(tool.ROVERS)
    assert all(float(cell.rstrip(" %")) <= 3.0 for row in table.values() for cell in row)
    worst, worst_sum = tool.compare_loads("sawppy", 2, 0)  # two of the 16 headings, and two slopes
    assert 100.0 * worst <= float(table["sawppy"][0].rstrip(" %")) + ROUNDED
    assert 100.0 * worst_sum <= float(table["sawppy"][1].rstrip(" %")) + ROUNDED


def test_rovers_tip_within_half_a_degree_in_all_azimuths_of_the_table(tool: ModuleType) -> None:
    table = rows(tool, "tips")
    assert set(table) == set(tool.ROVERS)
    for azimuths, tips, close, worst, slides, _ in table.values():
        assert int(tips) + int(slides) == int(azimuths) == 16
        assert int(tips) == int(close)
        assert float(worst.rstrip("°")) <= 0.5


def test_a_table_is_written_between_its_markers(tool: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tool, "DOCS", tmp_path)
    (tmp_path / "forces.md").write_text("before\n<!-- parked loads -->\nold\n<!-- end of parked loads -->\nafter\n")
    for table in ("one\n", "two\n"):
        tool.write_table("loads", table)
        text = (tmp_path / "forces.md").read_text()
        assert text == f"before\n<!-- parked loads -->\n\n{table}\n<!-- end of parked loads -->\nafter\n"
