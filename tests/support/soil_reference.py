"""Independent reference of wheel-soil forces: published equations, scipy's quadrature.

Ishigami, Miwa, Nagatani & Yoshida 2007, J. Field Robotics 24(3), doi.org/10.1002/rob.20187: normal stress (Wong and Reece
1967), shear stress (Janosi and Hanamoto 1961), shear displacements, bulldozing of the side wall (Hegedus).
`trapezoid_forces` uses the 61 nodes and the isotropic shear stress of wmrde's function (Seegmiller; after Jia et al. 2011).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import quad


@dataclass
class Parameters:
    """Parameters of the published equations."""

    r: float
    b: float
    c: float
    phi: float
    xc: float
    k: float
    n: float
    a0: float
    a1: float
    exit: float
    weight: float
    kx: float
    ky: float
    isotropic: bool


@dataclass
class Stresses:
    """Stresses under the wheel as functions of the angle θ."""

    p: Parameters
    h: float
    s: float
    u: float
    w: float

    def __post_init__(self) -> None:
        p = self.p
        self.tf = float(np.arccos(1 - self.h / p.r))
        self.tr = -float(np.arccos(1 - p.exit * self.h / p.r))
        self.tm = (p.a0 + p.a1 * self.s) * self.tf

    def sigma(self, t: float) -> float:
        """Return the normal stress at θ."""
        p = self.p
        at = t if t >= self.tm else self.tf - (t - self.tr) / (self.tm - self.tr) * (self.tf - self.tm)
        return p.k * p.r**p.n * max(np.cos(at) - np.cos(self.tf), 0.0) ** p.n

    def tau(self, t: float) -> tuple[float, float]:
        """Return the shear stresses along and across the rim at θ."""
        p = self.p
        strength = p.c + self.sigma(t) * np.tan(p.phi)
        jx = p.r * (self.tf - t - self.u * (np.sin(self.tf) - np.sin(t)))
        jy = -p.r * self.w * (self.tf - t)
        if p.isotropic:
            j = np.hypot(jx, jy)
            full = strength * (1 - np.exp(-j / p.kx))
            return (full * jx / j, full * jy / j) if j > 0 else (0.0, 0.0)
        return (
            np.sign(jx) * strength * (1 - np.exp(-abs(jx) / p.kx)),
            np.sign(jy) * strength * (1 - np.exp(-abs(jy) / p.ky)),
        )

    def wall(self, t: float) -> float:
        """Return the bulldozing force per angle at θ."""
        p = self.p
        depth = p.r * (np.cos(t) - np.cos(self.tf))
        d1 = 1 / np.tan(p.xc) + np.tan(p.xc + p.phi)
        d2 = 1 / np.tan(p.xc) + np.tan(p.phi) / np.tan(p.xc) ** 2
        return d1 * (p.c * depth + d2 * p.weight / 2 * depth**2) * (p.r - depth * np.cos(t))

    def integrands(self) -> list[Callable[[float], float]]:
        """Return the integrands of drawbar, side force without the wall, torque, vertical force."""
        r, b = self.p.r, self.p.b
        return [
            lambda t: r * b * (self.tau(t)[0] * np.cos(t) - self.sigma(t) * np.sin(t)),
            lambda t: r * b * self.tau(t)[1],
            lambda t: r * r * b * self.tau(t)[0],
            lambda t: r * b * (self.tau(t)[0] * np.sin(t) + self.sigma(t) * np.cos(t)),
        ]

    def integrate(self, f: Callable[[float], float]) -> float:
        """Return the integral over the contact, split at the peak and where jx changes its sign."""
        grid = np.linspace(self.tr, self.tf, 4001)[:-1]
        jx = self.tf - grid - self.u * (np.sin(self.tf) - np.sin(grid))
        cuts = [float(grid[i]) for i in np.nonzero(np.diff(np.sign(jx)))[0]]
        ends = sorted({self.tr, self.tm, self.tf, *cuts})
        return float(sum(quad(f, a, e, epsabs=0, epsrel=1e-10, limit=400)[0] for a, e in pairwise(ends)))


def forces(p: Parameters, h: float, s: float, u: float, w: float, bulldozing: float = 0.0) -> np.ndarray:
    """Return drawbar, side force, torque and vertical force at a sinkage.

    Args:
        p: parameters.
        h: sinkage, m.
        s: slip that moves the peak.
        u, w: axle speeds along and across over the rim speed.
        bulldozing: factor on the force at the side wall; it is mobilised as the shear stress at the exit.

    Returns:
        (4,) N, N, N m, N.
    """
    stresses = Stresses(p, h, s, u, w)
    out = np.array([stresses.integrate(f) for f in stresses.integrands()])
    if bulldozing:
        k = p.kx if p.isotropic else p.ky
        mobilised = 1 - np.exp(-p.r * abs(w) * (stresses.tf - stresses.tr) / k)
        out[1] -= np.sign(w) * bulldozing * mobilised * stresses.integrate(stresses.wall)
    return out


def trapezoid_forces(p: Parameters, h: float, s: float, u: float, w: float, nodes: int = 61) -> np.ndarray:
    """Return the same with wmrde's trapezoidal rule on equal steps over the contact."""
    stresses = Stresses(p, h, s, u, w)
    t = np.linspace(stresses.tr, stresses.tf, nodes)
    return np.array([np.trapezoid([f(x) for x in t], t) for f in stresses.integrands()])
