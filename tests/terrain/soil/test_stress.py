"""Stresses under a wheel against an independent reference with scipy's quadrature."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq

import rockerbogie as rb
from rockerbogie._kernels.soil.layout import L_COHESION
from rockerbogie._kernels.soil.stress import contact_arc, shear_stress, stress_forces
from rockerbogie.terrain.soil.laws import Wheel
from support.soil_reference import Parameters, Stresses, forces, trapezoid_forces

WHEEL = Wheel(0.09, 0.11)
ISHIGAMI = rb.load_soil("ishigami-simulant")
#: wmrde's parameters: its cohesion is 0.8, written as kPa and used as Pa.
WMRDE = Parameters(
    r=0.09, b=0.11, c=0.8, phi=np.radians(37.2), xc=np.radians(26.4), k=1.37e3 / 0.11 + 8.14e5, n=1.0, a0=0.4, a1=0.15, exit=1.0,
    weight=1.6e3 * 9.81, kx=0.025, ky=0.025, isotropic=True,
)  # fmt: skip


def wmrde_law() -> np.ndarray:
    """Return the packed law with wmrde's parameters."""
    soil = dataclasses.replace(
        ISHIGAMI,
        cohesion=0.0,
        shear_modulus=0.025,
        shear_modulus_angle=0.0,
        side_shear_modulus=None,
        side_shear_modulus_angle=0.0,
        coupled=True,
        bulldozing=0.0,
    )
    law = soil.packed(WHEEL, 9.81)
    law[L_COHESION] = 0.8
    return law


def kernel_forces(law: np.ndarray, h: float, s: float, angle: float, u: float, w: float) -> np.ndarray:
    """Return drawbar, side force, torque and vertical force of the kernel."""
    out = np.empty(4)
    stress_forces(law, h, s, 0.0, angle, u, w, out)
    return out


def motions() -> list[tuple[float, float, float]]:
    """Return sinkages, slips and slip angles over wmrde's range."""
    return [
        (h, s, np.radians(b))
        for h in (0.003, 0.01, 0.03)
        for s in (-0.9, -0.4, 0.0, 0.05, 0.3, 0.8)
        for b in (-60.0, 0.0, 5.0, 40.0)
    ]


def test_wmrde_function_is_reproduced() -> None:
    """Compare with wmrde's slip (rω − vx) / rω and side displacement (1 − |s|) tan β."""
    law = wmrde_law()
    for h, s, b in motions():
        u, w = 1 - s, (1 - abs(s)) * np.tan(b)
        expected = forces(WMRDE, h, s, u, w)
        assert kernel_forces(law, h, s, b, u, w) == pytest.approx(expected, rel=1e-6, abs=1e-6 * expected[3])


def test_wmrde_trapezoidal_sums_are_those_of_the_kernel_stresses() -> None:
    law = wmrde_law()
    for h, s, b in motions():
        u, w = 1 - s, (1 - abs(s)) * np.tan(b)
        reference = Stresses(WMRDE, h, s, u, w)
        entry, peak, leave = contact_arc(law, h, s, 0.0)
        assert (entry, peak, leave) == pytest.approx((reference.tf, reference.tm, reference.tr), rel=1e-12)
        t = np.linspace(leave, entry, 61)
        normal = np.array([reference.sigma(x) for x in t])
        jx, jy = 0.09 * (entry - t - u * (np.sin(entry) - np.sin(t))), -0.09 * w * (entry - t)
        tau = np.array([shear_stress(law, n, x, y, 0.025, 0.025) for n, x, y in zip(normal, jx, jy, strict=True)])
        rb_ = 0.09 * 0.11
        found = [
            rb_ * np.trapezoid(tau[:, 0] * np.cos(t) - normal * np.sin(t), t), rb_ * np.trapezoid(tau[:, 1], t),
            0.09 * rb_ * np.trapezoid(tau[:, 0], t), rb_ * np.trapezoid(tau[:, 0] * np.sin(t) + normal * np.cos(t), t),
        ]  # fmt: skip
        expected = trapezoid_forces(WMRDE, h, s, u, w)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * expected[3])


@pytest.mark.parametrize("angle", [-0.8, 0.0, 0.3])
@pytest.mark.parametrize("slip", [-0.95, -0.5, -0.05, 0.0, 0.2, 0.9])
def test_load_balance_agrees_with_the_reference(slip: float, angle: float) -> None:
    """Forces at a given load, with Ishigami's own moduli and the bulldozing force."""
    p = Parameters(
        0.09, 0.11, 800.0, np.radians(37.2), np.radians(26.4), 1.37e3 / 0.11 + 8.14e5, 1.0, 0.4, 0.15, 1.0, 1600 * 9.80665,
                   0.043 * abs(angle) + 0.036, 0.020 * abs(angle) + 0.013, False)  # fmt: skip
    rim, vx = 1.0 + min(slip, 0.0), 1.0 - max(slip, 0.0)
    u, w = vx / rim, vx * np.tan(angle) / rim
    found = rb.wheel_soil_forces(ISHIGAMI, 0.09, 0.11, 64.68, slip, angle)
    stresses = lambda h: Stresses(p, h, slip, u, w)  # noqa: E731
    sinkage = brentq(lambda h: stresses(h).integrate(stresses(h).integrands()[3]) - 64.68, 1e-4, 0.05, xtol=1e-12)
    assert found.sinkage == pytest.approx(sinkage, rel=1e-6)
    expected = forces(p, sinkage, slip, u, w, bulldozing=1.0)
    assert [found.drawbar, found.side, found.torque] == pytest.approx(expected[:3], rel=1e-5, abs=1e-5 * 64.68)
