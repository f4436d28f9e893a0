"""The command line: `rockerbogie COMMAND …`.

To add a command, write a module here (`cli/thing.py`) holding one typed function whose docstring is its help, and give
it a line in `COMMANDS`: name → (module:function, one line for the list of commands). The module is imported only when
its command runs, so it may import what it likes at its top, and `rockerbogie --help` stays quick. A module with
sub-commands gives a `cyclopts.App(name="thing")` in place of the function. Rules for all of them:

- SI and radians stop here: options and printed text are in degrees, and say so.
- Bad input raises a `RockerbogieError` whose message is one clear sentence; `main` prints it and exits 2.
- Long work shows `cli.common.progress(...)`: on stderr, and only where someone is watching.
- Results a machine may want have `--json`; print them with `cli.common.print_json`.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from typing import Any

COMMANDS: dict[str, tuple[str, str]] = {
    "reproduce": ("rockerbogie.cli.reproduce:reproduce", "Reproduce section III of the paper: figures, data, animation, report."),
    "settle": ("rockerbogie.cli.settle:settle", "Let a rover settle at one place, and show how it sits there."),
    "drive": ("rockerbogie.cli.drive:drive", "Drive a rover along a path, and show what it goes through."),
    "simulate": ("rockerbogie.cli.drive:simulate", "The same drive in MuJoCo's rigid-body dynamics, compared with ours."),
    "map": ("rockerbogie.cli.map:map_", "Where a rover can go on a whole terrain: GeoTIFF for QGIS, Zarr or NetCDF."),
    "plan": ("rockerbogie.cli.plan:plan", "The least-cost way over such a map, as the rover can turn."),
    "odometry": ("rockerbogie.cli.odometry:odometry", "Where a log of joint sensors says the rover went."),
    "validate": ("rockerbogie.cli.validate:validate", "Predicted against logged attitude, with a band for what is not known."),
    "bench": ("rockerbogie.cli.bench:bench", "How fast settling is, as ratios to the paper's own way in the same run."),
    "compile": ("rockerbogie.cli.compile:compile_", "Compile all kernels for this machine, in advance."),
    "rovers": ("rockerbogie.cli.rovers:app", "The rovers there are; one with its dimensions; a new one; one from a robot file."),
    "export": ("rockerbogie.cli.export:export", "A rover as URDF, SDF, MJCF or TOML, or on ground as a Gazebo world."),
}

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return 0 if done, 2 on bad input, 130 if interrupted.

    Args:
        argv: arguments; None for those of the process.

    Returns:
        Exit code: 0 done, 1 a negative answer, 2 bad input (one sentence on stderr), 130 interrupted.
    """
    try:
        code = _run(sys.argv[1:] if argv is None else list(argv))
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader of our output has left: nothing more to say to it, nor as Python ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SystemExit as end:  # rich's answer to the same, where it was printing
        if not isinstance(end.__context__, BrokenPipeError):
            raise
        return 0
    return code


def _run(argv: list[str]) -> int:
    import cyclopts

    from ..errors import RockerbogieError

    app = cyclopts.App(
        name="rockerbogie",
        help="How a rocker-bogie rover sits, tilts and drives on a piece of ground.",
        version=_version,
        version_flags=["--version"],
        help_format="markdown",
        suppress_keyboard_interrupt=False,
    )
    for name, (target, summary) in COMMANDS.items():
        app.command(target, name=name, help=summary)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _note
            result = app(argv, exit_on_error=False, print_error=False, result_action="return_value")
    except cyclopts.CycloptsError as error:
        return _complain(str(error))
    except RockerbogieError as error:
        return _complain(str(error))
    except BrokenPipeError:
        raise
    except OSError as error:
        return _complain(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    return result if isinstance(result, int) else 0


def _complain(sentence: str) -> int:
    print(f"rockerbogie: {' '.join(sentence.split())}", file=sys.stderr)
    return EXIT_BAD_INPUT


def _note(message: Warning | str, *_: Any, **__: Any) -> None:
    print(f"rockerbogie: note: {message}", file=sys.stderr)


def _version() -> str:
    from importlib.metadata import version

    return version("rockerbogie")
