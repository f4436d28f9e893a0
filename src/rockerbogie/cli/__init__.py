"""Command line: `rockerbogie COMMAND …`.

To add a command, write a module here (`cli/thing.py`) with one typed function whose docstring is its help, and add a line
to `COMMANDS`: name → (module:function, one line for the list of commands). The module is imported only when its command
runs, so that `rockerbogie --help` stays fast. A module with sub-commands has a `cyclopts.App(name="thing")` instead of the
function. Rules for all commands:

- Options and printed text are in degrees, and state this. All other code uses SI and rad.
- Bad input raises a `RockerbogieError` whose message is one clear sentence; `main` prints it and exits 2.
- Long work shows `cli.common.progress(...)` on stderr, if stderr is a terminal.
- Results that other programs read have `--json`; print them with `cli.common.print_json`.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Sequence
from typing import Any

from .interrupts import repeat_dropped

COMMANDS: dict[str, tuple[str, str]] = {
    "reproduce": ("rockerbogie.cli.reproduce:reproduce", "Reproduce section III of the paper: figures, data, animation, report."),
    "settle": ("rockerbogie.cli.settle:settle", "Compute the pose of a rover at one position, and show it."),
    "loads": ("rockerbogie.cli.loads:loads", "Compute wheel loads, required friction, motor torques and the tip margin."),
    "climb": ("rockerbogie.cli.climb:climb", "Drive a rover over a step, a ditch or stairs: friction and torque needed, limits."),
    "drive": ("rockerbogie.cli.drive:drive", "Drive a rover along a path quasi-statically."),
    "simulate": ("rockerbogie.cli.drive:simulate", "Simulate a drive in MuJoCo's rigid-body dynamics, and compare."),
    "predict": ("rockerbogie.cli.predict:predict", "Predict where a rover goes open loop: slip, forces, torques, energy."),
    "map": ("rockerbogie.cli.map:map_", "Map where a rover can drive on a whole terrain: GeoTIFF for QGIS, Zarr or NetCDF."),
    "plan": ("rockerbogie.cli.plan:plan", "Compute the least-cost route over a map from `rockerbogie map`."),
    "odometry": ("rockerbogie.cli.odometry:odometry", "Compute 3-D odometry from a log of joint sensors."),
    "fit-soil": ("rockerbogie.cli.fit_soil:fit_soil", "Fit a slip curve to a drive's log, forecast its slip, and warn."),
    "ros": ("rockerbogie.cli.ros:ros", "Run a ROS 2 node: odometry, wheel commands and state of a rover."),
    "validate": ("rockerbogie.cli.validate:validate", "Compare predicted with logged attitude, with an uncertainty band."),
    "benchmark": ("rockerbogie.cli.benchmark:app", "Score attitudes predicted by this or another program against recorded ones."),
    "lab": ("rockerbogie.cli.lab:lab", "Open a page in the browser: move, drive and change a rover on terrain."),
    "bench": ("rockerbogie.cli.bench:bench", "Time settling, as ratios to the paper's method and MuJoCo in the same run."),
    "compile": ("rockerbogie.cli.compile:compile_", "Compile all kernels for this machine in advance."),
    "rovers": ("rockerbogie.cli.rovers:app", "List rovers, show one, write a rover file, or import a robot file."),
    "soils": ("rockerbogie.cli.soils:soils_", "List soils, show one, draw the forces on a wheel in it."),
    "slip-table": ("rockerbogie.cli.slip_table:slip_table_", "Tabulate slip by slope, heading and soil, as CSV for operators."),
    "export": ("rockerbogie.cli.export:export", "Export a rover as URDF, SDF, MJCF or TOML, or with terrain as a Gazebo world."),
}

EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return 0 if done, 2 on bad input, 130 if interrupted.

    Args:
        argv: arguments; None for those of the process.

    Returns:
        Exit code: 0 done, 1 a negative result, 2 bad input (one sentence on stderr), 130 interrupted.
    """
    try:
        with repeat_dropped():
            code = _run(sys.argv[1:] if argv is None else list(argv))
        sys.stdout.flush()
    except KeyboardInterrupt:
        print("\ninterrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except BrokenPipeError:  # the reader has closed the pipe: write no more, also when Python ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except SystemExit as end:  # rich raises this when the pipe is closed while it prints
        if not isinstance(end.__context__, BrokenPipeError):
            raise
        return 0
    return code


def _run(argv: list[str]) -> int:
    """Run one command; return its exit code."""
    import cyclopts

    from ..errors import RockerbogieError

    app = cyclopts.App(
        name="rockerbogie",
        help="Kinematics of six-wheeled rocker-bogie rovers on terrain: poses, drives, maps, odometry.",
        version=_version,
        version_flags=["--version"],
        help_format="markdown",
        suppress_keyboard_interrupt=False,
    )
    for name, (target, summary) in COMMANDS.items():  # the chosen command shows its whole docstring in --help
        app.command(target, name=name, help=None if argv[:1] == [name] else summary)
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
    """Print one sentence on stderr, and return the exit code for bad input."""
    print(f"rockerbogie: {' '.join(sentence.split())}", file=sys.stderr)
    return EXIT_BAD_INPUT


def _note(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a warning on stderr."""
    print(f"rockerbogie: note: {message}", file=sys.stderr)


def _version() -> str:
    """Return the version of the installed package."""
    from importlib.metadata import version

    return version("rockerbogie")
