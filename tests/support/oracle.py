"""A slow reference model, written from the definitions alone.

Kernels are compared with it; it uses nothing of `_kernels`.

- Terrain: bilinear between the four nodes of a cell, or SciPy's interpolating bicubic spline.
- Tread: the rim of radius r swept over |s| ≤ width / 2. Its points are hub + s a − r (sin φ X + cos φ Z) for φ over the
  full circle; X, a, Z are the axes of the axle frame.
- Gap: the minimum of (tread z − terrain z) over all these points.

Branch and bound finds the gap: boxes of (φ, s) are halved, and boxes whose lower bound is above the lowest point found are
dropped. The result is a bracket, best − tolerance ≤ gap ≤ best, also if many points are near the minimum.
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
    """A height field as one polynomial per cell.

    z = Σ patch[row, col, b, a] u^a v^b with (u, v) in metres from the cell's corner.
    """

    patch: Array  # (rows - 1, cols - 1, order, order)
    curvature: Array  # (rows - 1, cols - 1, 3) upper bounds of |z_xx|, |z_xy|, |z_yy| over the cell, 1/m
    top: Array  # (rows - 1, cols - 1) upper bound of z over the cell, m
    spacing: tuple[float, float]
    origin: tuple[float, float]

    @classmethod
    def of(cls, terrain: Terrain) -> Ground:
        """Return the height field of a Terrain, from its heights, spacing and interpolation."""
        z = np.asarray(terrain.z, dtype=float)
        dx, dy = terrain.spacing
        rows, cols = z.shape
        if terrain.interpolation == "linear":
            a, b, c, d = z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]
            rise, climb, twist = (b - a) / dx, (c - a) / dy, (a - b - c + d) / (dx * dy)
            patch = np.stack([np.stack([a, rise], -1), np.stack([climb, twist], -1)], -2)
            curvature = np.stack([0 * twist, abs(twist), 0 * twist], -1)
            return cls(patch, curvature, np.max([a, b, c, d], axis=0), terrain.spacing, terrain.origin)
        x, y = dx * np.arange(cols), dy * np.arange(rows)
        spline = RectBivariateSpline(y, x, z, s=0)
        at_node = np.zeros((rows, cols, 4, 4))
        for b in range(3):
            for a in range(3):
                at_node[..., b, a] = spline(y, x, dx=b, dy=a)
        at_node[:, :-1, :, 3] = np.diff(at_node[..., 2], axis=1) / dx  # the third derivative is constant over a cell
        at_node[:-1, :, 3, :] = np.diff(at_node[..., 2, :], axis=0) / dy
        over = np.array([factorial(k) for k in range(4)])
        patch = at_node[:-1, :-1] / np.outer(over, over)
        return cls(patch, *_bounds(patch, dx, dy), terrain.spacing, terrain.origin)

    def cells(self, x: Array, y: Array) -> Cell:
        """Return row and column of the cell under each point, or of the nearest cell beyond the map."""
        rows, cols = self.patch.shape[:2]
        col = np.clip(np.floor((x - self.origin[0]) / self.spacing[0]).astype(int), 0, cols - 1)
        row = np.clip(np.floor((y - self.origin[1]) / self.spacing[1]).astype(int), 0, rows - 1)
        return row, col

    def patch_at(self, row: NDArray[np.int64], col: NDArray[np.int64], x: Array, y: Array) -> tuple[Array, Array, Array]:
        """Return z, z_x, z_y at (x, y) of the given cells' polynomials, continued beyond the cells."""
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
        """Return z (...) at points, m."""
        px, py = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        flat = px.ravel(), py.ravel()
        return self.patch_at(*self.cells(*flat), *flat)[0].reshape(px.shape)


def _bounds(patch: Array, dx: float, dy: float) -> tuple[Array, Array]:
    """Return bounds of the second derivatives and the upper bound of the height over each cell.

    A polynomial lies within the range of its Bernstein coefficients.
    """
    unit = patch * np.outer(dy ** np.arange(4), dx ** np.arange(4))
    to_bernstein = np.array([[comb(i, k) / comb(3, k) for k in range(4)] for i in range(4)])
    b = np.einsum("ik,...kl,jl->...ij", to_bernstein, unit, to_bernstein)

    def greatest(c: Array) -> Array:
        return np.asarray(abs(c).max(axis=(-2, -1)))

    curvature = [
        greatest(6 * np.diff(b, 2, axis=-1)) / dx**2,
        greatest(9 * np.diff(np.diff(b, axis=-1), axis=-2)) / (dx * dy),
        greatest(6 * np.diff(b, 2, axis=-2)) / dy**2,
    ]
    return np.stack(curvature, -1), b.max(axis=(-2, -1))


@dataclass
class Wheels:
    """Wheels in the world frame; m of them."""

    hub: Array  # (m, 3) m
    X: Array  # (m, 3) axes of the axle frame
    Y: Array  # (m, 3) along the axle
    Z: Array  # (m, 3)
    radius: Array  # (m,) m
    half: Array  # (m,) half width, m

    def take(self, index: ArrayLike) -> Self:
        """Return the wheels at `index`, which may repeat."""
        return type(self)(*(getattr(self, field.name)[np.asarray(index)] for field in fields(self)))

    def extent(self) -> Array:
        """Return (m, 3): largest length per unit of φ (m), half range of φ, half range of s (m)."""
        return np.stack([self.radius, np.full_like(self.radius, np.pi), self.half], -1)

    def tread(self, phi: Array, s: Array) -> tuple[Array, Array]:
        """Return one tread point (m, 3) per wheel and its derivative by φ."""
        r, sin, cos = self.radius[:, None], np.sin(phi)[:, None], np.cos(phi)[:, None]
        return self.hub + s[:, None] * self.Y - r * (sin * self.X + cos * self.Z), r * (sin * self.Z - cos * self.X)


@dataclass
class Faces(Wheels):
    """Flat faces with the interface of treads.

    Points are hub + φ X + s Y with |φ| ≤ reach and |s| ≤ half; the radius is 0.
    """

    reach: Array

    def extent(self) -> Array:
        """Return (m, 3): length per unit of φ (m), half range of φ, half range of s (m)."""
        return np.stack([np.ones_like(self.reach), self.reach, self.half], -1)

    def tread(self, phi: Array, s: Array) -> tuple[Array, Array]:
        """Return one point (m, 3) per face and its derivative by φ."""
        return self.hub + phi[:, None] * self.X + s[:, None] * self.Y, self.X


def _about(axis: int, angle: Array) -> Rotation:
    return Rotation.from_rotvec(np.multiply.outer(angle, np.eye(3)[axis]))


@dataclass
class LinkPoses:
    """Poses of all links of n rovers.

    Links are in the rover's order: body, rockers, bogies, wheels. `turn` holds rotations, `at` points in the world (n, 3), m, and
    `rest` the same points in the body frame at joint angles 0. A point p of link k, in the body frame at joint angles 0, is
    at at[k] + turn[k] (p − rest[k]).
    """

    turn: list[Rotation]
    rest: list[Array]
    at: list[Array]

    def place(self, link: int, p: ArrayLike) -> Array:
        """Return the world position (n, 3) of a link's point p (3,)."""
        return self.at[link] + self.turn[link].apply(np.asarray(p, dtype=float) - self.rest[link])


def link_poses(
    rover: Rover, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, q: ArrayLike, steering: ArrayLike | None = None
) -> LinkPoses:
    """Return the poses of all links by forward kinematics.

    R = Rz(yaw) Ry(pitch) Rx(roll) for the body. Each suspension joint turns about the body's y axis. A wheel steers about the
    body-vertical line through its hub plus its steering offset.

    Args:
        rover: n times the same rover.
        x, y, yaw: (n,) m, m, rad.
        q: (n, 6) z, roll, pitch, left rocker, left bogie, right bogie.
        steering: (n, 6) rad; 0 if None.

    Returns:
        Poses of the 11 links.
    """
    q = np.atleast_2d(np.asarray(q, dtype=float))
    n = len(q)
    x, y, yaw = (np.broadcast_to(np.asarray(a, dtype=float), n) for a in (x, y, yaw))
    psi = np.broadcast_to(np.zeros(6) if steering is None else np.asarray(steering, dtype=float), (n, 6))
    body = _about(2, yaw) * _about(1, q[:, 2]) * _about(0, q[:, 1])
    parts = LinkPoses([body], [np.zeros(3)], [np.stack([x, y, q[:, 0]], -1)])

    def add_link(parent: int, joint: Array, turn: Rotation) -> None:
        """Append a link that turns about `joint`, a point of its parent."""
        parts.at.append(parts.place(parent, joint))
        parts.turn.append(parts.turn[parent] * turn)
        parts.rest.append(joint)

    right = sum(c * q[:, 3] ** k for k, c in enumerate(rover.differential))
    for side, angle in enumerate((q[:, 3], right)):
        add_link(0, rover.rocker_pivot[side], _about(1, angle))
    for side in (0, 1):
        add_link(1 + side, rover.bogie_pivot[side], _about(1, q[:, 4 + side]))
    for i in range(6):
        post = rover.hubs[i] + [*rover.steering_offset[i], 0.0]
        add_link((1 if i < 2 else 3) + i % 2, post, _about(2, psi[:, i]))
    return parts


def stand(rover: Rover, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, q: ArrayLike, steering: ArrayLike | None = None) -> Wheels:
    """Return the wheels (6 n) of poses (n,); arguments as `link_poses`."""
    parts = link_poses(rover, x, y, yaw, q, steering)
    hubs = np.stack([parts.place(5 + i, rover.hubs[i]) for i in range(6)], axis=1)
    frames = np.stack([parts.turn[5 + i].as_matrix() for i in range(6)], axis=1).reshape(-1, 3, 3)
    n = len(hubs)
    return Wheels(
        hubs.reshape(-1, 3), frames[:, :, 0], frames[:, :, 1], frames[:, :, 2],
        np.tile(rover.wheel_radius, n), np.tile(rover.wheel_width / 2, n),
    )  # fmt: skip


def box(rover: Rover, x: ArrayLike, y: ArrayLike, yaw: ArrayLike, q: ArrayLike) -> Faces:
    """Return the three lower faces (3 n) of the body's box at poses (n,).

    Only points of the box are above them, so they hold the minimum over the box.
    """
    parts = link_poses(rover, x, y, yaw, q)
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


def mass_height(rover: Rover, parts: LinkPoses) -> Array:
    """Return the height (n,) of the rover's centre of mass, m."""
    heights = [link.mass * parts.place(k, link.com)[:, 2] for k, link in enumerate(rover.links)]
    return np.asarray(sum(heights) / rover.mass)


@dataclass
class Least:
    """The lowest point (φ, s) found of each tread: gap − tolerance ≤ minimum ≤ gap."""

    gap: Array
    phi: Array
    s: Array


def least_gap(ground: Ground, wheels: Wheels, tolerance: float = 1e-10) -> Least:
    """Return the gap of each wheel (m,) over its whole tread, bracketed to `tolerance`, m."""
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
        assert k.size < 4_000_000, "the brackets do not close: this search cannot certify the terrain"
    return best


WINDOW = 5  # cells to each side that a first, coarse box may reach over


def _boxes(ground: Ground, wheels: Wheels) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
    """Return boxes (wheel, φ, s, half sizes) that cover every tread.

    Parts of a tread above the highest terrain around them are left out. A box reaches over at most one cell's size in x and y.
    """
    cell = min(ground.spacing)
    highest = maximum_filter(ground.top, 2 * WINDOW + 1)
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
        near = p[:, 2] - drop - highest[ground.cells(p[:, 0], p[:, 1])] < best[k]
        k, phi, s = k[near], phi[near], s[near]
        m_phi, m_s = -(-fine_phi // n_phi), -(-fine_s // n_s)
        phi, s = _grid(phi, s, span / n_phi, half / n_s, m_phi, m_s)
        k = np.repeat(k, m_phi * m_s)
        out.append((k, phi, s, np.full(k.size, span / n_phi / m_phi), np.full(k.size, half / n_s / m_s)))
    return tuple(np.concatenate(a) for a in zip(*out, strict=True))  # type: ignore[return-value]


def _grid(phi: Array, s: Array, dphi: float, ds: float, n_phi: int, n_s: int) -> tuple[Array, Array]:
    """Return the centres, flattened, of n_phi × n_s parts of each box.

    Boxes have centres (φ, s) and half sizes dphi, ds.
    """
    p = dphi * ((2 * np.arange(n_phi) + 1) / n_phi - 1)
    q = ds * ((2 * np.arange(n_s) + 1) / n_s - 1)
    p, q = (a.ravel() for a in np.meshgrid(p, q, indexing="ij"))
    return np.add.outer(phi, p).ravel(), np.add.outer(s, q).ravel()


def _look(ground: Ground, w: Wheels, phi: Array, s: Array, dphi: Array, ds: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return height at the centre and lower bound of each box, and the axis to halve.

    The heights are over the terrain, m. The third result is True if φ adds most of the slack.
    """
    p, along = w.tread(phi, s)
    curl = 0.5 * w.radius[:, None] * np.hypot(w.X, w.Z) * dphi[:, None] ** 2  # second-order displacement of x, y, z by φ
    turned, slid = abs(along) * dphi[:, None] + curl, abs(w.Y) * ds[:, None]
    rx, ry = (turned + slid)[:, :2].T
    lowest, highest = ground.cells(p[:, 0] - rx, p[:, 1] - ry), ground.cells(p[:, 0] + rx, p[:, 1] + ry)
    corners = [(row, col) for row in (lowest[0], highest[0]) for col in (lowest[1], highest[1])]
    curvature = np.max([ground.curvature[c] for c in corners], axis=0)

    def second_order(ax: Array, ay: Array) -> Array:
        return 0.5 * curvature[:, 0] * ax**2 + curvature[:, 1] * ax * ay + 0.5 * curvature[:, 2] * ay**2

    def over(cell: Cell) -> Over:
        h, hx, hy = ground.patch_at(*cell, p[:, 0], p[:, 1])
        return Over(
            p[:, 2] - h,
            along[:, 2] - hx * along[:, 0] - hy * along[:, 1],
            w.Y[:, 2] - hx * w.Y[:, 0] - hy * w.Y[:, 1],
            curl[:, 2] + abs(hx) * curl[:, 0] + abs(hy) * curl[:, 1] + second_order(rx, ry),
            hx,
            hy,
        )

    here = over(ground.cells(p[:, 0], p[:, 1]))
    cells = [here]
    low = here.low(dphi, ds)
    if ground.patch.shape[-1] == 2:  # bilinear, with kinks: each point of the box lies over one of the cells it reaches
        cells = [over(c) for c in corners]
        low = np.min([one.low(dphi, ds) for one in cells], axis=0)
        ridge = _ridge(ground, lowest, highest, cells[0], cells[3], rx, ry)
        low = np.where(ridge, np.maximum(low, _over_ridge(cells[0], cells[3], dphi, ds)), low)
    turn = np.max([abs(one.by_phi) * dphi for one in cells], axis=0) + curl[:, 2] + second_order(*turned[:, :2].T)
    slide = np.max([abs(one.by_s) * ds for one in cells], axis=0) + second_order(*slid[:, :2].T)
    return here.f, low, turn >= slide


@dataclass
class Over:
    """Expansion of the height of boxes over one cell's polynomial each."""

    f: Array  # at the centre, m
    by_phi: Array  # derivatives at the centre
    by_s: Array
    rest: Array  # bound of the terms of second order, m
    hx: Array  # slopes of the terrain at the centre
    hy: Array

    def low(self, dphi: Array, ds: Array) -> Array:
        """Return the lower bound over each box, m."""
        return self.f - abs(self.by_phi) * dphi - abs(self.by_s) * ds - self.rest


def _ridge(ground: Ground, one: Cell, other: Cell, a: Over, b: Over, rx: Array, ry: Array) -> NDArray[np.bool_]:
    """Return True if a box reaches two cells, and the terrain is the lower of their polynomials.

    Their common edge is then a ridge.
    """
    twist = abs(ground.patch[one][:, 1, 1] - ground.patch[other][:, 1, 1])
    beside = (one[0] == other[0]) & (other[1] == one[1] + 1) & (a.hx - b.hx > twist * ry)
    behind = (one[1] == other[1]) & (other[0] == one[0] + 1) & (a.hy - b.hy > twist * rx)
    return np.asarray(beside | behind)


def _over_ridge(a: Over, b: Over, dphi: Array, ds: Array) -> Array:
    """Return a lower bound of the height over a ridge from two expansions.

    It is the greatest of three weighted means.

    The height over the lower of two surfaces is at least any weighted mean of the heights over each.
    """
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
    """Return poses q (n, 6) whose six gaps are within `tolerance` of 0, by Newton's method.

    The Jacobian holds central differences of the heights of the lowest points. Poses that do not converge are NaN.
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
