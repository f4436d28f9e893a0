"""Terrain values that a search for contacts needs beside walls of cubic terrain."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rockerbogie as rb
from rockerbogie._kernels.model.linkage import forward_kinematics, set_hub_offsets
from rockerbogie._kernels.model.wheel import CONTACT_SIZE, GAP
from rockerbogie._kernels.search import cubic_cell, cubic_rim, cubic_tread, tread
from rockerbogie._kernels.search.workspace import WORK_SIZE, lay_out
from rockerbogie._kernels.solve import newton
from support import oracle

Array = NDArray[np.float64]

CELL = 0.5
NODES = 81


def wall(height: float) -> rb.Terrain:
    """Return cubic terrain of two flat halves, the western one lower by `height`."""
    z = np.full((NODES, NODES), 100.0)
    z[:, : NODES // 2] -= height
    return rb.Terrain.from_array(z, CELL, interpolation="cubic")


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list whose only element counts the terrain values of a search."""
    values = [0]
    for module, name in (
        (cubic_cell, "search_inside"), (cubic_tread, "_convex_part"), (cubic_cell, "search_arc"), (cubic_rim, "_convex_arc"),
    ):  # fmt: skip
        monkeypatch.setattr(module, name, getattr(module, name).py_func)
    monkeypatch.setattr(tread, "search_curved_cell", cubic_cell.search_curved_cell.py_func)  # type: ignore[attr-defined]
    monkeypatch.setattr(tread, "_search_open", tread._search_open.py_func)  # type: ignore[attr-defined]
    for rover, height in (("curiosity", 10.0), ("elhami-dashti", 0.3)):  # compile what calls the counted functions
        search_below(rb.load_rover(rover), wall(height), 20.3, 0.3, 0.02)
    for module, name in ((cubic_rim, "_along"), (cubic_tread, "surface")):
        compiled = getattr(module, name)

        def count(*args: Any, compiled: Any = compiled) -> Any:
            values[0] += 1
            return compiled(*args)

        monkeypatch.setattr(module, name, count)
    return values


def search_below(rover: rb.Rover, terrain: rb.Terrain, x: float, yaw: float, tilt: float) -> tuple[Array, Array]:
    """Return the least gaps (6,) of a rover near the terrain, and its q (6,)."""
    buffer = np.empty(WORK_SIZE)
    work = lay_out(buffer)
    set_hub_offsets(rover.packed, np.zeros(6), work.hub_offsets)
    meta = terrain.meta
    q = np.array([float(terrain.height(x, 20.0)) - meta[2] + 0.3, tilt, 0.5 * tilt, 0.1, -0.1, 0.05])
    at = (x - meta[0], 20.0 - meta[1], math.cos(yaw), math.sin(yaw))
    assert forward_kinematics(rover.packed, work.hub_offsets, *at, q, work.axes, work.pivots, work.wheels)
    lowest, gaps = np.empty(CONTACT_SIZE), np.empty(6)
    for i in range(6):
        search = tread.least_gap.py_func  # type: ignore[attr-defined]
        search(terrain.packed, work.wheels[i], 0.0, 1.0, 0.0, True, -math.inf, lowest, np.empty((0, CONTACT_SIZE)))
        gaps[i] = lowest[GAP]
    q[0] += meta[2]
    return gaps, q


@pytest.mark.parametrize("height", [0.3, 10.0, 1e3, 1e4, -10.0, -1e4])
@pytest.mark.parametrize("name", ["curiosity", "elhami-dashti"])
def test_search_beside_a_wall_is_exact_and_short(counted: list[int], name: str, height: float) -> None:
    rover, terrain = rb.load_rover(name), wall(height)
    most, poses = 0, []
    for k, x in enumerate(np.linspace(16.0, 24.0, 23)):
        yaw, tilt = (0.0, 0.3, 1.2, -2.0, math.pi / 4)[k % 5], (0.02, -0.2, 0.4)[k % 3]
        counted[0] = 0
        gaps, q = search_below(rover, terrain, float(x), yaw, tilt)
        most = max(most, counted[0])
        poses.append((x, yaw, q, gaps))
    assert most <= 6 * 250, f"{most} terrain values for six wheels"
    x, yaw, q, gaps = (np.array(values) for values in zip(*poses, strict=True))
    treads = oracle.stand(rover, x, np.full(len(x), 20.0), yaw, q, np.zeros((len(x), 6)))
    slack = max(1e-8, 1e-11 * abs(height))
    brute = oracle.least_gap(oracle.Ground.of(terrain), treads, slack).gap.reshape(len(x), 6)
    np.testing.assert_allclose(gaps, brute, atol=2 * slack, rtol=0)


def test_two_starts_far_from_the_terrain_end_the_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """The spline oscillates by kilometres: NOT_CONVERGED after two starts, not after 32."""
    rover, terrain = rb.load_rover("curiosity"), wall(1e4)
    ends, compiled = [], newton.newton

    def counted(*args: Any) -> int:
        ends.append(compiled(*args))
        return int(ends[-1])

    monkeypatch.setattr(newton, "newton", counted)
    buffer = np.empty(WORK_SIZE)
    work, q = lay_out(buffer), np.empty(6)
    set_hub_offsets(rover.packed, np.zeros(6), work.hub_offsets)
    at = (19.5 - terrain.meta[0], 20.0 - terrain.meta[1], math.cos(0.3), math.sin(0.3))
    settle = newton.settle_contact.py_func  # type: ignore[attr-defined]
    status, _ = settle(terrain.packed, rover.packed, *at, 0, q, work)
    assert status == rb.Status.NOT_CONVERGED
    assert np.isnan(q).all()
    assert ends.count(newton.FAR_AWAY) == newton.FAR_STARTS == 2
    assert len(ends) <= 6
