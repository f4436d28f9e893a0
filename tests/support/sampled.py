"""Upper bounds of gap and clearance by dense sampling, without search kernels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import rockerbogie as rb
from support import oracle

Array = NDArray[np.float64]
Height = Callable[[Array, Array], Array]

PER_CELL = 8.0  # samples per cell and axis
MOST = (900, 120)  # largest number of samples of a tread, around and across
MINIMA = 12  # local minima refined of each tread or face
COUNTED = 60  # the same, for counts of contacts
ZOOMS, FINE, SHRINK = 9, 9, 3.5  # refinements of a minimum, samples per axis of each, factor of their spacings
POINTS = 1 << 18  # points evaluated at once


@dataclass
class Minima:
    """Local minima (m, MINIMA) of m treads or faces, lowest first; gap inf if there are fewer."""

    gap: Array  # height over the terrain, m
    phi: Array
    s: Array


def local_minima(height: Height, wheels: oracle.Wheels, cell: float, per_cell: float = PER_CELL, most: int = MINIMA) -> Minima:
    """Sample every tread (m,) and refine its lowest local minima.

    Args:
        height: z (...) of the terrain at x, y (...), m; NaN over missing data.
        wheels: treads or faces in the world.
        cell: smallest node spacing, m.
        per_cell: samples per cell and axis.
        most: minima kept of each tread.

    Returns:
        The minima: each `gap` is the height of a tread point over the terrain; points over missing data are left out.
    """
    m = len(wheels.radius)
    out = Minima(np.full((m, most), np.inf), np.zeros((m, most)), np.zeros((m, most)))
    extents = wheels.extent()
    for unit, span, half in np.unique(extents, axis=0):
        here = np.flatnonzero((extents == (unit, span, half)).all(axis=1))
        round_ = not isinstance(wheels, oracle.Faces)
        reach = np.pi / 2 + 0.1 if round_ else span
        n_phi, n_s = (
            1 if a == 0.0 else int(np.clip(np.ceil(2 * per_cell * a / cell), fewest, limit)) | 1
            for a, fewest, limit in ((unit * reach, 121, MOST[0]), (half, 9, MOST[1]))
        )
        run = max(POINTS // (n_phi * n_s), 1)
        for start in range(0, len(here), run):
            at = here[start : start + run]
            gap, phi, s = _search(height, wheels.take(at), reach, half, n_phi, n_s, round_, most)
            out.gap[at], out.phi[at], out.s[at] = gap, phi, s
    return out


def _search(
    height: Height, w: oracle.Wheels, reach: float, half: float, n_phi: int, n_s: int, round_: bool, most: int
) -> tuple[Array, Array, Array]:
    """Return gap, φ and s (m, most) of treads of one size, from an n_phi × n_s grid each."""
    m = len(w.radius)
    middle = np.arctan2(w.X[:, 2], w.Z[:, 2]) if round_ else np.zeros(m)  # the lowest point of the rim
    a, b = np.linspace(-reach, reach, n_phi), np.linspace(-half, half, n_s) if n_s > 1 else np.zeros(1)
    phi, s = (middle[:, None, None] + a[:, None]) + 0 * b, np.zeros((m, n_phi, 1)) + b
    f = over(height, w, phi, s)
    f = np.where(np.isnan(f), np.inf, f)
    padded = np.pad(f, ((0, 0), (1, 1), (1, 1)), constant_values=np.inf)
    least = np.isfinite(f)
    for dj in (0, 1, 2):
        for di in (0, 1, 2):
            if (dj, di) != (1, 1):
                least &= f <= padded[:, dj : dj + n_phi, di : di + n_s]
    kept = np.where(least, f, np.inf).reshape(m, -1)
    k = min(most, kept.shape[1])
    order = np.argpartition(kept, k - 1, axis=1)[:, :k] if k < kept.shape[1] else np.argsort(kept, axis=1)
    gap, cp, cs = (np.take_along_axis(v.reshape(m, -1), order, 1) for v in (kept, phi, s))
    dp, ds = (a[1] - a[0]) if n_phi > 1 else 0.0, (b[1] - b[0]) if n_s > 1 else 0.0
    u, v = (g.ravel() for g in np.meshgrid(np.linspace(-1, 1, FINE if dp else 1), np.linspace(-1, 1, FINE if ds else 1)))
    low, high = (middle[:, None, None] - reach, middle[:, None, None] + reach) if not round_ else (-np.inf, np.inf)
    for _ in range(ZOOMS):
        gp, gs = np.clip(cp[..., None] + dp * u, low, high), np.clip(cs[..., None] + ds * v, -half, half)
        f = over(height, w, gp, gs)
        f = np.where(np.isnan(f), np.inf, f)
        best = f.argmin(axis=-1)[..., None]
        found, at_phi, at_s = (np.take_along_axis(g, best, -1)[..., 0] for g in (f, gp, gs))
        better = (found < gap) & np.isfinite(gap)
        gap, cp, cs = np.where(better, found, gap), np.where(better, at_phi, cp), np.where(better, at_s, cs)
        dp, ds = dp / SHRINK, ds / SHRINK
    order = np.argsort(gap, axis=1)
    out = [np.take_along_axis(g, order, 1) for g in (gap, cp, cs)]
    if k < most:
        out = [np.pad(g, ((0, 0), (0, most - k)), constant_values=c) for g, c in zip(out, (np.inf, 0.0, 0.0), strict=True)]
    return out[0], out[1], out[2]


def over(height: Height, w: oracle.Wheels, phi: Array, s: Array) -> Array:
    """Return the height over the terrain of tread points (φ, s) (m, ...), m."""
    tail = (slice(None),) + (None,) * (phi.ndim - 1)
    if isinstance(w, oracle.Faces):
        p = [w.hub[:, k][tail] + phi * w.X[:, k][tail] + s * w.Y[:, k][tail] for k in range(3)]
    else:
        sin, cos, r = np.sin(phi), np.cos(phi), w.radius[tail]
        p = [w.hub[:, k][tail] + s * w.Y[:, k][tail] - r * (sin * w.X[:, k][tail] + cos * w.Z[:, k][tail]) for k in range(3)]
    return np.asarray(p[2] - height(p[0], p[1]))


def tread_minima(pose: rb.Pose, per_cell: float = PER_CELL) -> Minima:
    """Return the local minima (6 n, MINIMA) of every tread of poses (n,)."""
    wheels = oracle.stand(pose.rover, pose.x, pose.y, pose.yaw, pose.q, pose.steering)
    return local_minima(pose.terrain.height, wheels, min(pose.terrain.spacing), per_cell)


def least_gap(pose: rb.Pose, per_cell: float = PER_CELL) -> Array:
    """Return an upper bound of each gap (n, 6) of poses (n,), m."""
    return tread_minima(pose, per_cell).gap[:, 0].reshape(-1, 6)


def least_clearance(pose: rb.Pose, per_cell: float = PER_CELL) -> Array:
    """Return an upper bound of the clearance (n,) of poses (n,), m."""
    faces = oracle.box(pose.rover, pose.x, pose.y, pose.yaw, pose.q)
    return local_minima(pose.terrain.height, faces, min(pose.terrain.spacing), per_cell).gap[:, 0].reshape(-1, 3).min(axis=1)


def along_valleys(height: Height, w: oracle.Wheels, phi: Array, s: Array, dphi: float, ds: float) -> tuple[Array, Array, Array]:
    """Refine minima (k,) of one tread on terrain with kinks: minimize over s, then over φ.

    Returns:
        gap (m), φ and s (k,) of points within dphi, ds of those given.
    """
    half, t = float(w.half[0]), np.linspace(-1, 1, 13)
    across = t if half > 0 else np.zeros(1)
    at_phi, at_s, step = phi.copy(), s.copy(), dphi
    best = np.full(len(phi), np.inf)
    for _ in range(12):
        p = at_phi[:, None] + step * t
        q, width = np.repeat(at_s[:, None], len(t), 1), ds
        for _ in range(12 if half > 0 else 1):
            trial = np.clip(q[..., None] + width * across, -half, half)
            f = over(height, w, np.broadcast_to(p[..., None], trial.shape).reshape(1, -1), trial.reshape(1, -1)).reshape(
                trial.shape
            )
            f = np.where(np.isnan(f), np.inf, f)
            k = f.argmin(axis=-1)[..., None]
            q, least = np.take_along_axis(trial, k, -1)[..., 0], np.take_along_axis(f, k, -1)[..., 0]
            width /= 4.0
        k = least.argmin(axis=1)[:, None]
        low, p, q = (np.take_along_axis(a, k, 1)[:, 0] for a in (least, p, q))
        better = low < best
        best, at_phi, at_s = np.where(better, low, best), np.where(better, p, at_phi), np.where(better, q, at_s)
        step /= 4.0
    return best, at_phi, at_s


def contact_count(pose: rb.Pose, keep: float = 1e-6, per_cell: float = PER_CELL) -> NDArray[np.int64]:
    """Return the number (n, 6) of separate contacts of each tread; −1 where it is ambiguous.

    A contact is a minimum within `keep`, m, of the terrain. Two minima are one contact if every point of the line between
    them in (φ, s) is within `keep`. A tread is ambiguous if

    - a minimum or the highest point of such a line lies between keep / 4 and 4 keep,
    - two separate minima are closer than 1 % of the radius,
    - it has more minima than the COUNTED that are refined, or
    - `pose.gap` is lower than all of them by more than keep / 4, so that the sampling has missed a minimum.
    """
    wheels, cell = oracle.stand(pose.rover, pose.x, pose.y, pose.yaw, pose.q, pose.steering), min(pose.terrain.spacing)
    found = local_minima(pose.terrain.height, wheels, cell, per_cell, COUNTED)
    out = np.zeros(len(wheels.radius), dtype=np.int64)
    reported = pose.gap.ravel()
    t = np.linspace(0, 1, 401)
    for k in range(len(out)):
        gap, phi, s, w = found.gap[k], found.phi[k], found.s[k], wheels.take([k])
        if pose.terrain.interpolation == "linear":
            some = gap < np.inf
            gap, phi, s = along_valleys(pose.terrain.height, w, phi[some], s[some], 0.4 * cell / w.radius[0], 0.4 * cell)
        near = np.flatnonzero(gap < 4 * keep)
        vague = (
            np.isfinite(found.gap[k]).all() or (gap[near] > keep / 4).any() or gap.min(initial=np.inf) > reported[k] + keep / 4
        )
        at = np.stack([phi[near], s[near]], -1)
        label = np.arange(len(near))
        for i in range(len(near)):
            for j in range(i):
                line = at[i] + t[:, None] * (at[j] - at[i])
                top = over(pose.terrain.height, w, line[None, :, 0], line[None, :, 1]).max()
                apart = abs(at[i] - at[j]) @ [w.radius[0], 1.0]
                same = apart < 1e-5 * w.radius[0]  # one minimum, found twice
                vague |= not same and (bool(keep / 4 < top < 4 * keep) or (top >= 4 * keep and apart < 0.01 * w.radius[0]))
                if same or top <= keep:
                    label[label == label[i]] = label[j]
        out[k] = -1 if vague else len(set(label.tolist()))
    return out.reshape(-1, 6)
