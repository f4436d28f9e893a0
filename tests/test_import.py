"""Public names of `import rockerbogie`, and the modules that importing them loads."""

from __future__ import annotations

import ast
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from types import ModuleType

import pytest

import rockerbogie as rb

HEAVY = {
    "numpy", "numba", "scipy.linalg", "scipy.optimize", "scipy.interpolate", "scipy.ndimage", "scipy.spatial", "xarray", "pandas",
    "matplotlib", "mujoco", "rasterio", "h5netcdf", "rich", "cyclopts", "PIL",
}  # fmt: skip


def loaded_by(code: str) -> set[str]:
    """Return the heavy packages that a fresh interpreter has loaded after running `code`."""
    report = f"{code}\nimport sys\nprint(*({HEAVY!r} & set(sys.modules)))"
    return set(subprocess.run([sys.executable, "-c", report], check=True, capture_output=True, text=True).stdout.split())


@pytest.mark.parametrize(
    ("code", "allowed"),
    [
        ("import rockerbogie", set()),
        (
            "import rockerbogie as rb; rb.Rover, rb.Path, rb.Status, rb.wheel_frames, rb.load_rover('curiosity')",
            {"numpy", "numba"},
        ),
        ("import rockerbogie as rb; rb.settle, rb.Pose, rb.wheel_jacobians, rb.wheel_commands, rb.drive", {"numpy", "numba"}),
        ("import rockerbogie as rb; rb.Terrain.from_array([[0, 0], [0, 0]], 1, interpolation='linear')", {"numpy", "numba"}),
        ("import rockerbogie as rb; rb.simulate, rb.compare, rb.to_mjcf, rb.to_urdf, rb.surfaces", {"numpy", "numba"}),
        ("import rockerbogie.cli", set()),
    ],
)
def test_a_name_loads_no_more_than_it_needs(code: str, allowed: set[str]) -> None:
    assert loaded_by(code) <= allowed


@pytest.mark.parametrize("name", rb.__all__)
def test_every_public_name_is_there(name: str) -> None:
    value = getattr(rb, name)
    assert value is getattr(rb, name), "the same object each time"
    assert isinstance(value, ModuleType) == (name in ("surfaces", "obstacles", "plot"))
    assert name in dir(rb)


def test_type_checkers_see_the_same_names() -> None:
    """The imports for type checkers equal the table for the interpreter."""
    tree = ast.parse(Path(str(rb.__file__)).read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING")
    seen = {
        alias.asname: node.module or ""
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if alias.asname == alias.name
    }
    assert seen == rb._EXPORTS


def test_no_module_shares_its_name_with_a_public_function() -> None:
    modules = {path.stem for path in Path(str(rb.__file__)).parent.iterdir()}
    assert not modules & set(rb.__all__), "importing the module would replace the function"


@pytest.mark.parametrize("name", ["rover.model", "terrain.surfaces", "settling.settle", "motion.drive", "logs.odometry"])
def test_a_public_name_stays_when_its_module_is_imported_first(name: str) -> None:
    code = (
        f"import rockerbogie.{name}, rockerbogie as rb; assert callable(rb.settle) and callable(rb.drive) and rb.surfaces.plane"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("former", ["paper.baseline", "rotations", "scene.rover_mesh", "soil.laws"])
def test_a_documented_module_keeps_its_former_name(former: str) -> None:
    """A former name gives the same module as the present one, with a warning that names it."""
    top, dot, rest = former.partition(".")
    now = f"rockerbogie.{rb._MOVED[top]}{dot}{rest}"
    code = (
        f"import importlib, warnings\nwith warnings.catch_warnings(record=True) as caught:\n    warnings.simplefilter('always')\n"
        f"    former = importlib.import_module('rockerbogie.{former}')\n"
        f"assert former is importlib.import_module('{now}')\n"
        f"assert 'rockerbogie.{former} has moved to {now}' in map(str, (w.message for w in caught)), caught"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_an_unknown_name_raises() -> None:
    with pytest.raises(AttributeError, match="module 'rockerbogie' has no attribute 'setle'"):
        _ = rb.setle  # type: ignore[attr-defined]


def test_the_version_is_the_packages() -> None:
    assert rb.__version__ == version("rockerbogie")


def test_errors_have_one_base_class() -> None:
    for error in (rb.RoverError, rb.TerrainError, rb.PathError):
        assert issubclass(error, rb.RockerbogieError)
    assert issubclass(rb.RockerbogieError, ValueError)


@pytest.mark.parametrize(
    "call",
    [
        lambda: rb.settle("curiosity", rb.surfaces.plane(), 0, 0),
        lambda: rb.drive("curiosity", rb.surfaces.plane(), rb.Path.straight((0, 0), 0.0, 1.0)),
        lambda: rb.simulate("curiosity", rb.surfaces.plane(), rb.Path.straight((0, 0), 0.0, 1.0)),
        lambda: rb.wheel_frames("curiosity", 0.0, (0.0, 0.0)),
        lambda: rb.to_urdf("curiosity"),
        lambda: rb.to_sdf("curiosity"),
        lambda: rb.to_mjcf("curiosity"),
    ],
)
def test_a_rovers_name_is_not_a_rover(call) -> None:
    with pytest.raises(rb.RockerbogieError, match=r"rover is 'curiosity', not a Rover: load one with rockerbogie\.load_rover"):
        call()


def test_a_list_is_not_a_path() -> None:
    with pytest.raises(rb.RockerbogieError, match="path is .*waypoints"):
        rb.drive(rb.load_rover("curiosity"), rb.surfaces.plane(), [(0, 0), (1, 0)])  # type: ignore[arg-type]
