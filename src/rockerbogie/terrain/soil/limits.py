"""Limits of the parameters of wheel-soil laws, and the units that wrong values suggest."""

from __future__ import annotations

import math
from typing import Any

from ..._kernels.soil import layout as lay
from ...errors import RockerbogieError

#: Limits of parameters: low, high, unit and a hint.
_LIMITS = {
    "cohesion": (0.0, 1e5, "Pa", "give Pa, not kPa"),
    "friction_angle": (0.0, 1.2, "rad", "give rad, not degrees; in a file, degrees"),
    "exponent": (0.05, 2.5, "", ""),
    "shear_modulus": (2e-4, 0.2, "m", "give m, not mm"),
    "shear_modulus_angle": (0.0, 1.0, "m/rad", ""),
    "side_shear_modulus_angle": (0.0, 1.0, "m/rad", ""),
    "density": (200.0, 5000.0, "kg/m³", "give mass, not weight, a m³"),
    "peak": (0.0, 1.0, "", ""),
    "exit": (0.0, 1.5, "", ""),
    "exponent_grouser": (-20.0, 20.0, "", ""),
    "exit_grouser": (-20.0, 20.0, "", ""),
    "bulldozing": (0.0, 10.0, "", ""),
    "rut_exponent": (1.0, 20.0, "", ""),
}
#: Cohesion above 0 and below this is taken for kPa, Pa.
LEAST_COHESION = 5.0
#: Friction angle above 0 and below this is taken for radians in place of degrees, rad.
LEAST_ANGLE = 0.025
#: Bekker's kphi above 0 and below this is taken for kN/m^(n+2), N/m^(n+2); likewise kc, N/m^(n+1).
LEAST_KPHI, LEAST_KC = 1e4, 10.0
#: Bekker's kc over kphi, m: soils in Wong (2008) have up to 0.05; above this, kc is taken for a value 1,000 times too large.
LARGEST_KC = 0.5
#: Pressure of a plate 0.1 m wide at a depth of 10 mm, Pa: outside these limits, units are wrong.
PLATE_PRESSURE = (50.0, 3e6)


def check_range(name: str, value: float, low: float, high: float, unit: str, hint: str = "") -> None:
    """Check that a parameter is a number in its range.

    Args:
        name: of the parameter.
        value: the parameter.
        low, high: limits, inclusive.
        unit: unit of value and limits.
        hint: end of the message.

    Raises:
        RockerbogieError: it is not.
    """
    try:
        good = not isinstance(value, bool | str) and low <= float(value) <= high
    except (TypeError, ValueError):
        good = False
    if not good:
        shown = f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else f"{value!r:.40}"
        unit, tail = f" {unit}" if unit else "", f": {hint}" if hint else ""
        raise RockerbogieError(f"{name} is {shown}{unit}; it must be from {low:g} to {high:g}{unit}{tail}")


def check_soil(soil: Any) -> None:
    """Check the parameters of a soil.

    Args:
        soil: a `Soil`.

    Raises:
        RockerbogieError: a parameter is negative, out of range or in wrong units.
    """
    lead = f"soil {soil.name!r}: "
    for name, (low, high, unit, hint) in _LIMITS.items():
        check_range(lead + name, getattr(soil, name), low, high, unit, hint)
    for name, low, high, unit in (("side_shear_modulus", 2e-4, 0.2, "m"), ("destructive_angle", 0.05, 1.5, "rad")):
        if getattr(soil, name) is not None:
            check_range(lead + name, getattr(soil, name), low, high, unit)
    for name in ("exponent_terms", "peak_terms", "exit_terms"):
        terms = getattr(soil, name)
        if not isinstance(terms, tuple) or len(terms) != lay.TERMS - 1:
            raise RockerbogieError(f"{lead}{name} is {terms!r:.60}: give a tuple of {lay.TERMS - 1} numbers")
        for term in terms:
            check_range(lead + name, term, -5.0, 5.0, "")
    if soil.slip_speed not in ("heading", "travel"):
        raise RockerbogieError(f"{lead}slip_speed is {soil.slip_speed!r}: give 'heading' or 'travel'")
    if 0.0 < soil.cohesion < LEAST_COHESION:
        raise RockerbogieError(f"{lead}cohesion is {soil.cohesion:g} Pa: give Pa, not kPa (0, or at least {LEAST_COHESION:g} Pa)")
    if 0.0 < soil.friction_angle < LEAST_ANGLE:
        raise RockerbogieError(
            f"{lead}friction_angle is {soil.friction_angle:g} rad, {math.degrees(soil.friction_angle):g}°: give rad; in a file, "
            f"degrees (0, or at least {math.degrees(LEAST_ANGLE):.2g}°)"
        )
    if soil.pressure not in ("bekker", "reece"):
        raise RockerbogieError(f"{lead}pressure is {soil.pressure!r}: give 'bekker' or 'reece'")
    check_range(lead + "kc", soil.kc, 0.0, 1e9, "")
    check_range(lead + "kphi", soil.kphi, 0.0, 1e12, "")
    if soil.pressure == "bekker" and 0.0 < soil.kphi < LEAST_KPHI:
        raise RockerbogieError(
            f"{lead}kphi is {soil.kphi:g} N/m^(n+2): give N and m, not kN or cm (0, or at least {LEAST_KPHI:g})"
        )
    if soil.pressure == "bekker" and (0.0 < soil.kc < LEAST_KC or soil.kc > LARGEST_KC * soil.kphi > 0.0):
        raise RockerbogieError(
            f"{lead}kc is {soil.kc:g} N/m^(n+1) beside kphi {soil.kphi:g} N/m^(n+2): give N and m, not kN or cm (0, or at least "
            f"{LEAST_KC:g} and at most {LARGEST_KC:g} m × kphi)"
        )
    pressure = soil.stiffness(0.1, 9.81) * 0.01**soil.exponent
    if not PLATE_PRESSURE[0] <= pressure <= PLATE_PRESSURE[1]:
        raise RockerbogieError(
            f"{lead}kc {soil.kc:g} and kphi {soil.kphi:g} give {pressure:.3g} Pa under a plate 0.1 m wide at 10 mm; soils have "
            f"{PLATE_PRESSURE[0]:g} to {PLATE_PRESSURE[1]:g} Pa: give N and m, not kN or cm"
        )
