"""Random rovers on random terrain: the oracle verifies every pose."""

from __future__ import annotations

import numpy as np
from hypothesis import HealthCheck, event, given, settings
from hypothesis import strategies as st

import rockerbogie as rb
from support import oracle
from support.strategies import BATCH_SHAPES, rovers, terrains
from support.verified import SLACK, TOLERANCE, TOUCHING, verify_equilibrium

FEW = settings(
    max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow, HealthCheck.data_too_large]
)


def draw_places(data: st.DataObject, rover: rb.Rover) -> tuple[tuple[int, ...], dict[str, np.ndarray]]:
    """Return a batch shape, and random x, y, yaw and steering of that shape."""
    shape = data.draw(st.sampled_from(BATCH_SHAPES))
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    reach = data.draw(st.sampled_from([0.0, 0.5])) * float(np.abs(rover.hubs).max())
    yaw = rng.uniform(-np.pi, np.pi, shape) if data.draw(st.booleans()) else rng.integers(-1, 3, shape) * np.pi / 2
    turn = data.draw(st.sampled_from([0.0, 0.4]))
    steering = turn * rng.uniform(-1, 1, (*shape, 6))
    return shape, {
        "x": rng.uniform(-reach, reach, shape),
        "y": rng.uniform(-reach, reach, shape),
        "yaw": yaw,
        "steering": steering,
    }


@FEW
@given(st.data())
def test_reported_contacts_are_contacts(data: st.DataObject) -> None:
    rover = data.draw(rovers())
    terrain = data.draw(terrains(rover))
    shape, places = draw_places(data, rover)
    pose = rb.settle(rover, terrain, **places)
    assert pose.shape == shape
    good = np.isin(pose.status, TOUCHING)
    event(f"{good.sum()} of {good.size} settled")
    assert (np.isnan(pose.q).all(axis=-1) == ~good).all(), "a pose is NaN if and only if its status has none"
    if not good.any():
        return
    at = {name: value.reshape(good.size, *value.shape[len(shape) :])[good.ravel()] for name, value in places.items()}
    wheels = oracle.stand(rover, at["x"], at["y"], at["yaw"], pose.q[good], at["steering"])
    gap = oracle.least_gap(oracle.Ground.of(terrain), wheels, SLACK * float(rover.wheel_radius.max())).gap
    assert gap.max() <= TOLERANCE
    assert gap.min() - SLACK >= -TOLERANCE
    stopped = (pose.joint_stop[good] != 0).any(axis=-1)
    assert (stopped == (pose.status[good] == rb.Status.JOINT_STOP)).all()


@FEW
@given(st.data())
def test_reported_equilibria_are_equilibria(data: st.DataObject) -> None:
    rover = data.draw(rovers())
    terrain = data.draw(terrains(rover))
    shape, places = draw_places(data, rover)
    pose = rb.settle(rover, terrain, **places, mode="equilibrium")
    assert pose.shape == shape
    spots = (places[name].ravel() for name in ("x", "y", "yaw"))
    flat = rb.settle(rover, terrain, *spots, steering=places["steering"].reshape(-1, 6), mode="equilibrium")
    assert np.array_equal(flat.q.reshape(pose.q.shape), pose.q, equal_nan=True)
    verified = verify_equilibrium(flat, tries=10)
    event(f"{np.isfinite(flat.z).sum()} of {flat.z.size} at rest")
    assert not verified.wrong, verified.wrong


@FEW
@given(st.data())
def test_missing_data_does_not_change_poses(data: st.DataObject) -> None:
    """Poses beside missing data are correct for any heights there, or NaN."""
    rover = data.draw(rovers())
    gappy = data.draw(terrains(rover, missing=True))
    if gappy.interpolation == "cubic":
        gappy = rb.Terrain.from_array(gappy.z, gappy.spacing, gappy.origin, "linear")
    _, places = draw_places(data, rover)
    pose = rb.settle(rover, gappy, **places)
    good = np.isin(pose.status, TOUCHING)
    for fill in (-50.0, 50.0):  # heights in place of the missing data have no effect on a pose
        known = rb.Terrain.from_array(
            np.nan_to_num(gappy.z, nan=fill * float(np.nanmax(abs(gappy.z)) + 1)), gappy.spacing, gappy.origin, "linear"
        )
        wheels = oracle.stand(rover, *(places[name][good] for name in ("x", "y", "yaw")), pose.q[good], places["steering"][good])
        if good.any():
            assert abs(oracle.least_gap(oracle.Ground.of(known), wheels, SLACK).gap).max() <= TOLERANCE
