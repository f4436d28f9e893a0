"""Command `rockerbogie compile`: all kernels compiled in advance."""

from __future__ import annotations

from ..bench.compilation import compile_kernels
from .common import Json, print_json, progress


def compile_(*, json: Json = False) -> None:
    """Compile all kernels for this machine and store them, so that later commands start fast.

    They are stored in NUMBA_CACHE_DIR if it is set, else inside the package, or in your cache folder if the package is
    read-only. Kernels that are already stored are not compiled again.

    Parameters
    ----------
    json
        Print the folder, the number of kernels compiled and the seconds as JSON.
    """
    with progress() as bar:
        task = bar.add_task("compiling kernels", total=None)
        compiled = compile_kernels(lambda done, total: bar.update(task, completed=done, total=total))
    if json:
        print_json(compiled._asdict())
    elif compiled.kernels:
        print(f"{compiled.kernels} kernels compiled in {compiled.seconds:.0f} s: {compiled.folder}")
    else:
        print(f"all kernels were compiled already: {compiled.folder}")
