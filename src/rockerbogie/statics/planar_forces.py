"""Contact forces in the plane of symmetry: least friction, equal friction, least torque.

Three axles with one contact each carry a normal force N and a traction T: six unknowns. Two forces, the moment of the whole rover
and the moment of the bogie balance: four equations. Of the forces that balance, two parameters are free.

- Least friction: smallest μ with |T| ≤ μ N at every axle. Each condition is a wedge in the plane of the two parameters; its apex
  is where N = T = 0. At the smallest μ the three wedges meet in a point (Helly's theorem): either three edges meet there,
  T_i = ±μ N_i, so that the determinant of the balance, a cubic in μ, vanishes; or the apex of a wedge is on an edge of another,
  so that this wheel carries nothing and the others are determined. Wheels that press against each other may need less the
  harder they press, without end. So the normal forces together are at most `WEDGED` weights (Helly's theorem needs a bounded
  set); where they are, two edges meet. All 8 + 3 + 12 candidates are computed; the smallest feasible one is the minimum.
- Equal friction: T_i = κ N_i at all axles, the root of the cubic with equal signs. Six wheels that are driven at one rate, and
  slip, have these forces. Where an axle would have to pull, it carries nothing.
- Least torque: a linear program in the two parameters and the torque, solved by enumeration of its vertices.

Any consistent units may be used; here lengths are in units of the rover and forces in units of its weight.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

#: Normal forces above minus this share of the weight count as pressing.
PULL = 1e-9
#: Residual of a candidate's balance that is accepted before it is solved again, in units of the weight.
NEAR = 1e-6
#: Largest sum of the normal forces, in units of the weight: larger ones would wedge the rover between its contacts.
WEDGED = 50.0
#: Friction coefficients above this do not count.
WIDEST = 64.0
#: Stations that are treated at once: bounds the memory of the enumeration.
CHUNK = 256


def balance(point: Complex, normal: Complex, pivot: Complex, weights: tuple[tuple[Complex, float], ...]) -> tuple[Array, Array]:
    """Return the balance of forces in the plane of symmetry, A f = b.

    f is (N₁, N₂, N₃, T₁, T₂, T₃).

    Rows: force along x, force along z, moment of the rover about the bogie pivot, moment of the bogie about it.

    Args:
        point, normal: (n, 3) contact points and unit normals of rocker wheel, middle wheel and the bogie's other wheel.
        pivot: (n,) bogie pivot.
        weights: centre of mass (n,) and weight of the upper link, then of the bogie.

    Returns:
        A (n, 4, 6) and b (n, 4).
    """
    force = np.concatenate([normal, -1j * normal], axis=1)
    arm = np.concatenate([point, point], axis=1) - pivot[:, None]
    moment = (np.conj(arm) * force).imag
    on_bogie = moment * np.array([0.0, 1.0, 1.0, 0.0, 1.0, 1.0])
    a = np.stack([force.real, force.imag, moment, on_bogie], axis=1)
    (upper, upper_weight), (bogie, bogie_weight) = weights
    bogie_moment = bogie_weight * (bogie - pivot).real
    whole = upper_weight * (upper - pivot).real + bogie_moment
    b = np.stack([np.zeros(pivot.size), np.full(pivot.size, upper_weight + bogie_weight), whole, bogie_moment], axis=1)
    return a, b


def least_friction(a: Array, b: Array) -> tuple[Array, Array]:
    """Return the least friction coefficient that balances each station, and its forces.

    Args:
        a: (n, 4, 6) balance equations.
        b: (n, 4) their right side.

    Returns:
        μ (n,), inf where no coefficient up to `WIDEST` holds, and forces (n, 6), NaN there.
    """
    friction, force = np.zeros(len(a)), _on_level(a, b)
    rest = np.flatnonzero(np.isnan(force[:, 0]))
    for first in range(0, rest.size, CHUNK):
        some = rest[first : first + CHUNK]
        friction[some], force[some] = _least_friction(a[some], b[some])
    return friction, force


def _on_level(a: Array, b: Array) -> Array:
    """Return forces (n, 6) without traction where all contacts are level.

    NaN where a contact is not level, or such forces do not balance.
    """
    level = np.flatnonzero((np.abs(a[:, 0, :3]) < 1e-14).all(axis=1))
    normal = _solve(a[level, 1:, :3], b[level, 1:])
    normal[~(normal >= -PULL).all(axis=1)] = np.nan
    force = np.full((len(a), 6), np.nan)
    force[level, :3], force[level, 3:] = normal, 0.0 * normal
    return force


def _least_friction(a: Array, b: Array) -> tuple[Array, Array]:
    """Return what `least_friction` does, for a few stations at once."""
    normal, traction = a[:, :, :3], a[:, :, 3:]
    signs = np.array(list(product((1.0, -1.0), repeat=3)))[:4]
    candidates, forces = [], []
    roots = _roots(a, b, signs)  # (n, 4, 3)
    for k, sign in enumerate(signs):
        for j in range(3):
            mu = roots[:, k, j]
            slope = np.where(np.isfinite(mu), mu, 0.0)[:, None] * sign
            n = _least_squares(normal + slope[:, None, :] * traction, b)
            candidates.append(np.abs(mu))
            forces.append(np.concatenate([n, slope * n], axis=1))
    for mu, f in (*_unloaded(a, b), *_wedged(a, b)):
        candidates.append(mu)
        forces.append(f)
    mu, f = np.stack(candidates), np.stack(forces)
    residual = np.abs(np.einsum("nij,knj->kni", a, f) - b).max(axis=-1)
    valid = (f[..., :3] >= -PULL).all(axis=-1) & (residual < NEAR) & (mu <= WIDEST)
    valid &= f[..., :3].sum(axis=-1) <= WEDGED * (1.0 + NEAR)
    mu = np.where(valid, mu, np.inf)
    best = mu.argmin(axis=0)
    rows = np.arange(len(a))
    least, force = mu[best, rows], f[best, rows]
    force[~np.isfinite(least)] = np.nan
    return least, force


def _unloaded(a: Array, b: Array) -> Iterator[tuple[Array, Array]]:
    """Yield, for each axle, friction (n,) and forces (n, 6) that balance with no load on it."""
    for i in range(3):
        others = [k for k in range(6) if k % 3 != i]
        f = np.zeros((len(a), 6))
        f[:, others] = _solve(a[:, :, others], b)
        yield _friction_used(f[:, others]), f


def _wedged(a: Array, b: Array) -> Iterator[tuple[Array, Array]]:
    """Yield friction (n,) and forces (n, 6) that balance with `WEDGED` weights on wheels.

    These forces are a line. A ratio |T| / N changes monotonically along it up to T = 0, so the largest of the three ratios is
    least where two of them are equal.
    """
    total = np.broadcast_to(np.repeat([1.0, 0.0], 3), (len(a), 1, 6))
    a, b = np.concatenate([a, total], axis=1), np.concatenate([b, np.full((len(a), 1), WEDGED)], axis=1)
    free = np.linalg.svd(a)[2][:, 5, :]  # the line is start + y free
    start = np.einsum("nij,nj->ni", np.linalg.pinv(a), b)
    for (i, j), sign in product(combinations(range(3), 2), (1.0, -1.0)):
        p, q = (part[:, [i, 3 + i]] for part in (start, free))
        r, s = (part[:, [j, 3 + j]] * [1.0, sign] for part in (start, free))
        # T_i N_j = ±T_j N_i: a quadratic in y
        c, d, e = _area(p, r), _area(p, s) + _area(q, r), _area(q, s)
        with np.errstate(divide="ignore", invalid="ignore"):
            half = -0.5 * (d + np.copysign(np.sqrt(d**2 - 4.0 * c * e), d))
            roots = half / e, c / half
        for y in roots:
            f = start + np.where(np.isfinite(y), y, 0.0)[:, None] * free
            yield _friction_used(f), f


def _area(p: Array, q: Array) -> Array:
    """Return p₁ q₂ − p₂ q₁ of vectors (n, 2)."""
    return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]


def _friction_used(force: Array) -> Array:
    """Return the largest |T| / N (n,) of forces (n, 2 k): normal forces, then tractions."""
    normal, traction = np.split(force, 2, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((np.abs(traction) / normal).max(axis=1))


def equal_friction(a: Array, b: Array, climbing: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the coefficient κ that balances each station with T = κ N, and the forces.

    Where such forces would pull at an axle, that axle carries nothing and the other forces are determined.

    Args:
        a: (n, 4, 6) balance equations.
        b: (n, 4) their right side.
        climbing: (n,) True where gravity acts against the motion: κ is positive there, and negative elsewhere (brakes).

    Returns:
        |κ| (n,), inf where there is none up to `WIDEST`, and forces (n, 6), NaN there.
    """
    roots = _roots(a, b, np.ones((1, 3)))[:, 0]
    normal, traction = a[:, :, :3], a[:, :, 3:]
    mu, force = np.full(len(a), np.inf), np.full((len(a), 6), np.nan)
    for j in range(3):
        kappa = roots[:, j]
        wanted = np.where(climbing, kappa >= -PULL, kappa <= PULL)
        kappa = np.where(np.isfinite(kappa), kappa, 0.0)
        n = _least_squares(normal + kappa[:, None, None] * traction, b)
        f = np.concatenate([n, kappa[:, None] * n], axis=1)
        residual = np.abs(np.einsum("nij,nj->ni", a, f) - b).max(axis=1)
        better = wanted & np.isfinite(roots[:, j]) & (residual < NEAR) & (n >= -PULL).all(axis=1)
        better &= (np.abs(kappa) < mu) & (np.abs(kappa) <= WIDEST)
        mu[better], force[better] = np.abs(kappa[better]), f[better]
    alone, alone_force = np.full(len(a), np.inf), np.full((len(a), 6), np.nan)
    for used, f in _unloaded(a, b):
        better = (f[:, :3] >= -PULL).all(axis=1) & (used < alone) & (used <= WIDEST)
        alone[better], alone_force[better] = used[better], f[better]
    lifted = ~np.isfinite(mu)
    return np.where(lifted, alone, mu), np.where(lifted[:, None], alone_force, force)


def _roots(a: Array, b: Array, signs: Array) -> Array:
    """Return the real roots μ of det[N₁ + μ σ₁ T₁, N₂ + μ σ₂ T₂, N₃ + μ σ₃ T₃, b] = 0.

    Args:
        a: (n, 4, 6) columns of normal forces and tractions.
        b: (n, 4).
        signs: (k, 3) values of σ.

    Returns:
        (n, k, 3), NaN for complex roots.
    """
    coefficient = np.zeros((len(a), len(signs), 4))
    for choice in product((0, 1), repeat=3):
        columns = [i + 3 * c for i, c in enumerate(choice)]
        det = np.linalg.det(np.concatenate([a[:, :, columns], b[:, :, None]], axis=2))
        sign = np.prod(np.where(np.array(choice) == 1, signs, 1.0), axis=1)
        coefficient[:, :, sum(choice)] += det[:, None] * sign
    scale = np.abs(coefficient).max(axis=2)
    scale[scale == 0.0] = 1.0
    coefficient /= scale[..., None]
    lead = coefficient[..., 3]
    lead = np.where(np.abs(lead) < 1e-14, 1e-14, lead)
    companion = np.zeros((*lead.shape, 3, 3))
    companion[..., 1, 0] = companion[..., 2, 1] = 1.0
    companion[..., :, 2] = -coefficient[..., :3] / lead[..., None]
    roots = np.linalg.eigvals(companion)
    real = np.abs(roots.imag) <= 1e-7 * np.maximum(1e-3, np.abs(roots.real))
    found = np.where(real, roots.real, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(2):  # Newton steps against the rounding of the eigenvalues
            value = ((lead[..., None] * found + coefficient[..., 2:3]) * found + coefficient[..., 1:2]) * found + coefficient[
                ..., :1
            ]
            slope = (3.0 * lead[..., None] * found + 2.0 * coefficient[..., 2:3]) * found + coefficient[..., 1:2]
            change = value / slope
            found = np.where(np.abs(change) < 1e-6 * np.maximum(1.0, np.abs(found)), found - change, found)
    return np.asarray(found)


def _least_squares(m: Array, b: Array) -> Array:
    """Return the least-squares solutions (n, 3) of m x = b; NaN where singular.

    m is (n, 4, 3), b (n, 4).
    """
    square = np.einsum("nki,nkj->nij", m, m)
    right = np.einsum("nki,nk->ni", m, b)
    x = _solve(square, right)
    return x + _solve(square, np.einsum("nki,nk->ni", m, b - np.einsum("nki,ni->nk", m, x)))


def _solve(m: Array, b: Array) -> Array:
    """Return the solutions of square systems m x = b; NaN where a system is singular."""
    size = m.shape[-1]
    det = np.linalg.det(m)
    norm = np.sqrt((m**2).sum(axis=-2)).prod(axis=-1)
    regular = np.abs(det) > 1e-13 * norm
    x = np.linalg.solve(np.where(regular[..., None, None], m, np.eye(size)), b[..., None])[..., 0]
    return np.asarray(np.where(regular[..., None], x, np.nan))


def least_torque(a: Array, b: Array, radius: Array, friction: float) -> tuple[Array, Array]:
    """Return the least largest |T_i| r_i over forces within the friction cones, and such forces.

    Args:
        a: (n, 4, 6) balance equations.
        b: (n, 4) their right side.
        radius: (3,) wheel radii.
        friction: coefficient μ.

    Returns:
        Largest torque of an axle (n,), inf where no forces balance, and forces (n, 6), NaN there.
    """
    torque, force = np.zeros(len(a)), _on_level(a, b)
    rest = np.flatnonzero(np.isnan(force[:, 0]))
    for first in range(0, rest.size, CHUNK):
        some = rest[first : first + CHUNK]
        torque[some], force[some] = _least_torque(a[some], b[some], radius, friction)
    return torque, force


def _least_torque(a: Array, b: Array, radius: Array, friction: float) -> tuple[Array, Array]:
    """Return what `least_torque` does, for a few stations at once."""
    start = np.einsum("nij,nj->ni", np.linalg.pinv(a), b)
    free = np.linalg.svd(a)[2][:, 4:, :]  # (n, 2, 6): forces that balance by themselves
    # rows g (y₁, y₂, τ) ≤ h: ±T r ≤ τ, ±T ≤ μ N
    rows, right = [], []
    for i in range(3):
        for sign in (1.0, -1.0):
            rows.append(np.concatenate([sign * radius[i] * free[:, :, 3 + i], np.full((len(a), 1), -1.0)], axis=1))
            right.append(-sign * radius[i] * start[:, 3 + i])
    for i in range(3):
        for sign in (1.0, -1.0):
            rows.append(np.concatenate([sign * free[:, :, 3 + i] - friction * free[:, :, i], np.zeros((len(a), 1))], axis=1))
            right.append(friction * start[:, i] - sign * start[:, 3 + i])
    g, h = np.stack(rows, axis=1), np.stack(right, axis=1)
    best, force = np.full(len(a), np.inf), np.full((len(a), 6), np.nan)
    for three in combinations(range(12), 3):
        if three[0] >= 6:
            continue  # at least one torque is the largest
        y = _solve(g[:, three], h[:, three])
        inside = (np.einsum("nij,nj->ni", g, y) <= h + 1e-9).all(axis=1)
        better = inside & (y[:, 2] < best)
        best[better] = y[better, 2]
        force[better] = start[better] + np.einsum("ni,nij->nj", y[better, :2], free[better])
    return np.maximum(best, 0.0), force
