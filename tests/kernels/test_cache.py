"""Disk cache of compiled kernels: its key, its folders and its messages."""

from __future__ import annotations

import ast
import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import rockerbogie
from rockerbogie._kernels.jit import cache

CALLEE = """
from ..jit.decorators import njit

@njit
def callee(x: float) -> float:
    return {factor} * x
"""
CALLER = """
from ..jit.decorators import njit
from .callee import callee

@njit
def caller(x: float) -> float:
    return callee(x) + 0.25
"""
USE = """
from rockerbogie._kernels.jit.notice import compiled_count
from rockerbogie._kernels.model.caller import caller
print(caller(1.0), compiled_count())
"""
CAP_DAC_OVERRIDE, PR_CAPBSET_DROP = 1, 24


def obey_permissions() -> None:
    """Drop the superuser's right to write read-only files, for programs that start later."""
    ctypes.CDLL(None, use_errno=True).prctl(PR_CAPBSET_DROP, CAP_DAC_OVERRIDE, 0, 0, 0)


class Install:
    """Copy of the package with two kernels added, a caller and its callee."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.package, self.home = folder, folder / "site" / "rockerbogie", folder / "home"
        shutil.copytree(Path(rockerbogie.__file__).parent, self.package, ignore=shutil.ignore_patterns("__pycache__"))
        self.home.mkdir()
        self.callee = self.package / "_kernels" / "model" / "callee.py"
        self.callee.with_name("caller.py").write_text(CALLER)
        self.env = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA_", "XDG_"))}
        self.env |= {"PYTHONPATH": str(self.package.parent), "HOME": str(self.home), "PYTHONDONTWRITEBYTECODE": "1"}
        self.set_factor(2)

    def set_factor(self, factor: int) -> None:
        """Write the callee, always with the same size and modification time."""
        self.callee.write_text(CALLEE.format(factor=factor))
        os.utime(self.callee, (1e9, 1e9))

    def run(self, script: str = USE) -> subprocess.CompletedProcess[str]:
        """Run a script with this copy of the package."""
        drop = obey_permissions if sys.platform == "linux" and os.geteuid() == 0 else None
        return subprocess.run(
            [sys.executable, "-c", script], env=self.env, capture_output=True, text=True, check=True, preexec_fn=drop
        )

    def use(self) -> tuple[float, int]:
        """Call the caller with 1 in a new process; return its value and the count of compilations."""
        value, count = self.run().stdout.split()
        return float(value), int(count)

    def make_read_only(self) -> None:
        """Remove the right to write into the package."""
        for path in [self.package, *self.package.rglob("*")]:
            path.chmod(path.stat().st_mode & ~0o222)


@pytest.fixture
def install(tmp_path: Path) -> Iterator[Install]:
    """Return a separate install for each test."""
    if os.name != "posix":
        pytest.skip("uses POSIX permissions")
    copy = Install(tmp_path)
    yield copy
    for path in [copy.package, *copy.package.rglob("*")]:
        path.chmod(path.stat().st_mode | 0o200)


@pytest.mark.parametrize("chosen", [False, True], ids=["package", "NUMBA_CACHE_DIR"])
def test_changed_callee_gives_new_numbers(install: Install, chosen: bool) -> None:
    if chosen:
        install.env["NUMBA_CACHE_DIR"] = str(install.folder / "chosen")
    assert install.use() == (2.25, 2)
    assert install.use() == (2.25, 0)
    install.set_factor(3)
    assert install.use() == (3.25, 2)
    install.set_factor(2)
    assert install.use() == (2.25, 0)
    assert any((install.folder / "chosen").rglob("*.nbc")) == chosen
    assert any(install.package.rglob("*.nbc")) != chosen


def test_change_of_another_source_compiles_nothing(install: Install) -> None:
    assert install.use() == (2.25, 2)
    other = install.package / "_kernels" / "model" / "mass.py"
    other.write_text(other.read_text() + "\nCHANGED = True\n")
    assert install.use() == (2.25, 0)


@pytest.mark.parametrize("file", sorted(cache.IMPORTED), ids=lambda file: file.relative_to(cache.SOURCES).as_posix())
def test_imports_are_those_of_the_syntax_tree(file: Path) -> None:
    found = set()
    for node in ast.walk(ast.parse(file.read_bytes())):
        if isinstance(node, ast.Import):
            assert not any(name.name.startswith("rockerbogie") for name in node.names), "import kernels by relative imports"
        elif isinstance(node, ast.ImportFrom) and node.level:
            base = file.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            found |= {base.with_suffix(".py"), *(base / f"{name.name}.py" for name in node.names)}
        elif isinstance(node, ast.ImportFrom):
            assert not (node.module or "").startswith("rockerbogie"), "import kernels by relative imports"
    known = {source for source in cache.imports_of(file) if source.name != "__init__.py"}
    assert known == found & cache.IMPORTED.keys() - cache.MACHINERY


def test_only_the_newest_states_of_a_kernel_are_kept(install: Install) -> None:
    for factor in range(2, 4 + cache.KEPT_FILES):
        install.set_factor(factor)
        assert install.use() == (factor + 0.25, 2)
    names = [file.name for file in install.package.rglob("*.nbc")]
    assert len(names) == 2 * cache.KEPT_FILES
    assert install.use() == (factor + 0.25, 0)


def test_modification_times_do_not_matter(install: Install) -> None:
    assert install.use() == (2.25, 2)
    for file in install.package.rglob("*.py"):
        os.utime(file, (2e9, 2e9))
    assert install.use() == (2.25, 0)


def test_moved_package_keeps_its_compiled_kernels(install: Install) -> None:
    assert install.use() == (2.25, 2)
    moved = install.folder / "elsewhere" / "rockerbogie"
    moved.parent.mkdir()
    install.package.rename(moved)
    install.package, install.env["PYTHONPATH"] = moved, str(moved.parent)
    assert install.use() == (2.25, 0)


def test_read_only_install_uses_kernels_compiled_into_it(install: Install) -> None:
    assert install.use() == (2.25, 2)
    install.make_read_only()
    assert install.use() == (2.25, 0)
    assert not list(install.home.iterdir())


def test_read_only_install_stores_kernels_in_user_cache(install: Install) -> None:
    install.make_read_only()
    assert install.use() == (2.25, 2)
    assert install.use() == (2.25, 0)
    assert any(install.home.rglob("*.nbc"))


def test_without_any_writable_folder_kernels_run_and_a_warning_names_the_remedy(install: Install) -> None:
    install.make_read_only()
    install.home.chmod(0o555)
    done = install.run()
    assert done.stdout.split() == ["2.25", "2"]
    assert done.stderr.count("set NUMBA_CACHE_DIR to a writable folder") == 1
    refused = install.run("import rockerbogie as rb\ntry: rb.compile_kernels()\nexcept rb.RockerbogieError as e: print(e)")
    assert "set NUMBA_CACHE_DIR to a writable folder" in refused.stdout


def test_compiler_settings_and_processor_are_part_of_the_key(install: Install) -> None:
    assert install.use() == (2.25, 2)
    install.env["NUMBA_OPT"] = "1"
    assert install.use() == (2.25, 2)
    install.env["NUMBA_CPU_NAME"], install.env["NUMBA_CPU_FEATURES"] = "generic", ""
    assert install.use() == (2.25, 2)
    assert install.use() == (2.25, 0)


def test_damaged_file_is_compiled_again(install: Install) -> None:
    install.use()
    for file in install.package.rglob("*.nbc"):
        file.write_bytes(file.read_bytes()[:40])
    assert install.use() == (2.25, 2)
    assert install.use() == (2.25, 0)


def test_large_callee_is_called_by_address_and_loaded_from_its_own_file(install: Install) -> None:
    script = "from rockerbogie._kernels.jit import linking\nlinking.MOST_COPIED = 0\n" + USE
    assert install.run(script).stdout.split() == ["2.25", "2"]
    assert install.use() == (2.25, 0)
    (callee,) = install.package.rglob("*callee*.nbc")
    (caller,) = install.package.rglob("*caller*.nbc")
    assert callee.name.encode() in caller.read_bytes()
    callee.unlink()
    assert install.use() == (2.25, 2)
    install.set_factor(3)
    assert install.use() == (3.25, 2)


def test_import_deletes_nothing_and_compiling_keeps_the_newest_folders(install: Install) -> None:
    place = install.package / "_kernels" / "__pycache__"
    for k in range(cache.KEPT_FOLDERS + 2):
        old = place / f"{cache.PREFIX}{k:016x}"
        old.mkdir(parents=True)
        os.utime(old, (1e9 + k, 1e9 + k))
    install.run("import rockerbogie._kernels.model.caller")
    assert len(list(place.glob(cache.PREFIX + "*"))) == cache.KEPT_FOLDERS + 2
    install.use()
    left = {folder.name for folder in place.glob(cache.PREFIX + "*")}
    assert len(left) == cache.KEPT_FOLDERS
    assert {f"{cache.PREFIX}{k:016x}" for k in range(3, cache.KEPT_FOLDERS + 2)} <= left


def test_source_changed_after_import_is_not_stored(install: Install) -> None:
    script = f"""
import rockerbogie._kernels.jit.decorators
from pathlib import Path
callee = Path({str(install.callee)!r})
callee.write_text(callee.read_text().replace("2 * x", "3 * x"))
{USE}
"""
    assert install.run(script).stdout.split() == ["3.25", "2"]
    install.set_factor(2)
    assert install.use() == (2.25, 2)


def test_users_functions_are_not_announced_and_do_not_pause_the_collector(install: Install) -> None:
    pty = pytest.importorskip("pty", reason="needs a terminal")
    script = """
import gc, numba
from numba.core import event
from rockerbogie._kernels.jit import notice
from rockerbogie._kernels.model.caller import caller

class Listener(event.Listener):
    def on_start(self, found): pass
    def on_end(self, found): print(found.data["dispatcher"].py_func.__name__, gc.isenabled())

@numba.njit
def own(x):
    return 2.0 * x

with event.install_listener("numba:compile", Listener()):
    own(1.0)
    print(notice.compiled_count())
    {last}
print(gc.isenabled())
"""
    outputs = []
    for last in ("pass", "caller(1.0)"):
        ours, theirs = pty.openpty()
        command = [sys.executable, "-c", script.replace("{last}", last)]
        done = subprocess.run(command, env=install.env, stdout=subprocess.PIPE, stderr=theirs, text=True, check=True)
        os.close(theirs)
        try:
            said = os.read(ours, 4096).decode()
        except OSError:  # the end of a terminal on Linux
            said = ""
        os.close(ours)
        outputs.append((done.stdout.split(), said))
    assert outputs[0] == (["own", "True", "0", "True"], "")
    assert outputs[1][0][:3] == ["own", "True", "0"]
    assert outputs[1][0][3:5] == ["callee", "False"]
    assert outputs[1][0][-1] == "True"
    assert outputs[1][1].count("rockerbogie: compiling") == 1
