"""Gravity outside 0.001 to 100 m/s², in every function and command that takes it."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.gravity import check_gravity
from rockerbogie.terrain.soil.fit import WheelTrials, fit_wheel_trials, trial_residuals
from rockerbogie.terrain.soil.table import tabulate

ROVER = rb.load_rover("perseverance")
FLAT = rb.Terrain.from_array(np.zeros((41, 41)), 0.25, (-5.0, -5.0))
PATH = rb.Path.straight((0.0, 0.0), 0.0, 0.1)
SOIL = rb.load_soil("dry-sand")
TRIALS = WheelTrials(0.1, 0.1, 0.0, [20.0], rim=[0.1], vx=[0.08], vy=[0.0], drawbar=[1.0])
CALLS = {
    "settle": lambda g: rb.settle(ROVER, FLAT, 0.0, 0.0, gravity=g),
    "wheel_loads": lambda g: rb.wheel_loads(rb.settle(ROVER, FLAT, 0.0, 0.0), gravity=g),
    "stability": lambda g: rb.stability(rb.settle(ROVER, FLAT, 0.0, 0.0), gravity=g),
    "climb": lambda g: rb.climb(ROVER, rb.obstacles.step(0.1), friction=0.8, gravity=g),
    "limits_of": lambda g: rb.limits_of(ROVER, friction=0.8, gravity=g),
    "drive": lambda g: rb.drive(ROVER, FLAT, PATH, gravity=g),
    "predict": lambda g: rb.predict(ROVER, FLAT, None, PATH, friction=0.8, gravity=g),
    "slip_table": lambda g: rb.slip_table("grc-1", [0.0], rover=ROVER, gravity=g),
    "traversability": lambda g: rb.traversability(ROVER, FLAT, headings=1, gravity=g),
    "wheel_soil_forces": lambda g: rb.wheel_soil_forces(SOIL, 0.1, 0.1, 20.0, 0.2, gravity=g),
    "tabulate": lambda g: tabulate(SOIL, 0.1, 0.1, (1.0, 100.0), gravity=g),
    "trial_residuals": lambda g: trial_residuals(SOIL, TRIALS, gravity=g),
    "fit_wheel_trials": lambda g: fit_wheel_trials(SOIL, TRIALS, ("cohesion",), gravity=g),
}


WRONG = [(9810.0, "mm/s²"), (371, "mm/s²"), (0.0, "0.001 to 100 m/s²"), (-9.81, "0.001 to 100"), (np.nan, "gravity is nan")]


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_gravity_in_other_units_is_refused(call) -> None:
    for wrong, text in WRONG:
        with pytest.raises(rb.RockerbogieError, match=text):
            call(wrong)


WRONG_TYPES = [None, "mars", "9.81", True, np.True_, [9.81, 3.7], 10**400, 1j, np.inf]


@pytest.mark.parametrize("wrong", WRONG_TYPES, ids=lambda wrong: f"{type(wrong).__name__} {wrong}"[:12])
def test_other_than_a_number_is_refused(wrong: object) -> None:
    with pytest.raises(rb.RockerbogieError, match="gravity is"):
        check_gravity(wrong)  # type: ignore[arg-type]


def test_gravity_of_planets_and_limits_are_returned() -> None:
    for value in (*rb.GRAVITY.values(), 0.0057, 24.79, 1e-3, 100, np.float32(3.5)):
        assert check_gravity(value) == value


COMMANDS = [
    ["loads", "--terrain", "surface:plane"], ["climb", "perseverance", "--step", "0.1"], ["map", "surface:plane", "-o", "map.nc"],
    ["drive", "--terrain", "surface:plane"], ["predict", "--terrain", "surface:plane", "--friction", "0.8"],
    ["slip-table", "grc-1"], ["soils", "grc-1"], ["lab", "--no-browser"],
]  # fmt: skip


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_commands_refuse_gravity_in_other_units(command: list[str], capsys, monkeypatch, tmp_path) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*command, "--gravity", "9810"]) == 2
    assert "gravity is 9810 m/s² (is it in mm/s²?)" in " ".join(capsys.readouterr().err.split())
