"""Wheels that leave the ground during a predicted drive: gaps, loads and energies."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from support.helpers import assert_close

ROVERS = {"sawppy": "cubic", "osr": "linear", "perseverance": "linear"}
DRIVES, LENGTH, FRICTION = 12, 4.0, 0.8


@pytest.fixture(scope="module", params=ROVERS)
def run(request):
    """Return drives over rocks, at some of which wheels leave the ground."""
    rover = rb.load_rover(request.param)
    terrain = rb.surfaces.rocks(k=0.2, seed=3, size=26.0, spacing=0.1, smallest=0.25, interpolation=ROVERS[request.param])
    west, south, east, north = terrain.bounds
    rng = np.random.default_rng(1)
    start = np.stack(
        [rng.uniform(west + 7, east - 7, DRIVES), rng.uniform(south + 7, north - 7, DRIVES), rng.uniform(-3, 3, DRIVES)], axis=-1
    )
    path = rb.Path.straight((0.0, 0.0), 0.0, LENGTH)
    return rb.predict(rover, terrain, start, path, friction=FRICTION, step=0.05, tolerance=1e-5)


def test_a_wheel_off_the_ground_has_a_gap_and_no_load(run):
    gap, load = run["gap"].values, run["normal_force"].values
    settled = np.isfinite(run["x"].values)
    up = (gap > 1e-8) & settled[..., None]
    assert up.any(), "no wheel left the ground: another terrain is needed"
    weight = load[settled].sum(axis=-1).max()
    assert_close(load[up] / weight, 0.0, 1e-9, "weight", "wheels off the ground carry nothing")
    assert np.nanmin(gap) > -1e-8, "no wheel is in the ground"
    assert (run["wheel_lifted"].values[up] == 1).all()
    loaded = (run["wheel_lifted"].values == 0) & settled[..., None]
    assert_close(gap[loaded], 0.0, 1e-8, "m", "wheels with a load are on the ground")


def test_energies_balance_while_wheels_are_off_the_ground(run):
    error = (run["motor_work"] - run["dissipation"] - run["height_gain"]).values
    work = np.nanmax(np.abs(run["motor_work"].values), axis=1)
    driven = np.isfinite(run["x"].values).sum(axis=1) > 20
    up = (run["gap"].values > 1e-8).any(axis=(1, 2)) & driven
    assert up.any()
    assert_close(np.nanmax(np.abs(error), axis=1)[up] / work[up], 0.0, 2e-3, "1", "share of the motors' work")
