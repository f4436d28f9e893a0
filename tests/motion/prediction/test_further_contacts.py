"""Wheels on soil with several contacts: balance, energies, and where a rover stays."""

from __future__ import annotations

import math

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie._kernels.dynamics import balance_residual, drive_state, further_contacts, further_state, station
from rockerbogie._kernels.dynamics.evaluate import C_SIZE, C_TRACKS, C_VALUES, evaluate
from rockerbogie._kernels.model.ground import META_X, META_Y
from rockerbogie._kernels.model.linkage import set_hub_offsets
from rockerbogie._kernels.search.workspace import WORK_SIZE, lay_out
from rockerbogie.motion.prediction.soil import soil_tables
from support.helpers import assert_close

SPEED = 0.04


def ditch(angle: float, interpolation: str = "linear") -> rb.Terrain:
    """Return level ground with a ditch along y at x = 0, whose sides have this slope."""
    x = np.arange(-8.0, 8.01, 0.05)
    z = np.tile(np.minimum(0.0, (np.abs(x) - 0.6) * math.tan(angle)), (121, 1))
    return rb.Terrain.from_array(z, spacing=0.05, origin=(-8.0, -3.0), interpolation=interpolation)


class Place:
    """A rover on soil at one place, as `evaluate` leaves it."""

    def __init__(self, rover: rb.Rover, terrain: rb.Terrain, place: tuple[float, float, float], span: float) -> None:
        self.memory = [
            np.zeros(WORK_SIZE), np.zeros(station.STATION_SIZE), np.zeros(9, np.int64), np.zeros(balance_residual.MOTION_SIZE),
            np.zeros(9, np.int64), np.zeros(drive_state.STATE_SIZE), np.zeros(further_state.FURTHER_SIZE),
            np.zeros(further_state.FURTHER_INTEGERS, np.int64),
        ]  # fmt: skip
        work, s, order, m, more, state, further, integers = self.memory
        self.work, self.station = lay_out(work), station.new_station(s, order)
        self.motion, self.state = balance_residual.new_motion(m, more), drive_state.new_state(state)
        self.further, self.rover, self.span = further_state.new_further(further, integers), rover.packed, span
        meta = terrain.packed[2]
        self.state.place[:] = place[0] - meta[META_X], place[1] - meta[META_Y], place[2]
        self.state.q[:] = math.nan
        balance_residual.reset_motion(self.motion)
        set_hub_offsets(rover.packed, np.zeros(6), self.work.hub_offsets)
        command = np.zeros(C_SIZE)
        command[C_TRACKS], command[C_VALUES] = 1.0, SPEED
        tables = soil_tables(rover, "dry-sand", rb.GRAVITY["earth"], None, True)
        drive = drive_state.Drive(0.6, True, tables.tables, tables.table_of[0], rb.GRAVITY["earth"], np.full(6, math.inf), SPEED)
        self.code, _ = evaluate(
            terrain.packed, rover.packed, True, True, span, command, drive, self.work, self.station, self.motion, self.further,
            self.state,
        )  # fmt: skip
        self.law = balance_residual.Law(
            0.6, True, tables.tables, tables.table_of[0], -self.station.weight[2], self.state.rim, self.state.limit, SPEED,
            self.state.free,
        )  # fmt: skip


@pytest.fixture(scope="module")
def rover() -> rb.Rover:
    """Return Curiosity."""
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def stuck(rover: rb.Rover) -> xr.Dataset:
    """Return a drive into a ditch of 40 degrees, on sand."""
    return rb.predict(
        rover, ditch(math.radians(40)), (-3.0, 0.0, 0.0), rb.Path.straight((-3, 0), 0, 5.0), soil="dry-sand", tolerance=1e-6
    )


def front(run: xr.Dataset, rover: rb.Rover, terrain: rb.Terrain) -> float:
    """Return the mean x of the front hubs at the end, m."""
    pose = rb.settle(rover, terrain, float(run["x"][-1]), float(run["y"][-1]), float(run["yaw"][-1]))
    return float((pose.T_world_body @ pose.axle_frames)[:2, 0, 3].mean())


def test_a_rover_stays_in_a_ditch_that_sand_does_not_climb(rover: rb.Rover, stuck: xr.Dataset) -> None:
    assert stuck.attrs["end"] == "REACHED_END"
    last = stuck.isel(time=slice(-20, None))
    assert np.ptp(last["x"].to_numpy()) < 1e-6
    assert abs(front(stuck, rover, ditch(math.radians(40)))) < 1e-3, "the hubs of the front wheels are over the bottom"
    assert (last["slip_ratio"] > 0.99).all()
    work, loss, gain = (stuck[name].to_numpy() for name in ("motor_work", "dissipation", "height_gain"))
    assert np.abs(work - loss - gain).max() < 5e-6 * work[-1]
    assert work[-1] > 1.4 * work[-20], "the motors go on"


def test_a_flat_ditch_is_crossed(rover: rb.Rover) -> None:
    ground = ditch(math.radians(10))
    run = rb.predict(rover, ground, (-3.0, 0.0, 0.0), rb.Path.straight((-3, 0), 0, 5.0), soil="dry-sand", tolerance=1e-5)
    assert run.attrs["end"] == "REACHED_END"
    assert front(run, rover, ground) > 1.0
    missing = run["motor_work"] - run["dissipation"] - run["height_gain"]
    assert abs(missing).max() < 2e-5 * rover.mass * rb.GRAVITY["earth"] * 5.0


def test_the_drive_from_the_other_side_is_the_same(rover: rb.Rover, stuck: xr.Dataset) -> None:
    path = rb.Path.straight((3, 0), math.pi, 5.0)
    back = rb.predict(rover, ditch(math.radians(40)), (3.0, 0.0, math.pi), path, soil="dry-sand", tolerance=1e-6)
    assert_close(-back["x"].to_numpy(), stuck["x"].to_numpy(), 1e-4, "m", "x")
    assert_close(
        back["motor_work"].to_numpy(), stuck["motor_work"].to_numpy(), 1e-3 * float(stuck["motor_work"][-1]), "J", "work"
    )


def test_without_a_tolerance_a_rover_stays_in_the_same_place(rover: rb.Rover, stuck: xr.Dataset) -> None:
    coarse = rb.predict(rover, ditch(math.radians(40)), (-3.0, 0.0, 0.0), rb.Path.straight((-3, 0), 0, 5.0), soil="dry-sand")
    assert abs(float(coarse["x"][-1] - stuck["x"][-1])) < 0.01
    missing = coarse["motor_work"] - coarse["dissipation"] - coarse["height_gain"]
    assert abs(missing).max() < 0.02 * coarse["motor_work"].max()


@pytest.fixture(scope="module")
def held(rover: rb.Rover, stuck: xr.Dataset) -> Place:
    """Return the place at the end of the drive into the ditch."""
    at = stuck.isel(time=-1)
    place = Place(rover, ditch(math.radians(40)), (float(at["x"]), float(at["y"]), float(at["yaw"])), 0.1)
    assert place.code == 0
    assert place.further.size[0] >= 2
    return place


def test_forces_of_all_contacts_balance_the_weight(held: Place) -> None:
    """Directions are those of the ditch, not those of the kernel."""
    sides = {i: -math.copysign(math.radians(40), held.station.normal[i, 0]) for i in (0, 1)}
    total, opposite = np.zeros(2), 0.0  # forward and up; load on the other sides of the ditch
    first = [held.motion.force[i].copy() for i in range(6)]
    load = held.motion.load.copy()
    for j in range(held.further.size[0]):
        i = held.further.wheel[j]
        if held.further.load[j] > 1e-5:  # `evaluate` has added these to the first contacts
            first[i][:2] -= held.further.force[j, :2]
            load[i] -= held.further.load[j]
            # on the side of the first contact, a further one keeps its gap in every motion that keeps that of the first
            same = np.abs(held.further.ways[j, 0, :3]).max() < 1e-6
            total += along(sides.get(i, 0.0) * (1 if same else -1), held.further.load[j], held.further.force[j, 0])
            opposite += 0 if same else held.further.load[j]
    for i in range(6):
        total += along(sides.get(i, 0.0), load[i], first[i][0])
    assert_close(total, np.array([0.0, 1.0]), 1e-8, "weights", "sum of forces")
    assert opposite > 0.1


def along(slope: float, normal: float, traction: float) -> np.ndarray:
    """Return a contact's force forward and up, on ground that rises at this slope."""
    return np.array(
        [traction * math.cos(slope) - normal * math.sin(slope), normal * math.cos(slope) + traction * math.sin(slope)]
    )


def test_jacobian_with_further_contacts_is_that_of_finite_differences(held: Place) -> None:
    further, n = held.further, 9 + int(held.further.size[0])
    rng = np.random.default_rng(5)
    z = np.concatenate([rng.normal(size=3) * 0.01, rng.uniform(0.02, 0.3, n - 3)])

    def residual(values: np.ndarray) -> np.ndarray:
        further.z[:n] = values
        further_contacts.residual_with(held.station, held.rover, held.law, 0.05, held.span, held.motion, further)
        return further.residual[:n].copy()

    residual(z)
    exact = further.jacobian[: n * n].reshape(n, n).copy()
    for k in range(n):
        h = 1e-7 if k < 3 else 1e-6
        step = np.zeros(n)
        step[k] = h
        difference = (residual(z + step) - residual(z - step)) / (2 * h)
        assert_close(exact[k], difference, 2e-5 * max(np.abs(exact[k]).max(), 1.0), "", f"unknown {k}")
