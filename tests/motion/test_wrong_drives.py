"""Wrong input of drives: numbers, commands, soils and terrain to refuse or to report."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.terrain.soil.forces import ForceStatus

ROVER = rb.load_rover("curiosity")
FLAT = rb.Terrain.from_array(np.zeros((41, 41)), 0.5)
PATH = rb.Path.straight((10.0, 10.0), 0.0, 0.2)
#: No positive finite number.
NO_NUMBERS = [0.0, -1.0, np.nan, np.inf, "0.1", [0.1, 0.2], np.array([0.1]), 1j, {}]


def table(time: object, rate: object = 0.1, steering: object = 0.0) -> xr.Dataset:
    """Return commands of six equal wheels."""
    times = np.asarray(time, dtype=float)
    columns = {name: np.broadcast_to(np.asarray(v, dtype=float), times.shape) for name, v in {"r": rate, "s": steering}.items()}
    return xr.Dataset(
        {
            "wheel_rate": (("time", "wheel"), np.tile(columns["r"][:, None], 6)),
            "steering": (("time", "wheel"), np.tile(columns["s"][:, None], 6)),
        },
        {"time": times},
    )


@pytest.mark.parametrize("value", [*NO_NUMBERS, None], ids=repr)
@pytest.mark.parametrize("name", ["speed", "step"])
def test_drive_refuses_what_is_no_positive_number(name: str, value: object) -> None:
    with pytest.raises(rb.RockerbogieError, match=f"{name} is"):
        rb.drive(ROVER, FLAT, PATH, **{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
@pytest.mark.parametrize("name", ["speed", "step", "record", "gravity"])
def test_predict_refuses_what_is_no_positive_number(name: str, value: object) -> None:
    with pytest.raises(rb.RockerbogieError, match=f"{name} is"):
        rb.predict(ROVER, FLAT, None, PATH, friction=0.8, **{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
@pytest.mark.parametrize("name", ["speed", "interval"])
def test_simulate_refuses_what_is_no_positive_number(name: str, value: object) -> None:
    pytest.importorskip("mujoco")
    with pytest.raises(rb.RockerbogieError, match=f"{name} is"):
        rb.simulate(ROVER, FLAT, PATH, **{name: value})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda: rb.drive(ROVER, FLAT, PATH, step=1e-9), "longer step"),
        (lambda: rb.predict(ROVER, FLAT, None, PATH, friction=0.8, step=1e-9), "longer step"),
        (lambda: rb.predict(ROVER, FLAT, np.zeros((40_000, 3)), rb.Path.straight((0, 0), 0.0, 10.0), friction=0.8), "GB"),
        (lambda: rb.predict(ROVER, FLAT, None, PATH, friction=0.8, speed=20.0), "mm/s"),
        (lambda: rb.predict(ROVER, FLAT, None, PATH, soil="dry-sand", grousers=[0.01, 0.02]), "grouser height"),
        (lambda: rb.predict(ROVER, FLAT, None, PATH, soil="dry-sand", grousers=15.0), "grouser height"),
        (lambda: rb.drive(ROVER, FLAT, PATH, steering="left"), "steering is 'left'"),  # type: ignore[arg-type]
        (lambda: rb.drive(ROVER, FLAT, PATH, steering=np.zeros(5)), "steering has shape"),
        (lambda: rb.drive(ROVER, FLAT, PATH, steering=np.full(6, np.nan)), "steering"),
    ],
)  # fmt: skip
def test_numbers_off_by_far_give_a_sentence(call, text: str) -> None:
    with pytest.raises(rb.RockerbogieError, match=text):
        call()


def test_simulate_refuses_a_drive_without_end() -> None:
    pytest.importorskip("mujoco")
    with pytest.raises(rb.RockerbogieError, match="higher speed"):
        rb.simulate(ROVER, FLAT, PATH, 1e-9)


@pytest.mark.parametrize(
    ("commands", "text"),
    [
        (table([0.0, np.nan, 2.0]), "later than the last"),
        (table([0.0, 1.0, np.inf]), "finite"),
        (table([0.0, 2.0, 1.0]), "later than the last"),
        (table([0.0, 1.0, 1.0]), "later than the last"),
        (table([0.0]), "1 times"),
        (table([]), "0 times"),
        (table([0.0, 1.0], [0.1, np.nan]), "finite"),
        (table([0.0, 1.0], [0.1, np.inf]), "finite"),
        (table([0.0, 1.0], 0.1, [0.0, np.nan]), "finite"),
        (table([0.0, 1.0], 0.1, 30.0), "does not steer"),
    ],
)
def test_commands_over_wrong_times_are_refused(commands: xr.Dataset, text: str) -> None:
    with pytest.raises(rb.RockerbogieError, match=text):
        rb.predict(ROVER, FLAT, (10.0, 10.0, 0.0), commands, friction=0.8)
    if "steer" not in text:
        pytest.importorskip("mujoco")
        with pytest.raises(rb.RockerbogieError, match=text):
            rb.simulate(ROVER, FLAT, PATH, commands=commands)


@pytest.mark.parametrize("rate", [1e5, 1e12])
def test_wheel_rates_that_take_too_many_steps_are_refused(rate: float) -> None:
    with pytest.raises(rb.RockerbogieError, match="longer step"):
        rb.predict(ROVER, FLAT, (10.0, 10.0, 0.0), table([0.0, 10.0], rate), friction=0.8)


@pytest.mark.parametrize("law", [{"friction": 0.8}, {"soil": "dry-sand"}], ids=["friction", "soil"])
@pytest.mark.parametrize("interpolation", ["cubic", "linear"])
def test_missing_data_in_mid_drive_end_it_before_them(interpolation: str, law: dict[str, object]) -> None:
    z = np.zeros((41, 41))
    z[18:22, 24:27] = np.nan  # x from 12 to 13 m
    ground = rb.Terrain.from_array(z, 0.5, interpolation=interpolation)  # type: ignore[arg-type]
    run = rb.predict(ROVER, ground, (6.0, 10.0, 0.0), rb.Path.straight((0, 0), 0.0, 10.0), **law)  # type: ignore[arg-type]
    assert run.attrs["end"] == "NO_DATA"
    front = float(run["x"][-1]) + ROVER.hubs[:, 0].max()
    assert 10.5 < front < 12.0
    for name in ("x", "z", "normal_force", "wheel_torque", "motor_work"):
        assert np.isfinite(run[name]).all()
    batch = rb.predict(
        ROVER,
        ground,
        [(6.0, 10.0, 0.0), (6.0, 4.0, 0.0)],
        rb.Path.straight((0, 0), 0.0, 10.0),
        **law,
        record=1.0,  # type: ignore[arg-type]
    )
    assert batch["end"].to_numpy().tolist() == [int(rb.DriveEnd.NO_DATA), int(rb.DriveEnd.REACHED_END)]
    assert np.isnan(batch["x"][0, -1])
    assert np.isfinite(batch["x"][1]).all()


def test_a_drive_off_the_map_ends_at_its_edge() -> None:
    run = rb.predict(ROVER, FLAT, (10.0, 10.0, 0.0), rb.Path.straight((0, 0), 0.0, 30.0), friction=0.8)
    assert run.attrs["end"] == "OFF_MAP"
    front = float(run["x"][-1]) + ROVER.hubs[:, 0].max() + ROVER.wheel_radius.max()
    assert 20.0 - front < 0.5
    for start in ((100.0, 10.0, 0.0), (1e300, 0.0, 0.0)):
        outside = rb.predict(ROVER, FLAT, start, PATH, friction=0.8)
        assert outside.attrs["end"] == "OFF_MAP"
        assert outside.sizes["time"] == 0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"cohesion": -1.0}, "cohesion is -1"),
        ({"cohesion": 1.04}, "give Pa, not kPa"),
        ({"friction_angle": 28.0}, "give rad, not degrees"),
        ({"kphi": 1528.43}, "give N and m, not kN"),
        ({"kphi": 1528.43e6}, "give N and m"),
        ({"kc": -1.0}, "kc is -1"),
        ({"exponent": 0.0}, "exponent is 0"),
        ({"shear_modulus": 25.0}, "give m, not mm"),
        ({"shear_modulus": 2.5e-5}, "give m, not mm"),
        ({"density": 1.6}, "density is 1.6"),
        ({"density": 1.6e6}, "density is 1.6e\\+06"),
        ({"rut_exponent": -3.0}, "rut_exponent is -3"),
    ],
)
def test_soils_off_by_a_unit_are_refused(changes: dict[str, float], text: str) -> None:
    with pytest.raises(rb.RockerbogieError, match=text):
        dataclasses.replace(rb.load_soil("dry-sand"), **changes)


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"slip": 1.5}, "OUT_OF_RANGE"), ({"slip": -1.5}, "OUT_OF_RANGE"), ({"slip_angle": 30.0}, "OUT_OF_RANGE"),
        ({"load": 1e7}, "OVERLOADED"), ({"load": -1.0}, "INVALID"), ({"load": np.nan}, "INVALID"), ({"slip": np.nan}, "INVALID"),
    ],
)  # fmt: skip
def test_forces_outside_the_law_are_nan_with_a_status(changes: dict[str, float], status: str) -> None:
    arguments = {"radius": 0.25, "width": 0.3, "load": 500.0, "slip": 0.2} | changes
    forces = rb.wheel_soil_forces(rb.load_soil("dry-sand"), **arguments)
    assert ForceStatus(int(forces.status)).name == status
    assert np.isnan([forces.drawbar, forces.side, forces.torque, forces.sinkage]).all()
