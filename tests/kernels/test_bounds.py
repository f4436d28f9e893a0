"""Bounds of the contact search, compared with dense sampling."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.optimize import lsq_linear

import rockerbogie as rb
from rockerbogie._kernels.model import ground, tolerances, wheel
from rockerbogie._kernels.search import bilinear_rim, cubic_derivatives, cubic_parts, cubic_patch, cubic_rim, cubic_tread
from rockerbogie._kernels.search.minima import Minima

Array = NDArray[np.float64]

ORDERS = {"XX": (2, 0), "XY": (1, 1), "YY": (0, 2)}


def derivative(c: Array, order: int, t: Array, step: float) -> Array:
    """Return a derivative of cubic B-spline pieces with coefficients c (..., 4), at t in [0, 1].

    It is along the last axis.
    """
    piece = BSpline(np.arange(-3.0, 5.0), np.moveaxis(c, -1, 0), 3)
    return np.moveaxis(piece.derivative(order)(t) if order else piece(t), 0, -1) / step**order


def sampled(c: Array, order: tuple[int, int], dx: float, dy: float, u: Array, v: Array) -> Array:
    """Return a mixed derivative of one cell's bicubic (4, 4) at u along x and v along y."""
    along_x = derivative(c, order[0], u, dx)
    return derivative(np.moveaxis(along_x, 0, -1), order[1], v, dy)


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(40))
def test_bounds_of_second_derivatives_contain_them(seed: int) -> None:
    """Rectangles may be thin, or reach beyond the cell; the bounds are tight on small ones."""
    rng = np.random.default_rng(seed)
    dx, dy = rng.uniform(0.1, 2.0, 2)
    noise = rng.choice([0.01, 1.0])  # with little noise, all rows and all columns are nearly alike
    c = noise * rng.normal(size=(4, 4)) + rng.normal(size=(4, 1)) + rng.normal(size=(1, 4))
    size = rng.choice([1e-9, 0.01, 0.3, 1.5], 2)
    low = rng.uniform(-0.2, 1.0, 2)
    sides = low[0] * dx, (low[0] + size[0]) * dx, low[1] * dy, (low[1] + size[1]) * dy
    derivatives, patch = np.empty(cubic_derivatives.DERIVATIVES_SIZE), np.empty(cubic_patch.BOUNDS_SIZE)
    assert cubic_derivatives.second_derivatives(c, 0, 0, dx, dy, *sides, patch, derivatives)
    inside = [np.clip(np.linspace(at, at + extent, 21), 0.0, 1.0 - 1e-12) for at, extent in zip(low, size, strict=True)]
    for name, order in ORDERS.items():
        values = sampled(c, order, dx, dy, *inside)
        at = getattr(cubic_derivatives, name)
        slack = 1e-8 * (1.0 + abs(values).max())
        assert derivatives[at] <= values.min() + slack, name
        assert derivatives[at + 1] >= values.max() - slack, name
        if size.max() < 0.1:
            everywhere = sampled(c, order, dx, dy, *2 * [np.linspace(0.0, 1.0 - 1e-12, 21)])
            assert derivatives[at + 1] - derivatives[at] < 0.2 * np.ptp(everywhere) + slack, name
    c[rng.integers(4), rng.integers(4)] = np.nan
    assert not cubic_derivatives.second_derivatives(c, 0, 0, dx, dy, *sides, patch, derivatives)


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(10))
def test_slope_bound_contains_the_slopes(seed: int) -> None:
    """It holds over blocks of cells, and is exact on a plane."""
    rng = np.random.default_rng(seed)
    terrain = rb.Terrain.from_array(rng.normal(size=(9, 9)), rng.uniform(0.2, 2.0), interpolation="cubic")
    (i0, i1), (j0, j1) = np.sort(rng.integers(0, 8, (2, 2)))
    bound = cubic_derivatives.greatest_slope(terrain.grid, terrain.meta, i0, i1, j0, j1)
    x, y = np.linspace(i0, i1 + 1, 41) * terrain.spacing[0], np.linspace(j0, j1 + 1, 41) * terrain.spacing[1]
    slopes = [math.hypot(*ground.surface(terrain.grid, terrain.meta, px, py)[1:3]) for px in x for py in y]
    assert max(slopes) <= bound
    row, col = np.mgrid[:11, :11].astype(float)
    plane = (0.3 * col - 0.4 * row) * terrain.spacing[0]
    assert cubic_derivatives.greatest_slope(plane, terrain.meta, i0, i1, j0, j1) == pytest.approx(0.5)
    plane[j0 + 1, i1 + 2] = np.nan
    assert math.isnan(cubic_derivatives.greatest_slope(plane, terrain.meta, i0, i1, j0, j1))


def some_wheel(rng: np.random.Generator) -> tuple[Array, float, float]:
    """Return a tilted wheel over the first cell's middle: its array, radius and half width."""
    tilt, heading = rng.uniform(-1.2, 1.2), rng.uniform(-math.pi, math.pi)
    radius, half = rng.uniform(0.1, 1.0), rng.choice([0.0, rng.uniform(0.01, 0.6)])
    w = np.empty(wheel.WHEEL_SIZE)
    a = (math.cos(tilt) * math.cos(heading), math.cos(tilt) * math.sin(heading), math.sin(tilt))
    x, y, z = rng.uniform(-1, 1, 3)
    assert wheel.make_wheel(w, x, y, z, *a, 0.0, 0.0, 1.0, radius, half)
    return w, radius, half


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(20))
def test_curvature_bound_along_a_rim(seed: int) -> None:
    """f'' of a rim's height over a spline cell is at least its bound, on arcs of both halves."""
    rng = np.random.default_rng(seed)
    c = rng.normal(size=(4, 4)) * 0.3
    meta = np.zeros(ground.META_SIZE)
    meta[[ground.META_DX, ground.META_DY, ground.META_NX, ground.META_NY, ground.META_CUBIC]] = 4.0, 4.0, 2, 2, 1.0
    w, _, half = some_wheel(rng)
    w[wheel.HX] += 2.0  # all of the tread lies over the one cell
    w[wheel.HY] += 2.0
    derivatives, patch = np.empty(cubic_derivatives.DERIVATIVES_SIZE), np.empty(cubic_patch.BOUNDS_SIZE)
    assert cubic_derivatives.second_derivatives(c, 0, 0, 4.0, 4.0, 0.0, 4.0, 0.0, 4.0, patch, derivatives)
    for low in (rng.uniform(-1.5, 0.5), rng.uniform(1.6, 3.0)):
        high = low + rng.choice([0.01, 0.3, 1.0, 1.6])
        ends = (math.sin(low), math.cos(low), math.sin(high), math.cos(high))
        _, _, _, gx, gy = cubic_rim._along(c, meta, w, ends[0], ends[1], half)
        on_arc = np.empty(cubic_derivatives.DERIVATIVES_SIZE)
        cubic_rim._derivatives_on_arc(c, meta, w, 0, 0, half, high - low, *ends, on_arc)
        values = [cubic_rim._along(c, meta, w, math.sin(t), math.cos(t), half)[2] for t in np.linspace(low, high, 101)]
        for bounds in (derivatives, on_arc):
            assert cubic_rim._least_curvature(w, bounds, gx, gy, low, high, *ends) <= min(values) + 1e-12


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(20))
def test_minimum_of_a_wave(seed: int) -> None:
    rng = np.random.default_rng(seed)
    even, odd = rng.normal(size=2)
    low = rng.uniform(-7, 7)
    high = low + rng.uniform(0, 7)
    t = np.linspace(low, high, 20001)
    least = bilinear_rim._least_of_wave(even, odd, low, high)
    assert least == pytest.approx((even * np.cos(t) + odd * np.sin(t)).min(), abs=1e-6)
    assert least <= (even * np.cos(t) + odd * np.sin(t)).min() + 1e-12


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(60))
def test_a_rectangle_under_a_tread_is_recognised(seed: int) -> None:
    """`covers` agrees with points of the tread, except within 4 mm of the rectangle's sides."""
    rng = np.random.default_rng(seed)
    w, radius, half = some_wheel(rng)
    x0, y0 = rng.uniform(-1.2, 0.8, 2)
    x1, y1 = x0 + rng.uniform(0.02, 0.8), y0 + rng.uniform(0.02, 0.8)
    phi, s = np.meshgrid(np.linspace(-math.pi, math.pi, 2001), np.linspace(-half, half, 201))
    u, q = radius * np.sin(phi), radius * np.cos(phi)
    x = s * w[wheel.AX] + u * w[wheel.EX] - q * w[wheel.UX]
    y = s * w[wheel.AY] + u * w[wheel.EY] - q * w[wheel.UY]
    within = np.minimum(np.minimum(x - x0, x1 - x), np.minimum(y - y0, y1 - y)).max()
    if abs(within) > 0.004:
        assert wheel.covers(w, x0, x1, y0, y1) == (within > 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_upper_bound_surface_is_above_the_spline(seed: int) -> None:
    """No point of a spline is above the bilinear surface through its upper bounds at the nodes."""
    rng = np.random.default_rng(seed)
    terrain = rb.Terrain.from_array(rng.normal(size=(12, 9)), (0.5, 0.7))
    surface = rb.Terrain.from_array(terrain.upper_bound, (0.5, 0.7), interpolation="linear")
    x, y = rng.uniform(0, 4, 20000), rng.uniform(0, 7.7, 20000)
    assert (terrain.height(x, y) - terrain.meta[ground.META_Z] - surface.height(x, y)).max() <= 1e-12


@pytest.mark.parametrize("seed", range(8))
def test_a_minimum_on_the_border_of_two_parts_is_found(seed: int) -> None:
    """The hills are symmetric about a cell's middle.

    Its quarters meet there, and the slope's sign is rounding.
    """
    rng = np.random.default_rng(seed)
    rover = rb.load_rover("curiosity")
    n, dx = 44, 0.2
    cell = 20  # the middle of cell (20, 20) is the middle of the hill
    at = np.arange(n) - (cell + 0.5)
    width = rng.uniform(0.35, 1.2)
    bump = np.exp(-0.5 * (at[:, None] ** 2 + at[None, :] ** 2) / width**2) * rng.uniform(0.02, 0.2)
    terrain = rb.Terrain.from_array(bump, dx, (-(cell + 0.5) * dx, -(cell + 0.5) * dx))
    middle = rover.body_box.mean(axis=0)
    x, y, z = -middle[0] + rng.uniform(-0.1, 0.1), -middle[1] + rng.uniform(-0.1, 0.1), 1.0 - rover.body_box[0, 2]
    q = np.array([z, 0.0, 0.0, 0.0, 0.0, 0.0])
    level = rb.Pose(rover, terrain, np.array(x), np.array(y), np.array(0.0), np.zeros(6), q, np.array(0, np.uint8))
    highest = max(float(terrain.height(0.0, 0.0)), 0.0)
    assert level.clearance == pytest.approx(1.0 - highest, abs=2e-9)
    # and a wide wheel over the hill, found by settling
    hub = rover.hubs[2]
    pose = rb.settle(rover, terrain, -hub[0], -hub[1], 0.0)
    check = rb.verify(pose)
    assert pose.status == rb.Status.CONVERGED
    assert check.passes(1e-6)
    assert ((check.gap_low - 1e-8 <= pose.gap) & (pose.gap <= check.gap_high + 1e-8)).all()


def some_cell(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Return the coefficients of one cell of 4 m, its map header, and a wheel over its middle."""
    c = rng.normal(size=(4, 4)) * rng.choice([0.01, 0.1, 0.5])
    meta = np.zeros(ground.META_SIZE)
    meta[[ground.META_DX, ground.META_DY, ground.META_NX, ground.META_NY, ground.META_CUBIC]] = 4.0, 4.0, 2, 2, 1.0
    w, _, _ = some_wheel(rng)
    w[wheel.HX] += 2.0
    w[wheel.HY] += 2.0
    return c, meta, w


def height_of_half(c: Array, meta: Array, w: Array, side: float, x: float, y: float) -> float:
    """Return the height of half a tread above the terrain, m; NaN beside it."""
    u, v = x * w[wheel.EX] + y * w[wheel.EY], x * w[wheel.VX] + y * w[wheel.VY]
    if abs(u) > w[wheel.RADIUS]:
        return math.nan
    t = w[wheel.HZ] + v * w[wheel.TAN] - side * math.sqrt(w[wheel.RADIUS] ** 2 - u * u) / w[wheel.COS]
    return float(t - ground.surface(c, meta, w[wheel.HX] + x, w[wheel.HY] + y)[0])


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(12))
def test_parts_of_a_cell_are_bounded_and_decided(seed: int) -> None:
    """A closed part has no minimum below the limit; a convex part lies below its chords."""
    rng = np.random.default_rng(seed)
    c, meta, w = some_cell(rng)
    radius, decided = w[wheel.RADIUS], [0, 0, 0]
    for _ in range(8):
        side = rng.choice([1.0, 1.0, -1.0])
        rx, ry = rng.uniform(0.01, 0.5, 2) * radius * rng.choice([0.1, 1.0])
        x, y = rng.uniform(-0.9, 0.9, 2) * radius
        xs, ys = np.linspace(x - rx, x + rx, 21), np.linspace(y - ry, y + ry, 21)
        heights = np.array([[height_of_half(c, meta, w, side, a, b) for a in xs] for b in ys])
        if np.isnan(heights).all():
            continue
        sine = rng.uniform(-1.0, 1.0)
        low, _, _ = cubic_tread.bound_part(c, meta, w, side, 0, 0, x, y, rx, ry, sine, -math.inf)
        least = np.nanmin(heights)
        assert low <= least + 1e-12
        limit = least + rng.choice([-0.01, 0.01, 1.0]) * radius
        verdict = cubic_tread._decide(c, meta, w, side, 0, 0, x, y, rx, ry, sine, limit)
        decided[verdict] += 1
        if verdict == cubic_tread.CLOSED and least < limit:
            j, i = np.unravel_index(np.nanargmin(heights), heights.shape)
            inside = 0 < i < 20 and 0 < j < 20
            assert not inside or np.isnan(heights[j - 1 : j + 2, i - 1 : i + 2]).any()
        if verdict == cubic_tread.CONVEX:
            for axis in (0, 1):
                second = np.diff(heights, 2, axis)
                assert not (second < -1e-9).any()
            diagonal = heights[2:, 2:] - 2.0 * heights[1:-1, 1:-1] + heights[:-2, :-2]
            assert not (diagonal < -1e-9).any()
    assert sum(decided) > 0


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(20))
def test_a_valley_over_a_plane_is_bounded_exactly(seed: int) -> None:
    """Over curved patches the bound is a lower bound; over a plane it is the minimum."""
    rng = np.random.default_rng(seed)
    bowl, (a, b), (gx, gy) = (
        rng.uniform(0.1, 3.0),
        rng.normal(size=2) * rng.choice([1.0, 0.0], 2, p=[0.8, 0.2]),
        rng.normal(size=2),
    )
    at = np.linspace(-1.0, 1.0, 401)
    x, y = np.meshgrid(at, at)
    valley, nodes = bowl * (a * x + b * y) ** 2, np.linspace(-1.0, 1.0, 4)
    patch = np.zeros(cubic_patch.BOUNDS_SIZE)
    patch[:16] = (0.3 + gx * nodes + gy * nodes[:, None]).ravel()
    least = (0.3 + gx * x + gy * y + valley).min()
    low = cubic_patch.lowest_over_valley(patch, bowl, a, b)
    assert least - 1e-4 * bowl <= low <= least + 1e-12
    patch[:16] += 0.1 * rng.normal(size=16)
    weights = np.array([math.comb(3, k) * ((1 + at) / 2) ** k * ((1 - at) / 2) ** (3 - k) for k in range(4)])
    heights = np.einsum("my,nx,mn->yx", weights, weights, patch[:16].reshape(4, 4)) + valley
    assert cubic_patch.lowest_over_valley(patch, bowl, a, b) <= heights.min() + 1e-12


@pytest.mark.nojit
@pytest.mark.parametrize("seed", range(40))
def test_bounded_steps_lead_to_the_minimum_in_a_rectangle(seed: int) -> None:
    """On convex quadratics, also narrow valleys, the steps end at the minimum."""
    rng = np.random.default_rng(seed)
    angle, stiff = rng.uniform(0.0, math.pi), 10.0 ** rng.uniform(-7.0, 0.0)
    axis = np.array([math.cos(angle), math.sin(angle)])
    hessian = np.outer(axis, axis) + stiff * (np.eye(2) - np.outer(axis, axis))
    centre, size = rng.normal(size=2) * 2.0, rng.uniform(0.2, 1.0, 2)

    def value(at: Array) -> float:
        return float(0.5 * (at - centre) @ hessian @ (at - centre))

    at = np.zeros(2)
    for _ in range(30):
        slope = hessian @ (at - centre)
        x, y, decrease, held = cubic_parts.bounded_step(*at, *size, *slope, hessian[0, 0], hessian[0, 1], hessian[1, 1])
        assert held >= 0
        if decrease < tolerances.MIN_DECREASE:
            break
        at = np.array([x, y])
    assert decrease < tolerances.MIN_DECREASE
    assert (np.abs(at) <= size).all()
    root = np.linalg.cholesky(hessian).T
    best = lsq_linear(root, root @ centre, (-size, size), tol=1e-14).x
    assert value(at) <= value(best) + 1e-12


@pytest.mark.nojit
@pytest.mark.parametrize("steep", [0.0, 1.0, -1e3, 1e5, -1e6])
@pytest.mark.parametrize("middle", [0.0, 0.9, 1.2])
def test_newton_converges_at_the_ends_of_a_tread(steep: float, middle: float) -> None:
    """The minimum of a part is found on any slope, also within 1e-12 of the tread's end."""
    radius, half = 0.25, 0.2
    _, meta, w = some_cell(np.random.default_rng(0))
    # a cylinder along the wheel's heading: the spline of these coefficients is steep x - (y - 2)² / 16 and a constant
    c = 4.0 * steep * np.arange(4.0)[None, :] - (np.arange(4.0)[:, None] - 1.5) ** 2
    assert wheel.make_wheel(w, 2.0, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, radius, half)
    lowest, side = np.full(wheel.CONTACT_SIZE, math.inf), math.copysign(1.0, steep)
    part = middle * radius * side, 0.0, 0.5 * radius if middle else radius, 0.1
    none = np.empty((0, wheel.CONTACT_SIZE))
    assert cubic_tread._convex_part(c, meta, w, 1.0, *part, Minima(lowest, -math.inf, none), 0) == 0
    best = steep / math.hypot(1.0, steep)  # sin φ of the minimum, limited to the part
    sine = side * max(abs(best), middle - 0.5 if middle else 0.0)
    hub, _, _, _, _, _ = ground.surface(c, meta, 2.0, 2.0)
    least = -radius * math.sqrt(1.0 - sine * sine) - steep * radius * sine - hub
    assert lowest[wheel.GAP] == pytest.approx(least, abs=1e-12 * (1.0 + abs(hub)))
    assert lowest[wheel.SIN] == pytest.approx(sine, abs=1e-9)
