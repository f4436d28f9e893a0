"""A slow model written from the definitions alone: what the kernels are held against. Nothing of `_kernels` is used here.

Ground. Linear: bilinear between the four nodes of a cell. Cubic: the bicubic interpolating spline, as scipy makes it.
Wheel. The rim of radius r swept over |s| ≤ width / 2: points hub + s a + r (-sin φ X - cos φ Z), φ the whole way round,
X, a, Z the axle frame's directions. Gap: the least of (tread z - ground z) over all of them.

The gap is found by halving boxes of (φ, s) and dropping those that are proved to lie higher than the best point seen:
the answer is bracketed, best - tolerance ≤ gap ≤ best, however many places come near it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import comb, factorial
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import RectBivariateSpline
from scipy.ndimage import maximum_filter
from scipy.spatial.transform import Rotation

from rockerbogie import Rover, Terrain

Array = NDArray[np.float64]
Cell = tuple[NDArray[np.int64], NDArray[np.int64]]  # rows, columns


@dataclass
class Ground:
    """A height field as one polynomial a cell: z = Σ patch[row, col, b, a] u^a v^b, (u, v) metres from the cell's corner."""

    patch: Array  # (rows - 1, cols - 1, order, order)
    bend: Array  # (rows - 1, cols - 1, 3) bounds of |z_xx|, |z_xy|, |z_yy| over the cell
    top: Array  # (rows - 1, cols - 1) and of z, from above
    spacing: tuple[float, float]
    origin: tuple[float, float]

    @classmethod
    def of(cls, terrain: Terrain) -> Ground:
        """The ground a Terrain says it is, from its heights, spacing and kind."""
        z = np.asarray(terrain.z, dtype=float)
        dx, dy = terrain.spacing
        rows, cols = z.shape
        if terrain.interpolation == "linear":
            a, b, c, d = z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]
            rise, climb, twist = (b - a) / dx, (c - a) / dy, (a - b - c + d) / (dx * dy)
            patch = np.stack([np.stack([a, rise], -1), np.stack([climb, twist], -1)], -2)
            bend = np.stack([0 * twist, abs(twist), 0 * twist], -1)
            return cls(patch, bend, np.max([a, b, c, d], axis=0), terrain.spacing, terrain.origin)
        x, y = dx * np.arange(cols), dy * np.arange(rows)
        spline = RectBivariateSpline(y, x, z, s=0)
        at_node = np.zeros((rows, cols, 4, 4))
        for b in range(3):
            for a in range(3):
                at_node[..., b, a] = spline(y, x, dx=b, dy=a)
        at_node[:, :-1, :, 3] = np.diff(at_node[..., 2], axis=1) / dx  # the third is the same all over a cell
        at_node[:-1, :, 3, :] = np.diff(at_node[..., 2, :], axis=0) / dy
        over = np.array([factorial(k) for k in range(4)])
        patch = at_node[:-1, :-1] / np.outer(over, over)
        return cls(patch, *_bounds(patch, dx, dy), terrain.spacing, terrain.origin)

    def cells(self, x: Array, y: Array) -> Cell:
        """Row and column of the cell of each point; beyond the map's rim, the rim's."""
        rows, cols = self.patch.shape[:2]
        col = np.clip(np.floor((x - self.origin[0]) / self.spacing[0]).astype(int), 0, cols - 1)
        row = np.clip(np.floor((y - self.origin[1]) / self.spacing[1]).astype(int), 0, rows - 1)
        return row, col

    def patch_at(self, row: NDArray[np.int64], col: NDArray[np.int64], x: Array, y: Array) -> tuple[Array, Array, Array]:
        """z, z_x, z_y at (x, y) of the given cells' polynomials, carried on past the cell where the point lies outside."""
        u = x - (self.origin[0] + self.spacing[0] * col)
        v = y - (self.origin[1] + self.spacing[1] * row)
        c = self.patch[row, col]
        order = c.shape[-1]
        z, zx, zy = np.zeros_like(u), np.zeros_like(u), np.zeros_like(u)
        for b in reversed(range(order)):
            line, slope = np.zeros_like(u), np.zeros_like(u)
            for a in reversed(range(order)):
                slope = slope * u + line
                line = line * u + c[:, b, a]
            zy = zy * v + z
            z = z * v + line
            zx = zx * v + slope
        return z, zx, zy

    def height(self, x: ArrayLike, y: ArrayLike) -> Array:
        """(...) z at points."""
        px, py = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        flat = px.ravel(), py.ravel()
        return self.patch_at(*self.cells(*flat), *flat)[0].reshape(px.shape)


def _bounds(patch: Array, dx: float, dy: float) -> tuple[Array, Array]:
    """Bounds of the second derivatives and of the height over each cell: a polynomial lies within its Bernstein coefficients."""
    unit = patch * np.outer(dy ** np.arange(4), dx ** np.arange(4))
    to_bernstein = np.array([[comb(i, k) / comb(3, k) for k in range(4)] for i in range(4)])
    b = np.einsum("ik,...kl,jl->...ij", to_bernstein, unit, to_bernstein)

    def greatest(c: Array) -> Array:
        return np.asarray(abs(c).max(axis=(-2, -1)))

    bend = [
        greatest(6 * np.diff(b, 2, axis=-1)) / dx**2,
        greatest(9 * np.diff(np.diff(b, axis=-1), axis=-2)) / (dx * dy),
        greatest(6 * np.diff(b, 2, axis=-2)) / dy**2,
    ]
    return np.stack(bend, -1), b.max(axis=(-2, -1))


@dataclass
class Wheels:
    """m wheels in the world: hubs (m, 3), axle frames' X, Y (along the axle), Z (m, 3), radius and half width (m,)."""

    hub: Array
    X: Array
    Y: Array
    Z: Array
    radius: Array
    half: Array

    def take(self, index: ArrayLike) -> Self:
        """Some of them, or some of them many times over."""
        return type(self)(*(getattr(self, field.name)[np.asarray(index)] for field in fields(self)))

    def extent(self) -> Array:
        """(m, 3) metres to a unit of φ at most, φ's half range, s's."""
        return np.stack([self.radius, np.full_like(self.radius, np.pi), self.half], -1)

    def tread(self, phi: Array, s: Array) -> tuple[Array, Array]:
        """Points (m, 3) of the tread, one a wheel, and their derivative by φ."""
        r, sin, cos = self.radius[:, None], np.sin(phi)[:, None], np.cos(phi)[:, None]
        return self.hub + s[:, None] * self.Y - r * (sin * self.X + cos * self.Z), r * (sin * self.Z - cos * self.X)


@dataclass
class Faces(Wheels):
    """m flat faces, searched as treads are: middle + φ X + s Y, |φ| ≤ reach, |s| ≤ half; radius is nought."""

    reach: Array

    def extent(self) -> Array:
        """(m, 3) metres to a unit of φ, φ's half range, s's."""
        return np.stack([np.ones_like(self.reach), self.reach, self.half], -1)

    def tread(self, phi: Array, s: Array) -> tuple[Array, Array]:
        """Points (m, 3), one a face, and their derivative by φ."""
        return self.hub + phi[:, None] * self.X + s[:, None] * self.Y, self.X


def _about(axis: int, angle: Array) -> Rotation:
    return Rotation.from_rotvec(np.multiply.outer(angle, np.eye(3)[axis]))


@dataclass
class Stance:
    """Where the parts of n rovers stand: rotations and fixed points of each link, its own origin (n, 3) to the world's.

    Links in the rover's order: body, rockers, bogies, wheels. A point p of link k, given in the body frame at rest, is at
    at[k] + turn[k] (p - rest[k]).
    """

    turn: list[Rotation]
    rest: list[Array]
    at: list[Array]

    def place(self, link: int, p: ArrayLike) -> Array:
        """(n, 3) where a link's point p (3,) is."""
        return self.at[link] + self.turn[link].apply(np.asarray(p, dtype=float) - self.rest[link])


def stance(rover: Rover, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, q: ArrayLike, steering: ArrayLike | None = None) -> Stance:
    """The linkage at poses (n,): q (n, 6) is z, roll, pitch, left rocker, bogies left and right.

    From the body out: R = Rz(yaw) Ry(pitch) Rx(roll); every suspension joint turns about the body's y; a wheel steers
    about the upright line through its hub plus its steering offset.
    """
    q = np.atleast_2d(np.asarray(q, dtype=float))
    n = len(q)
    x, y, yaw = (np.broadcast_to(np.asarray(a, dtype=float), n) for a in (x, y, yaw))
    psi = np.broadcast_to(np.zeros(6) if steering is None else np.asarray(steering, dtype=float), (n, 6))
    body = _about(2, yaw) * _about(1, q[:, 2]) * _about(0, q[:, 1])
    parts = Stance([body], [np.zeros(3)], [np.stack([x, y, q[:, 0]], -1)])

    def hang(parent: int, joint: Array, turn: Rotation) -> None:
        """A link that turns about `joint`, a point of its parent."""
        parts.at.append(parts.place(parent, joint))
        parts.turn.append(parts.turn[parent] * turn)
        parts.rest.append(joint)

    right = sum(c * q[:, 3] ** k for k, c in enumerate(rover.differential))
    for side, angle in enumerate((q[:, 3], right)):
        hang(0, rover.rocker_pivot[side], _about(1, angle))
    for side in (0, 1):
        hang(1 + side, rover.bogie_pivot[side], _about(1, q[:, 4 + side]))
    for i in range(6):
        post = rover.hubs[i] + [*rover.steering_offset[i], 0.0]
        hang((1 if i < 2 else 3) + i % 2, post, _about(2, psi[:, i]))
    return parts


def stand(rover: Rover, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, q: ArrayLike, steering: ArrayLike | None = None) -> Wheels:
    """The wheels (6 n) of poses (n,), as `stance`."""
    parts = stance(rover, x, y, yaw, q, steering)
    hubs = np.stack([parts.place(5 + i, rover.hubs[i]) for i in range(6)], axis=1)
    frames = np.stack([parts.turn[5 + i].as_matrix() for i in range(6)], axis=1).reshape(-1, 3, 3)
    n = len(hubs)
    return Wheels(
        hubs.reshape(-1, 3), frames[:, :, 0], frames[:, :, 1], frames[:, :, 2],
        np.tile(rover.wheel_radius, n), np.tile(rover.wheel_width / 2, n),
    )  # fmt: skip


def box(rover: Rover, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, q: ArrayLike) -> Faces:
    """The lower three faces of the body's box (3 n) at poses (n,): above each of its points there is only more box."""
    parts = stance(rover, x, y, yaw, q)
    axes = parts.turn[0].as_matrix()
    low, high = rover.body_box
    size, middle = (high - low) / 2, (high + low) / 2
    faces = []
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        down = -np.where(axes[:, 2, axis] > 0, size[axis], -size[axis])[:, None] * axes[:, :, axis]
        lengths = np.tile([0.0, size[two], size[one]], (len(axes), 1))
        faces.append((parts.place(0, middle) + down, axes[:, :, one], axes[:, :, two], axes[:, :, axis], *lengths.T))
    return Faces(*(np.stack(a, axis=1).reshape(len(axes) * 3, *a[0].shape[1:]) for a in zip(*faces, strict=True)))


def mass_height(rover: Rover, parts: Stance) -> Array:
    """(n,) height of the whole rover's centre of mass, m."""
    heights = [link.mass * parts.place(k, link.com)[:, 2] for k, link in enumerate(rover.links)]
    return np.asarray(sum(heights) / rover.mass)


@dataclass
class Least:
    """The best point of each tread: best - tolerance ≤ gap ≤ best, and where (φ, s) it is."""

    gap: Array
    phi: Array
    s: Array


def least_gap(ground: Ground, wheels: Wheels, tolerance: float = 1e-10) -> Least:
    """The gap of each wheel (m,), bracketed to `tolerance`, over the whole of its tread."""
    m = len(wheels.radius)
    best = Least(np.full(m, np.inf), np.zeros(m), np.zeros(m))
    k, phi, s, dphi, ds = _boxes(ground, wheels)
    while k.size:
        w = wheels.take(k)
        f, low, split_phi = _look(ground, w, phi, s, dphi, ds)
        order = np.lexsort((f, k))
        first = order[np.unique(k[order], return_index=True)[1]]
        first = first[f[first] < best.gap[k[first]]]
        best.gap[k[first]], best.phi[k[first]], best.s[k[first]] = f[first], phi[first], s[first]
        keep = low < best.gap[k] - tolerance
        k, phi, s, dphi, ds, split_phi = (a[keep] for a in (k, phi, s, dphi, ds, split_phi))
        dphi, ds = np.where(split_phi, dphi / 2, dphi), np.where(split_phi, ds, ds / 2)
        step, side = np.where(split_phi, dphi, 0.0), np.where(split_phi, 0.0, ds)
        phi, s = np.concatenate([phi - step, phi + step]), np.concatenate([s - side, s + side])
        k, dphi, ds = np.tile(k, 2), np.tile(dphi, 2), np.tile(ds, 2)
        assert k.size < 4_000_000, "the brackets do not close: not a ground this search can prove"
    return best


WINDOW = 5  # cells either way that a first, coarse box may reach over


def _boxes(ground: Ground, wheels: Wheels) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
    """Boxes (wheel, φ, s, half sizes) that cover every tread but where it clears all ground round about, each reaching
    over no more than one cell's size in x or y."""
    cell = min(ground.spacing)
    roof = maximum_filter(ground.top, 2 * WINDOW + 1)
    out = []
    extents = wheels.extent()
    for unit, span, half in np.unique(extents, axis=0):
        fine_phi, fine_s = max(12, int(np.ceil(4.5 * unit * span / cell))), max(1, int(np.ceil(4.5 * half / cell)))
        n_phi, n_s = max(12, -(-fine_phi // 8)), -(-fine_s // 8)
        here = np.flatnonzero((extents == (unit, span, half)).all(axis=1))
        phi, s = _grid(np.array([0.0]), np.array([0.0]), span, half, n_phi, n_s)
        k, phi, s = np.repeat(here, phi.size), np.tile(phi, here.size), np.tile(s, here.size)
        w = wheels.take(k)
        p, along = w.tread(phi, s)
        drop = abs(along[:, 2]) * span / n_phi + abs(w.Y[:, 2]) * half / n_s + 0.5 * unit * (span / n_phi) ** 2
        over = p[:, 2] - ground.height(p[:, 0], p[:, 1])
        best = np.full(len(wheels.radius), np.inf)
        np.minimum.at(best, k, over)
        near = p[:, 2] - drop - roof[ground.cells(p[:, 0], p[:, 1])] < best[k]
        k, phi, s = k[near], phi[near], s[near]
        m_phi, m_s = -(-fine_phi // n_phi), -(-fine_s // n_s)
        phi, s = _grid(phi, s, span / n_phi, half / n_s, m_phi, m_s)
        k = np.repeat(k, m_phi * m_s)
        out.append((k, phi, s, np.full(k.size, span / n_phi / m_phi), np.full(k.size, half / n_s / m_s)))
    return tuple(np.concatenate(a) for a in zip(*out, strict=True))  # type: ignore[return-value]


def _grid(phi: Array, s: Array, dphi: float, ds: float, n_phi: int, n_s: int) -> tuple[Array, Array]:
    """The middles of n_phi by n_s boxes in each box of half sizes dphi, ds about (φ, s), flat."""
    p = dphi * ((2 * np.arange(n_phi) + 1) / n_phi - 1)
    q = ds * ((2 * np.arange(n_s) + 1) / n_s - 1)
    p, q = (a.ravel() for a in np.meshgrid(p, q, indexing="ij"))
    return np.add.outer(phi, p).ravel(), np.add.outer(s, q).ravel()


def _look(ground: Ground, w: Wheels, phi: Array, s: Array, dphi: Array, ds: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Height over ground at each box's middle, a bound from below over the box, and whether φ makes most of its slack."""
    p, along = w.tread(phi, s)
    curl = 0.5 * w.radius[:, None] * np.hypot(w.X, w.Z) * dphi[:, None] ** 2  # what second order in φ moves x, y, z by
    turned, slid = abs(along) * dphi[:, None] + curl, abs(w.Y) * ds[:, None]
    rx, ry = (turned + slid)[:, :2].T
    lowest, highest = ground.cells(p[:, 0] - rx, p[:, 1] - ry), ground.cells(p[:, 0] + rx, p[:, 1] + ry)
    corners = [(row, col) for row in (lowest[0], highest[0]) for col in (lowest[1], highest[1])]
    bend = np.max([ground.bend[c] for c in corners], axis=0)

    def bent(ax: Array, ay: Array) -> Array:
        return 0.5 * bend[:, 0] * ax**2 + bend[:, 1] * ax * ay + 0.5 * bend[:, 2] * ay**2

    def over(cell: Cell) -> Over:
        h, hx, hy = ground.patch_at(*cell, p[:, 0], p[:, 1])
        return Over(
            p[:, 2] - h,
            along[:, 2] - hx * along[:, 0] - hy * along[:, 1],
            w.Y[:, 2] - hx * w.Y[:, 0] - hy * w.Y[:, 1],
            curl[:, 2] + abs(hx) * curl[:, 0] + abs(hy) * curl[:, 1] + bent(rx, ry),
            hx,
            hy,
        )

    here = over(ground.cells(p[:, 0], p[:, 1]))
    cells = [here]
    low = here.low(dphi, ds)
    if ground.patch.shape[-1] == 2:  # kinked: each point of the box lies over one of the cells it reaches
        cells = [over(c) for c in corners]
        low = np.min([one.low(dphi, ds) for one in cells], axis=0)
        ridge = _ridge(ground, lowest, highest, cells[0], cells[3], rx, ry)
        low = np.where(ridge, np.maximum(low, _over_ridge(cells[0], cells[3], dphi, ds)), low)
    turn = np.max([abs(one.by_phi) * dphi for one in cells], axis=0) + curl[:, 2] + bent(*turned[:, :2].T)
    slide = np.max([abs(one.by_s) * ds for one in cells], axis=0) + bent(*slid[:, :2].T)
    return here.f, low, turn >= slide


@dataclass
class Over:
    """A box over one cell's polynomial: height at its middle, slopes by φ and s, all that is of second order; ground's slopes."""

    f: Array
    by_phi: Array
    by_s: Array
    rest: Array
    hx: Array
    hy: Array

    def low(self, dphi: Array, ds: Array) -> Array:
        """No point of the box is lower."""
        return self.f - abs(self.by_phi) * dphi - abs(self.by_s) * ds - self.rest


def _ridge(ground: Ground, one: Cell, other: Cell, a: Over, b: Over, rx: Array, ry: Array) -> NDArray[np.bool_]:
    """Whether just two cells are reached, and the ground along their common edge is the lower of the two everywhere."""
    twist = abs(ground.patch[one][:, 1, 1] - ground.patch[other][:, 1, 1])
    beside = (one[0] == other[0]) & (other[1] == one[1] + 1) & (a.hx - b.hx > twist * ry)
    behind = (one[1] == other[1]) & (other[0] == one[0] + 1) & (a.hy - b.hy > twist * rx)
    return np.asarray(beside | behind)


def _over_ridge(a: Over, b: Over, dphi: Array, ds: Array) -> Array:
    """The height over the lower of two grounds is no less than any mean of the heights over each: the best of three means."""
    best = np.full(a.f.shape, -np.inf)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = [a.by_phi / (a.by_phi - b.by_phi), a.by_s / (a.by_s - b.by_s), np.full(a.f.shape, 0.5)]
    for share in shares:
        t = np.clip(np.nan_to_num(share, nan=0.5), 0.0, 1.0)
        mean = Over(*((1 - t) * getattr(a, name) + t * getattr(b, name) for name in ("f", "by_phi", "by_s", "rest", "hx", "hy")))
        best = np.maximum(best, mean.low(dphi, ds))
    return best


def settle(
    rover: Rover, ground: Ground, x: Array, y: Array, yaw: Array, steering: Array | None = None, tolerance: float = 1e-12
) -> Array:
    """Poses q (n, 6) whose six gaps are nought within `tolerance`: Newton from a level start, nan where it does not arrive.

    The slopes are differences of the heights of the nearest points; what is found depends on the gaps alone.
    """
    n, step = len(x), 1e-6
    q = np.zeros((n, 6))
    q[:, 0] = ground.height(x, y) - (rover.hubs[:, 2] - rover.wheel_radius).min()

    def wheels(at: Array) -> Wheels:
        return stand(rover, x, y, yaw, at, steering)

    for _ in range(30):
        least = least_gap(ground, wheels(q), tolerance / 10)
        gap = least.gap.reshape(n, 6)
        if abs(gap).max() < tolerance:
            break
        slope = np.empty((n, 6, 6))
        for k, unknown in enumerate(step * np.eye(6)):
            up, down = (wheels(q + sign * unknown).tread(least.phi, least.s)[0] for sign in (1, -1))
            over = [p[:, 2] - ground.height(p[:, 0], p[:, 1]) for p in (up, down)]
            slope[:, :, k] = (over[0] - over[1]).reshape(n, 6) / (2 * step)
        move = np.linalg.solve(slope, -gap[..., None])[..., 0]
        q += move / np.maximum(1.0, abs(move[:, 1:]).max(axis=1, keepdims=True) / 0.3)
    q[abs(gap).max(axis=1) >= tolerance] = np.nan
    return q
