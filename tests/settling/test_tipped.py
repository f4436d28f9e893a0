"""Steep planes on which the descent tips over: the equilibrium on six wheels is returned."""

from __future__ import annotations

import numpy as np
import pytest

import rockerbogie as rb
from support import oracle
from support.rest_cases import load
from support.rigid_drop import DropTower, Rest
from support.verified import verify_equilibrium

DATUM = 100.0  # m, height of the plane's centre: the start pose must be moved by it to the kernels' datum and back
STEP = 1e-6  # of the central differences, m and rad


def plane(rover: rb.Rover, slope: float) -> rb.Terrain:
    """Return a plane that falls by `slope` degrees towards +x, large enough for the rover."""
    flat = rb.surfaces.plane(np.radians(slope), size=10 * rover.wheelbase, spacing=0.2 * rover.wheelbase)
    return rb.Terrain.from_array(flat.z + DATUM, flat.spacing, flat.origin, flat.interpolation)


def simulate(rover: rb.Rover, slope: float, yaw: float, start: np.ndarray | None) -> Rest:
    """Run MuJoCo on that plane without friction, from a pose or (if `start` is None) from above."""
    half = np.radians(slope) / 2
    tower = DropTower(
        rover, [{"type": "plane", "size": [0, 0, 1], "pos": [0, 0, DATUM], "quat": [np.cos(half), 0, np.sin(half), 0]}]
    )
    return tower.drop(0.0, 0.0, yaw, start=start, tolerance=1e-8)


def turned(rest: Rest, q: np.ndarray) -> float:
    """Return the largest difference of an angle between MuJoCo's rest and a pose (6,), degrees."""
    return float(np.degrees(np.abs(np.array([rest.roll, rest.pitch, rest.rocker, *rest.bogie]) - q[1:]).max()))


@pytest.mark.parametrize(
    ("name", "slope", "heading", "falls_from_above"),
    [
        ("elhami-dashti", 45, 180, True),
        ("elhami-dashti", 55, 180, True),
        ("elhami-dashti", 40, 120, False),
        ("rocky7", 50, 120, True),
        ("rocky7", 55, 150, True),
        ("perseverance", 65, 0, False),
    ],
)
def test_an_equilibrium_on_six_wheels_that_mujoco_keeps_is_returned(
    name: str, slope: float, heading: float, falls_from_above: bool
) -> None:
    rover, yaw = load(name), np.radians([heading])
    pose = rb.settle(rover, plane(rover, slope), [0.0], [0.0], yaw, mode="equilibrium")
    assert pose.status[0] == rb.Status.CONVERGED
    assert not verify_equilibrium(pose, tries=40).wrong
    held = simulate(rover, slope, yaw[0], pose.q[0])
    assert held.at_rest
    assert turned(held, pose.q[0]) < 0.02
    assert not held.lifted.any()
    if falls_from_above:
        assert not simulate(rover, slope, yaw[0], None).at_rest


@pytest.mark.parametrize(("slope", "heading"), [(60, 180), (65, 150), (65, 165), (65, 180), (70, 180)])
def test_tipped_where_mujoco_falls_from_above_and_from_six_wheels(slope: float, heading: float) -> None:
    rover, yaw = load("rocky7"), np.radians([heading])
    ground = plane(rover, slope)
    pose, start = (rb.settle(rover, ground, [0.0], [0.0], yaw, mode=mode) for mode in ("equilibrium", "contact"))
    assert pose.status[0] == rb.Status.TIPPED
    assert np.isnan(pose.q).all()
    assert np.isnan(pose.support).all()
    assert start.status[0] == rb.Status.CONVERGED
    assert turned(simulate(rover, slope, yaw[0], start.q[0]), start.q[0]) > 40
    assert not simulate(rover, slope, yaw[0], None).at_rest


def least_force(rover: rb.Rover, slope: float, yaw: float, q: np.ndarray) -> float:
    """Return the least contact force, as a share of the weight, at a six-wheel pose in balance.

    From the definitions: gaps of cylinders over a plane and the height of the mass, by central differences.
    """
    normal = np.array([np.sin(np.radians(slope)), 0.0, np.cos(np.radians(slope))])
    moved = q + STEP * np.concatenate([np.eye(6), -np.eye(6)])
    zero, heading = np.zeros(12), np.full(12, yaw)
    wheels = oracle.stand(rover, zero, zero, heading, moved)
    across = wheels.Y @ normal
    gap = wheels.hub @ normal - wheels.radius * np.sqrt(1 - across**2) - wheels.half * np.abs(across)
    gap = gap.reshape(12, 6) / normal[2]
    height = oracle.mass_height(rover, oracle.link_poses(rover, zero, zero, heading, moved))
    return float(np.linalg.solve((gap[:6] - gap[6:]).T, height[:6] - height[6:]).min())


@pytest.mark.parametrize("name", ["elhami-dashti", "rocky7"])
def test_tipped_only_where_a_contact_force_would_have_to_pull(name: str) -> None:
    rover, heading = rb.load_rover(name), np.radians(np.arange(0, 360, 15.0))
    tipped = 0
    for slope in (45.0, 55.0, 65.0):
        pose = rb.settle(rover, plane(rover, slope), np.zeros(24), np.zeros(24), heading, mode="equilibrium")
        verified = verify_equilibrium(pose, tries=10)
        assert not verified.wrong, verified.wrong
        six = rb.settle(rover, plane(rover, slope), 0.0, 0.0, heading)
        assert not np.isin(pose.status, [rb.Status.NOT_CONVERGED, rb.Status.OFF_MAP]).any()
        for k in np.flatnonzero(pose.status == rb.Status.TIPPED):
            tipped += 1
            assert least_force(rover, slope, heading[k], six.q[k]) < 0
    assert (tipped > 0) == (name == "rocky7")
