"""Code in the documents runs, and tables in them equal those of the code."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

import rockerbogie as rb
from rockerbogie.settling.status import MEANING

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```python" in page.read_text(encoding="utf-8")], ids=lambda page: page.name
)
def test_python_in_the_pages_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    monkeypatch.chdir(tmp_path)  # outputs of examples go there
    names: dict[str, object] = {}
    for block in blocks:  # in order, in one namespace
        exec(compile(block, page.name, "exec"), names)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_to_files_lead_somewhere(page: Path) -> None:
    for target in re.findall(r"\]\(([^)#:\s]+)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
        assert (page.parent / target).exists(), f"{page.name} points to {target}"


def test_conventions_hold_the_status_table() -> None:
    page = (ROOT / "docs" / "conventions.md").read_text(encoding="utf-8")
    for status, (meaning, remedy) in MEANING.items():
        assert f"| {int(status)} | {status.name} | {meaning} | {remedy} |" in page


def test_every_public_name_is_in_the_reference() -> None:
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    assert {name for name in rb.__all__ if not re.search(rf":: rockerbogie\.(\w+\.)?{name}$", page, re.MULTILINE)} == {
        "__version__"
    }


def test_one_version_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert rb.__version__ == project["version"]
    assert f"\nversion: {rb.__version__}\n" in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"## [{rb.__version__}]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_status_page_holds_the_status_table() -> None:
    page = (Path(__file__).parents[1] / "docs" / "status.md").read_text()
    for status, (what, remedy) in MEANING.items():
        assert f"| {int(status)} | {status.name} | {what} | {remedy} |" in page
