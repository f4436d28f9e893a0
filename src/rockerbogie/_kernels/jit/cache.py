"""Disk cache of compiled kernels, keyed by all that their machine code depends on.

Numba's own cache checks only the source file that holds a function, so that a caller keeps the old code of a changed
callee. Here the key of a kernel is a hash of its source file and of all kernel sources that this file imports, directly or
not, with the versions of numba and llvmlite, the processor and the compiler's settings. Versions, processor and settings
have their own folder, and each kernel and signature one file, written atomically: there is no index that two processes
could make inconsistent. `linking` loads them.
"""

from __future__ import annotations

import functools
import hashlib
import os
import pickle
import re
import shutil
import uuid
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import llvmlite
import numba
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.misc.appdirs import AppDirs

from . import linking, notice

#: Folder that holds all kernel sources.
SOURCES = Path(__file__).resolve().parents[1]
#: First part of the names of the cache folders, one for each compiler, processor and set of settings.
PREFIX = "rockerbogie-"
#: Cache folders kept in one place, the newest: a new one replaces the oldest.
KEPT_FOLDERS = 5
#: Files kept of one kernel and signature, the newest: one for each state of its sources.
KEPT_FILES = 3
#: Number of the form of the stored files. Another form gets another folder.
FORM = 2
#: Sources that store, load and announce compiled code and do not change it.
MACHINERY = {SOURCES / "jit" / name for name in ("cache.py", "linking.py", "notice.py")}
#: Relative import: dots, module, names.
IMPORT = re.compile(rb"^ *from (\.+)([\w.]*) import (\([^)]*\)|[^\n(]*)", re.MULTILINE)
#: Settings of numba that change machine code and are not part of the processor's description.
SETTINGS = ("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "BOUNDSCHECK", "USING_SVML", "DEBUGINFO_DEFAULT", "LLVM_REFPRUNE_PASS")


#: Contents of all kernel sources, as they are imported: this module is imported before every kernel.
IMPORTED = {file: file.read_bytes() for file in sorted(SOURCES.rglob("[!.]*.py"))}


@functools.cache
def imports_of(file: Path) -> frozenset[Path]:
    """Return the kernel sources that a kernel source imports, without `MACHINERY`.

    Args:
        file: a key of `IMPORTED`.
    """
    found = set()
    for dots, module, names in IMPORT.findall(IMPORTED[file]):
        base = file.parents[len(dots) - 1].joinpath(*module.decode().split("."))
        for target in (base, *(base / name for name in re.findall(r"\w+", names.decode()))):
            found |= {target.with_suffix(".py"), target / "__init__.py"} & IMPORTED.keys()
    return frozenset(found - MACHINERY)


@functools.cache
def sources_of(file: Path) -> list[Path]:
    """Return the kernel sources that the code of a kernel depends on.

    These are its own file and all that it imports, directly or not. The file of a kernel outside `_kernels` may import
    in any form: it depends on all kernel sources.

    Args:
        file: source that holds the kernel.
    """
    used, ahead = set(), [file] if file in IMPORTED else list(IMPORTED)
    while ahead:
        source = ahead.pop()
        if source not in used:
            used.add(source)
            ahead.extend(imports_of(source))
    return sorted(used)


@functools.cache
def hash_of_sources(file: Path) -> str:
    """Return the SHA-256 hash of all sources that the code of a kernel depends on, hexadecimal.

    Args:
        file: source that holds the kernel.
    """
    digest = hashlib.sha256(b"" if file in IMPORTED else file.read_bytes())
    for source in sources_of(file):
        content = IMPORTED[source]
        digest.update(f"{source.relative_to(SOURCES).as_posix()} {len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


@functools.cache
def cache_folders() -> tuple[Path, ...]:
    """Return the folders that compiled kernels are read from, in order.

    Kernels are written to the last one, if it is writable. The folders are NUMBA_CACHE_DIR if it is set, then the package
    itself, then the user's cache folder. The list ends at the first one that is writable, so that kernels compiled into a
    read-only install are found there.
    """
    processor = numba.core.registry.cpu_target.target_context.codegen().magic_tuple()
    settings = [str(getattr(numba.config, name, None)) for name in SETTINGS]
    key = repr((FORM, numba.__version__, llvmlite.__version__, processor, settings))
    name = PREFIX + hashlib.sha256(key.encode()).hexdigest()[:16]
    places = [Path(numba.config.CACHE_DIR)] if numba.config.CACHE_DIR else []
    places += [SOURCES / "__pycache__", Path(AppDirs("rockerbogie", appauthor=False).user_cache_dir)]
    count = next((n + 1 for n, place in enumerate(places) if is_writable(place)), len(places))
    return tuple(place / name for place in places[:count])


def is_writable(folder: Path) -> bool:
    """Return True if a folder is writable, or can be made where it does not exist.

    Args:
        folder: any path.

    Returns:
        False if it is a file, or if its nearest existing parent is not writable.
    """
    while not folder.exists() and folder != folder.parent:
        folder = folder.parent
    return folder.is_dir() and os.access(folder, os.W_OK | os.X_OK)


def _remove_oldest(paths: Iterable[Path], kept: int) -> None:
    """Remove the oldest of some files or folders. Processes that still use them compile again.

    Args:
        paths: files and folders.
        kept: number of those that stay, the newest.
    """
    found = []
    for path in paths:
        try:
            found.append((path.stat().st_mtime, path))
        except OSError:  # removed by another process
            continue
    for _, path in sorted(found)[:-kept]:
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)


class KernelCache:
    """Disk cache of one kernel, a file for each signature.

    It has the interface of numba's `FunctionCache`.
    """

    _cannot_write = False

    def __init__(self, dispatcher: Any) -> None:
        """Take name, code and closure of a kernel, which identify it in the cache.

        Args:
            dispatcher: result of `numba.njit`.
        """
        function = dispatcher.py_func
        self._code, self._cells = function.__code__, function.__closure__ or ()
        self._name = f"{function.__module__.removeprefix('rockerbogie.')}.{function.__qualname__}".replace("<locals>", "")
        self._file = Path(self._code.co_filename).resolve()
        self._sources = hash_of_sources(self._file)
        self._fresh: Any = None  # stored form of the result compiled last, to be written
        self._enabled = True

    @property
    def cache_path(self) -> str:
        """Folder that compiled kernels are written to."""
        return str(cache_folders()[-1])

    def enable(self) -> None:
        """Read and write compiled kernels, which is the default."""
        self._enabled = True

    def disable(self) -> None:
        """Neither read nor write compiled kernels."""
        self._enabled = False

    def flush(self) -> None:
        """Do nothing: a file is valid as long as its key is."""

    def _key(self, sig: Any) -> Any:
        """Return the key of a compiled kernel among those of a folder.

        Args:
            sig: types of the arguments.

        Returns:
            Name, signature, hash of its sources, and hash of its code and closure.
        """
        code = self._code.co_firstlineno, self._code.co_code, dumps(tuple(cell.cell_contents for cell in self._cells))
        return self._name, sig, self._sources, hashlib.sha256(repr(code).encode()).hexdigest()

    def _stem(self, sig: Any) -> str:
        """Return the part of the names of a kernel's files that is the same for all its sources.

        Args:
            sig: types of the arguments.
        """
        return f"{self._name}-{hashlib.sha256(repr(sig).encode()).hexdigest()[:8]}"

    def _file_name(self, key: Any) -> str:
        """Return the name of the file that holds the kernel of a key.

        Args:
            key: result of `_key`.
        """
        return f"{self._stem(key[1])}-{hashlib.sha256(repr(key).encode()).hexdigest()[:16]}.nbc"

    def holds(self, sig: Any) -> bool:
        """Return True if the cache has a file of the compiled kernel.

        Args:
            sig: types of the arguments.
        """
        name = self._file_name(self._key(sig))
        return any((folder / name).exists() for folder in cache_folders())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Load a compiled kernel.

        Args:
            sig: types of the arguments.
            target_context: numba's context of the processor.

        Returns:
            The compile result, or None if the cache does not hold it.
        """
        if not self._enabled:
            return None
        rtsys.initialize(target_context)  # all that loading needs of `refresh`, which takes 0.3 s; numba's compiler calls that
        return _load(self._file_name(self._key(sig)), target_context)

    def take(self, result: Any) -> Any:
        """Replace a fresh compile result by the form that the cache holds.

        `save_overload` then writes that form.

        Args:
            result: numba's compile result.

        Returns:
            The result that is to be called and linked into callers; the same result if it cannot be stored.
        """
        self._fresh = None
        if result.library.has_dynamic_globals or result.lifted:
            return result
        context = result.target_context
        name = self._file_name(self._key(result.signature.args))
        self._fresh = linking.reduce(result, name)
        taken = linking.load(context, self._fresh, name)
        context.remove_user_function(result.entry_point)
        context.insert_user_function(taken.entry_point, taken.fndesc, [taken.library])
        return taken

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write the result compiled last, unless a source of it changed since its import.

        Args:
            sig: types of the arguments.
            data: the compile result, unused: `take` has reduced it.
        """
        if not self._enabled or self._fresh is None:
            return
        if any(not file.exists() or file.read_bytes() != IMPORTED[file] for file in sources_of(self._file)):
            return
        key, folder = self._key(sig), cache_folders()[-1]
        content = dumps(self._fresh)
        part = folder / f"{uuid.uuid4().hex}.part"
        try:
            if not folder.exists():
                folder.mkdir(parents=True, exist_ok=True)
                _remove_oldest(folder.parent.glob(PREFIX + "*"), KEPT_FOLDERS)
            part.write_bytes(content)
            part.replace(folder / self._file_name(key))
            _remove_oldest(folder.glob(f"{self._stem(sig)}-*.nbc"), KEPT_FILES)
        except OSError as error:
            part.unlink(missing_ok=True)
            self._warn(folder, error)

    @staticmethod
    def _warn(folder: Path, error: OSError) -> None:
        """Warn, once in a process, that compiled kernels are not stored.

        Args:
            folder: folder that cannot be written to.
            error: cause.
        """
        if not KernelCache._cannot_write:
            KernelCache._cannot_write = True
            message = f"compiled kernels cannot be stored in {folder} ({error.strerror}), so that every process compiles them"
            warnings.warn(f"{message} again: set NUMBA_CACHE_DIR to a writable folder", RuntimeWarning, stacklevel=2)


def _load(name: str, target_context: Any) -> Any:
    """Load a compiled kernel, and those that it calls by address.

    Args:
        name: of its file.
        target_context: numba's context of the processor.

    Returns:
        The compile result, or None if a file is missing or damaged: the kernel is to be compiled again.
    """
    if name in linking.loaded:
        return linking.loaded[name]
    for folder in cache_folders():
        try:
            stored = pickle.loads((folder / name).read_bytes())
        except (OSError, EOFError, pickle.UnpicklingError):
            continue
        if all(_load(callee, target_context) for callee in stored.callees):
            return linking.load(target_context, stored, name)
    return None


def enable_cache(dispatcher: Any) -> None:
    """Give a dispatcher a cache on disk, and its compilation a notice.

    Args:
        dispatcher: result of `numba.njit` without `cache`; changed.
    """
    cache = KernelCache(dispatcher)
    compiler = dispatcher._compiler
    compile_fresh = compiler._compile_core
    compiler._compile_core = lambda args, return_type: cache.take(compile_fresh(args, return_type))
    dispatcher._cache = cache
    notice.announce(dispatcher)
