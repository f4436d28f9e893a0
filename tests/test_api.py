"""Public names: returned types are exported, and docs/api.md documents every name."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator
from pathlib import Path

import rockerbogie as rb

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = Path(str(rb.__file__)).parent
#: Class -> reason why it is returned but not exported.
INTERNAL = {"Ground": "what kernels take: Terrain.packed is not for users"}


def classes() -> set[str]:
    """Return the names of all classes of the package."""
    return {
        node.name
        for file in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    }


def results(name: str, value: object) -> Iterator[tuple[str, str]]:
    """Yield name and annotation of everything that a public name returns or holds."""
    if inspect.isclass(value):
        for key, member in vars(value).items():
            function = getattr(member, "fget", None) or getattr(member, "func", None) or getattr(member, "__func__", member)
            if not key.startswith("_") and inspect.isfunction(function):
                yield f"{name}.{key}", str(function.__annotations__.get("return", ""))
        for key, annotation in vars(value).get("__annotations__", {}).items():
            if not key.startswith("_"):
                yield f"{name}.{key}", str(annotation)
    elif inspect.isfunction(value):
        yield name, str(value.__annotations__.get("return", ""))


def test_every_returned_type_is_exported() -> None:
    known = classes()
    missing = {
        word: where
        for name in rb.__all__
        for where, annotation in results(name, getattr(rb, name))
        for word in re.findall(r"[A-Za-z_]\w*", annotation)
        if word in known and word not in rb.__all__ and word not in INTERNAL
    }
    assert not missing


def test_the_scan_sees_results_of_all_kinds() -> None:
    assert ("settle", "Pose") in list(results("settle", rb.settle))
    seen = dict(results("Pose", rb.Pose))
    assert seen["Pose.contacts"] == "Contacts"
    assert seen["Pose.rover"] == "Rover"
    assert dict(results("Path", rb.Path))["Path.sample"] == "PathSample"


def test_every_public_name_is_in_the_reference() -> None:
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    documented = set(re.findall(r":: rockerbogie\.(?:\w+\.)?(\w+)$", page, re.MULTILINE))
    assert set(rb.__all__) - documented == {"__version__"}
    assert documented <= set(rb.__all__)


def test_old_names_are_the_new_ones() -> None:
    assert rb.Noise is rb.SensorNoise
    assert rb.Plan is rb.Route
    assert rb.Import is rb.ImportResult


def test_every_progress_function_takes_done_and_total() -> None:
    found = {}
    for name in rb.__all__:
        function = getattr(rb, name)
        if inspect.isfunction(function) and "progress" in inspect.signature(function).parameters:
            annotation = function.__annotations__["progress"].removesuffix(" | None")
            alias = getattr(inspect.getmodule(function), annotation, annotation)
            found[name] = re.sub(r"(typing|collections\.abc)\.", "", str(alias))
    assert set(found) >= {"simulate", "traversability", "write_map", "validate"}
    assert all(kind.startswith("Callable[[int, int], ") for kind in found.values()), found
