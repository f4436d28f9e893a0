"""Descent and equilibrium against an independent minimiser of the potential energy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize

import rockerbogie as rb
from rockerbogie._kernels.model import linkage
from rockerbogie._kernels.model.ground import META_X, META_Y, META_Z
from rockerbogie._kernels.search.workspace import WORK_SIZE, lay_out
from rockerbogie._kernels.solve.descent import let_down
from rockerbogie._kernels.solve.equilibrium import settle_equilibrium
from rockerbogie._kernels.solve.forces import R_SIZE
from rockerbogie._kernels.solve.site import MEMORY_SIZE, OWNERS, Site, lay_out_memory
from rockerbogie._kernels.solve.six_wheels import SIX_SIZE, lay_out_six
from support import oracle
from support.helpers import assert_close

ROVERS = ["rocky7", "perseverance", "elhami-dashti"]
SLACK = 1e-10  # m, the oracle's bracket


def waves(rover: rb.Rover, seed: int) -> rb.Terrain:
    """Return waves longer than the rover: there is one equilibrium near a horizontal start."""
    rng = np.random.default_rng(seed)
    length = 3.0 * rover.wheelbase
    at = np.linspace(-1.5 * length, 1.5 * length, 61)
    x, y = np.meshgrid(at, at)
    z = np.zeros_like(x)
    for _ in range(4):
        angle, phase = rng.uniform(0, 2 * math.pi, 2)
        z += 0.02 * length * np.sin(2 * math.pi * (x * math.cos(angle) + y * math.sin(angle)) / length + phase)
    return rb.Terrain.from_array(z, float(at[1] - at[0]), (float(at[0]), float(at[0])))


class Energy:
    """Potential energy of a rover at one position and its gaps, by the oracle alone.

    The energy is the height of the centre of mass, m.
    """

    def __init__(self, rover: rb.Rover, terrain: rb.Terrain, x: float, y: float, yaw: float) -> None:
        self.rover, self.ground, self.at = rover, oracle.Ground.of(terrain), (x, y, yaw)

    def __call__(self, q: np.ndarray) -> float:
        return float(oracle.mass_height(self.rover, oracle.link_poses(self.rover, *self.at, q))[0])

    def gaps(self, q: np.ndarray) -> np.ndarray:
        """Return the gaps of the six treads, m."""
        return oracle.least_gap(self.ground, oracle.stand(self.rover, *self.at, q), SLACK).gap

    def minimum(self, start: np.ndarray) -> np.ndarray:
        """Return the pose (6,) of least energy that scipy finds.

        No gap is negative, and joints are within their limits.
        """
        stops = linkage.P_STOPS
        rocker, bogie = self.rover.packed[stops : stops + 2], self.rover.packed[stops + 2 : stops + 4]
        bounds = [(None, None)] * 3 + [
            tuple(None if math.isinf(v) else float(v) for v in limits) for limits in (rocker, bogie, bogie)
        ]
        found = minimize(
            self, start, method="SLSQP", bounds=bounds, constraints={"type": "ineq", "fun": self.gaps},
            options={"maxiter": 200, "ftol": 1e-13, "eps": 1e-6},
        )  # fmt: skip
        q = found.x
        q[0] -= self.gaps(q).min()
        return np.asarray(q)


def lowered(rover: rb.Rover, terrain: rb.Terrain, x: float, y: float, yaw: float) -> tuple[np.ndarray, int, np.ndarray]:
    """Return the pose (6,) at which the descent ends, its code, and the gaps of its contacts."""
    meta = terrain.packed.meta
    buffer, room, q = np.zeros(WORK_SIZE), np.zeros(SIX_SIZE), np.zeros(6)
    work, six = lay_out(buffer), lay_out_six(room)
    memory_buffer, owners = np.empty(MEMORY_SIZE), np.empty(OWNERS, np.int64)
    contacts, _, program = lay_out_memory(memory_buffer, owners)
    linkage.set_hub_offsets(rover.packed, np.zeros(6), work.hub_offsets)
    site = Site(terrain.packed, rover.packed, x - meta[META_X], y - meta[META_Y], math.cos(yaw), math.sin(yaw), work)
    code, count = let_down(site, q, six, contacts, program)
    gap = contacts.gap[:count].copy()
    buffer[0] = room[0] = memory_buffer[0] = owners[0] = 0  # keep the buffers alive: the other arrays are unowned views of them
    assert count >= 6
    return q + [meta[META_Z], 0, 0, 0, 0, 0], code, gap


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("name", ROVERS)
def test_energy_is_that_of_an_independent_minimum(name: str, seed: int) -> None:
    rover = rb.load_rover(name)
    terrain = waves(rover, seed)
    size = rover.wheelbase
    x, y, yaw = np.random.default_rng(100 + seed).uniform(-0.3, 0.3, 3) * [size, size, 10.0]
    energy = Energy(rover, terrain, x, y, yaw)
    start = np.zeros(6)
    start[0] -= energy.gaps(start).min()
    first, code, gaps = lowered(rover, terrain, x, y, yaw)
    assert code == 0
    assert gaps.min() == pytest.approx(0.0, abs=1e-15)
    assert energy.gaps(first).min() >= -2 * SLACK
    best = energy.minimum(start)
    pose = rb.settle(rover, terrain, x, y, yaw, mode="equilibrium")
    assert pose.status in (rb.Status.CONVERGED, rb.Status.WHEEL_LIFTED, rb.Status.JOINT_STOP)
    assert energy(best) <= energy(start)
    assert_close(
        energy(pose.q), energy(best), 1e-7 * size, "m", "one minimum, by sequential quadratic programming and finite differences"
    )
    assert -1e-9 * size <= energy(first) - energy(best) <= 1e-4 * size
    assert energy(pose.q) <= energy(first) + 1e-9 * size


@pytest.mark.parametrize("name", ROVERS)
def test_no_small_motion_lowers_an_equilibrium(name: str) -> None:
    """Move in random directions and shift z to just touch: the centre of mass is not lower."""
    rover = rb.load_rover(name)
    terrain = waves(rover, 9)
    pose = rb.settle(rover, terrain, 0.1, 0.2, 0.3, mode="equilibrium")
    energy = Energy(rover, terrain, 0.1, 0.2, 0.3)
    rng, step = np.random.default_rng(4), 1e-4
    for _ in range(60):
        q = pose.q + step * np.append(0.0, rng.normal(size=5))
        limits = rover.packed[linkage.P_STOPS : linkage.P_STOPS + 4]
        q[3:] = np.clip(q[3:], limits[[0, 2, 2]], limits[[1, 3, 3]])
        q[0] -= energy.gaps(q).min()
        assert energy(q) >= energy(pose.q) - 1e-9 * rover.wheelbase


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_an_equilibrium_does_not_depend_on_what_its_memory_held(interpolation: str) -> None:
    """Solve with scratch memory that holds zeros, large numbers and NaN: the same bits."""
    rover = rb.load_rover("curiosity")
    terrain = rb.surfaces.fractal(3, size=20.0, spacing=0.15, interpolation=interpolation)
    meta = terrain.packed.meta
    for x, y, yaw in np.random.default_rng(6).uniform(-4.0, 4.0, (6, 3)):
        start = rb.settle(rover, terrain, x, y, yaw).q - [meta[META_Z], 0, 0, 0, 0, 0]
        found = []
        for held in (0.0, 1e3, math.nan):
            buffers = [np.full(size, held) for size in (WORK_SIZE, SIX_SIZE, MEMORY_SIZE)]
            owners = np.full(OWNERS, 5)
            work, six, memory = lay_out(buffers[0]), lay_out_six(buffers[1]), lay_out_memory(buffers[2], owners)
            linkage.set_hub_offsets(rover.packed, np.zeros(6), work.hub_offsets)
            six.q[:] = start
            site = Site(terrain.packed, rover.packed, x - meta[META_X], y - meta[META_Y], math.cos(yaw), math.sin(yaw), work)
            q, report = np.full(6, held), np.full(R_SIZE, held)
            status = settle_equilibrium(site, q, report, six, memory)
            for buffer in (*buffers, owners):  # keep the buffers alive: the other arrays are unowned views of them
                buffer[0] = 0
            found.append((status, q.tobytes(), report.tobytes()))
        assert found[0] == found[1] == found[2]
