"""The layer table of docs/design.md is the import contract of pyproject.toml."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
CONTRACTS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]


def contract(container: str) -> list[list[str]]:
    """Return the layers of a container, highest first, each with its modules sorted."""
    layers = next(c["layers"] for c in CONTRACTS if c["type"] == "layers" and c["containers"] == [container])
    return [sorted(re.findall(r"\w+", layer)) for layer in layers]


def table(heading: str) -> list[list[str]]:
    """Return the modules in the second column of the table below a heading, row by row."""
    section = PAGE.split(f"## {heading}\n", 1)[1].split("\n## ", 1)[0]
    rows = [line.split("|") for line in section.splitlines() if re.match(r"\| \d", line)]
    assert [int(row[1]) for row in rows] == list(range(len(rows), 0, -1)), "layers are numbered from the top down"
    return [sorted(re.findall(r"`(\w+)/?`", row[2])) for row in rows]


def test_the_table_of_packages_is_the_contract() -> None:
    assert table("Layers") == contract("rockerbogie")


def test_the_table_of_kernels_is_the_contract() -> None:
    assert table("Layers of the kernels") == contract("rockerbogie._kernels")


def test_every_module_named_in_the_page_exists() -> None:
    package = ROOT / "src" / "rockerbogie"
    modules = re.findall(r"`((?:rockerbogie\.)?(?:jit|model|search|solve|simd|verify|settling|motion)\.\w+)", PAGE)
    assert len(modules) > 15
    for name in modules:
        parts = name.removeprefix("rockerbogie.").split(".")
        places = [package.joinpath(*parts), package.joinpath("_kernels", *parts)]
        assert any(place.with_suffix(".py").exists() or place.is_dir() for place in places), name
