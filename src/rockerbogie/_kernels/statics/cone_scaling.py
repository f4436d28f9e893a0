"""Contact forces and velocities in friction cones, and the scaling between them.

Forces F and velocities U are vectors in world axes, so contact frames are not needed: x = (F_n, F_t / μ) and z = (U_n, μ U_t) lie
in the cone of `Cone.excess`.
"""

from __future__ import annotations

from typing import Any

from ..jit.vectors import larger, root
from .lane_rows import BOGIE_LEFT, BOGIE_RIGHT, BOUND, CONTACTS, OX, OY, OZ, ROCKER_RATE, VX, VY, VZ, WHEEL, WHEELS


class Vector:
    """Vector in world axes."""

    __slots__ = ("x", "y", "z")

    def __init__(self, x: Any, y: Any, z: Any) -> None:
        self.x, self.y, self.z = x, y, z

    def __add__(self, other: Vector) -> Vector:
        return Vector(self.x + other.x, self.y + other.y, self.z + other.z)

    def __sub__(self, other: Vector) -> Vector:
        return Vector(self.x - other.x, self.y - other.y, self.z - other.z)

    def __mul__(self, size: Any) -> Vector:
        return Vector(self.x * size, self.y * size, self.z * size)

    def dot(self, other: Vector) -> Any:
        """Return the scalar product.

        Args:
            other: vector.
        """
        return self.x * other.x + self.y * other.y + self.z * other.z

    def cross(self, other: Vector) -> Vector:
        """Return the vector product.

        Args:
            other: vector.
        """
        return Vector(
            self.y * other.z - self.z * other.y, self.z * other.x - self.x * other.z, self.x * other.y - self.y * other.x
        )

    @property
    def parts(self) -> tuple[Any, Any, Any]:
        """Components."""
        return self.x, self.y, self.z


class Cone:
    """Element (n, t) of a cone n ≥ |t|, with t a vector across the contact normal."""

    __slots__ = ("n", "t")

    def __init__(self, n: Any, t: Vector) -> None:
        self.n, self.t = n, t

    def __add__(self, other: Cone) -> Cone:
        return Cone(self.n + other.n, self.t + other.t)

    def __sub__(self, other: Cone) -> Cone:
        return Cone(self.n - other.n, self.t - other.t)

    def __mul__(self, size: Any) -> Cone:
        return Cone(self.n * size, self.t * size)

    def dot(self, other: Cone) -> Any:
        """Return the scalar product.

        Args:
            other: element.
        """
        return self.n * other.n + self.t.dot(other.t)

    def excess(self) -> Any:
        """Return n² - |t|², above 0 inside the cone."""
        return self.n * self.n - self.t.dot(self.t)

    def rate(self, step: Cone, over: Any) -> Any:
        """Return the reciprocal of the longest step inside the cone; at most 0 if none ends.

        Args:
            step: direction.
            over: reciprocal of `excess`.
        """
        inner, along = self.leaving(step, over)
        return inner - along

    def leaving(self, step: Cone, over: Any) -> tuple[Any, Any]:
        """Return r and b: steps end at 1 / (r - b), opposite steps at 1 / (r + b).

        By the reversed Cauchy-Schwarz inequality r is real, but for rounding.

        Args:
            step: direction.
            over: reciprocal of `excess`.
        """
        along = (self.n * step.n - self.t.dot(step.t)) * over
        return root(larger(along * along - step.excess() * over, 0.0)), along


class Wheel:
    """One contact, its forces and velocities, and the scaling between them."""

    x: Cone
    z: Cone
    w: Cone
    slide: Vector
    residual: Vector
    target: Cone
    lag: Cone
    second: Cone
    dx: Cone
    dz: Cone
    du: Vector

    def __init__(self, rows: Any, i: int, bounded: bool) -> None:
        self.i, self.bounded = i, bounded
        self.n, self.p = read(rows, WHEEL.normal, i), read(rows, WHEEL.point, i)
        self.rocker = read(rows, WHEEL.rocker, i)
        self.bogie = read(rows, WHEEL.bogie, i) if i % WHEELS > 1 else None
        self.on, self.at_bogie = rows[WHEEL.on + i], BOGIE_LEFT if i % 2 == 0 else BOGIE_RIGHT

    def velocity(self, v: list[Any]) -> Vector:
        """Return the contact's velocity in a motion.

        Args:
            v: generalized velocity.
        """
        u = Vector(v[VX], v[VY], v[VZ]) + Vector(v[OX], v[OY], v[OZ]).cross(self.p) + self.rocker * v[ROCKER_RATE]
        if self.bogie is not None:
            u = u + self.bogie * v[self.at_bogie]
        return u + self.n * v[BOUND] if self.bounded else u

    def generalized(self, force: Vector) -> list[tuple[int, Any]]:
        """Return equation and value of each component of a contact force.

        Args:
            force: N.
        """
        moment = self.p.cross(force)
        parts = list(zip((VX, VY, VZ, OX, OY, OZ), force.parts + moment.parts, strict=True))
        parts.append((ROCKER_RATE, self.rocker.dot(force)))
        if self.bogie is not None:
            parts.append((self.at_bogie, self.bogie.dot(force)))
        if self.bounded:
            parts.append((BOUND, self.n.dot(force)))
        return parts

    def cone(self, u: Vector, mu: Any) -> Cone:
        """Return a velocity as an element of the cone.

        Args:
            u: velocity.
            mu: friction coefficient.
        """
        n = self.n.dot(u)
        return Cone(n, (u - self.n * n) * mu)

    def world(self, x: Cone, mu: Any) -> Vector:
        """Return an element of the cone as a force.

        Args:
            x: element.
            mu: friction coefficient.
        """
        return self.n * x.n + x.t * mu

    def set_scaling(self, over_x: Any, over_z: Any, power: Any, excess_x: Any, excess_z: Any) -> None:
        """Set the Nesterov-Todd scaling from x and z: `hessian(z)` equals x.

        It sets `w`, `size`, `square`, `scaled` and inverses `over_...`. The excess of an element is n² - |t|²: its
        normal component squared less that of the tangential one.

        Args:
            over_x, over_z: 1 / sqrt of the excess of x and of z.
            power: x · z.
            excess_x, excess_z: excess of x and of z.
        """
        both = over_x * over_z
        gamma = 1.0 / root(2.0 + 2.0 * power * both)
        self.w = self.x * (gamma * over_x)
        self.w = Cone(self.w.n + self.z.n * (gamma * over_z), self.w.t - self.z.t * (gamma * over_z))
        ratio = excess_x * both
        self.size, self.square = root(ratio), ratio * self.on
        self.over_n = 1.0 / (1.0 + self.w.n)
        self.over_x, self.over_z, self.over_both = over_x * over_x, over_z * over_z, both
        self.scaled = self.scale(self.z)
        self.over_scaled = 1.0 / self.scaled.n

    def hessian(self, y: Cone) -> Cone:
        """Return the product of the scaling's square with an element.

        Args:
            y: element.
        """
        k = 2.0 * self.w.dot(y)
        return Cone(self.square * (self.w.n * k - y.n), (self.w.t * k + y.t) * self.square)

    def scale(self, y: Cone) -> Cone:
        """Return the product of the scaling with an element.

        Args:
            y: element.
        """
        dot = self.w.t.dot(y.t)
        return Cone(self.size * (self.w.n * y.n + dot), (y.t + self.w.t * (y.n + dot * self.over_n)) * self.size)

    def predicted_rate(self, dz: Cone) -> Any:
        """Return the reciprocal of the longest predicted step inside the cones.

        The predicted step of x is -x - `hessian(dz)`. It sets `second`, the product of both steps in the scaled space.

        Args:
            dz: step of z.
        """
        c = self.scale(dz)
        a = self.scaled * -self.on - c
        self.second = Cone(a.dot(c), c.t * a.n + a.t * c.n)
        return larger(self.scaled.rate(a, self.over_both), self.scaled.rate(c, self.over_both))

    def corrector(self, centre: Any, square: Any) -> Cone:
        """Return the correction of the predicted step of x that leads to the central path.

        Args:
            centre: power of each cone on the path.
            square: weight of the second-order terms.
        """
        at, t = self.scaled, self.second.t * -square
        part = (at.n * (centre - square * self.second.n) - at.t.dot(t)) * self.over_both
        return self.scale(Cone(part, (t - at.t * part) * self.over_scaled))

    def add_metric(self, matrix: list[list[Any]], mu: Any, friction: bool) -> None:
        """Add A H Aᵀ of this contact to the matrix of the step.

        In world axes, H is β² (2 W Wᵀ + μ² - (1 + μ²) n nᵀ), with W the scaling's point as a force.

        Args:
            matrix: lower triangle, changed.
            mu: friction coefficient.
            friction: True if the sum of normal forces is not bounded.
        """
        point, normal, p = self.world(self.w, mu), self.n, self.p
        two, flat = 2.0 * self.square, mu * mu * self.square
        one = self.square + flat
        h: list[list[Any]] = [[None] * 3 for _ in range(3)]
        for a in range(3):
            for b in range(a + 1):
                h[a][b] = h[b][a] = two * point.parts[a] * point.parts[b] - one * normal.parts[a] * normal.parts[b]
            h[a][a] = h[a][a] + flat

        def add(i: int, j: int, x: Any) -> None:
            """Add to an element.

            Args:
                i, j: row and column, in any order.
                x: number.
            """
            i, j = max(i, j), min(i, j)
            matrix[i][j] = x if matrix[i][j] is None else matrix[i][j] + x

        turns = (  # forces H (axis × p)
            Vector(*(p.y * h[a][2] - p.z * h[a][1] for a in range(3))),
            Vector(*(p.z * h[a][0] - p.x * h[a][2] for a in range(3))),
            Vector(*(p.x * h[a][1] - p.y * h[a][0] for a in range(3))),
        )
        for a in range(3):
            for b in range(a + 1):
                add(VX + a, VX + b, h[a][b])
            for b, part in enumerate(turns[a].parts):
                add(OX + a, VX + b, part)
            for b, part in enumerate(p.cross(turns[a]).parts):
                if b >= a:
                    add(OX + b, OX + a, part)

        def lever(row: int, force: Vector) -> None:
            """Add a force and its moment to a row.

            Args:
                row: equation.
                force: H times the velocity of the contact at unit rate of that equation.
            """
            for a, part in enumerate(force.parts + p.cross(force).parts):
                add(VX + a, row, part)

        force = Vector(*(h[a][0] * self.rocker.x + h[a][1] * self.rocker.y + h[a][2] * self.rocker.z for a in range(3)))
        lever(ROCKER_RATE, force)
        add(ROCKER_RATE, ROCKER_RATE, self.rocker.dot(force))
        if self.bogie is not None:
            force = Vector(*(h[a][0] * self.bogie.x + h[a][1] * self.bogie.y + h[a][2] * self.bogie.z for a in range(3)))
            lever(self.at_bogie, force)
            add(ROCKER_RATE, self.at_bogie, self.rocker.dot(force))
            add(self.at_bogie, self.at_bogie, self.bogie.dot(force))
        if not friction:
            force = (point * (2.0 * self.w.n) - normal) * self.square
            lever(BOUND, force)
            add(BOUND, ROCKER_RATE, self.rocker.dot(force))
            add(BOUND, BOUND, normal.dot(force))
            if self.bogie is not None:
                add(BOUND, self.at_bogie, self.bogie.dot(force))


def read(rows: Any, start: int, i: int) -> Vector:
    """Return the vector of a contact.

    Args:
        rows: rows of the lane array.
        start: first row of the vectors.
        i: contact.
    """
    return Vector(rows[start + i], rows[start + CONTACTS + i], rows[start + 2 * CONTACTS + i])


def write(rows: Any, start: int, i: int, value: Vector) -> None:
    """Set the vector of a contact.

    Args:
        rows: rows of the lane array; three are written.
        start: first row of the vectors.
        i: contact.
        value: vector.
    """
    rows[start + i], rows[start + CONTACTS + i], rows[start + 2 * CONTACTS + i] = value.parts
