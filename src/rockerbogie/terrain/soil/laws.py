"""Wheel-terrain laws: soil, Coulomb friction on rigid terrain, an empirical slip curve."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from ..._kernels.soil import layout as lay
from ...arrays import Array
from ...errors import RockerbogieError
from .limits import check_range, check_soil

#: Factors of slip s, s², side motion y, y s and y s².
Terms = tuple[float, float, float, float, float]
NO_TERMS: Terms = (0.0, 0.0, 0.0, 0.0, 0.0)
#: Largest sinkage of a wheel as a fraction of its radius.
DEEPEST = 0.95
#: Limits of a wheel's radius, its width and the height of its grousers, m.
RADIUS, WIDTH = (0.01, 5.0), (0.002, 5.0)


@dataclass(frozen=True)
class Grousers:
    """Grousers (lugs) around the rim of a wheel.

    Attributes:
        height: above the rim, m.
    """

    height: float

    def __post_init__(self) -> None:
        check_range("grouser height", self.height, 0.0, 1.0, "m")


@dataclass(frozen=True)
class Wheel:
    """Dimensions of a wheel for a law.

    Attributes:
        radius: of the rim, without grousers, m.
        width: m.
        grousers: None for a smooth rim.
        passes: number of this pass over the same rut: 1 on undisturbed soil.
    """

    radius: float
    width: float
    grousers: Grousers | None = None
    passes: int = 1

    def __post_init__(self) -> None:
        check_range("radius", self.radius, *RADIUS, "m")
        check_range("width", self.width, *WIDTH, "m")
        if isinstance(self.passes, bool) or self.passes != int(self.passes) or self.passes < 1:
            raise RockerbogieError(
                f"passes is {self.passes!r}: give 1 for undisturbed soil, 2 for the second wheel in a rut, ..."
            )


@runtime_checkable
class WheelLaw(Protocol):
    """Law of the forces between a wheel and the terrain.

    A new law needs a kind of its own in `rockerbogie._kernels.soil.layout`, a kernel, and this method.
    """

    def packed(self, wheel: Wheel, gravity: float) -> Array:
        """Return the law for a wheel as kernels take it.

        Args:
            wheel: its dimensions.
            gravity: m/s².

        Returns:
            (LAW_SIZE,) array.
        """
        ...


@dataclass(frozen=True)
class Coulomb:
    """Coulomb friction on rigid terrain, without sinkage and rolling resistance.

    The force opposes the sliding velocity d = (rim - vx, -vy) and is load × friction × d / sqrt(d² + (creep V)²), with
    V² = (rim² + vx²) / 2 + vy².

    Attributes:
        friction: friction coefficient.
        creep: slip at which the force is 1/sqrt(2) of the limit; it regularises the law at rest.
    """

    friction: float
    creep: float = 0.005

    def __post_init__(self) -> None:
        check_range("friction", self.friction, 0.0, 10.0, "")
        check_range("creep", self.creep, 1e-6, 0.5, "")

    def packed(self, wheel: Wheel, gravity: float) -> Array:
        """Return the law for a wheel as kernels take it.

        Args:
            wheel: its dimensions.
            gravity: not used.

        Returns:
            (LAW_SIZE,) array.
        """
        law = np.zeros(lay.LAW_SIZE)
        law[[lay.L_KIND, lay.L_RADIUS, lay.L_MU, lay.L_CREEP]] = lay.COULOMB, wheel.radius, self.friction, self.creep
        return law


@dataclass(frozen=True)
class SlipCurve:
    """Empirical curve of slip against the ratio D of drawbar to load.

    slip = (D/D0)^m / (1 + (D/D0)^m).

    Across the heading the same curve holds for the sliding velocity (docs/soil.md).

    Attributes:
        ratio: D0, the ratio of drawbar to load at slip 0.5.
        power: m, at least 1; larger values have a sharper rise.
        rolling: rolling resistance over load that the torque overcomes besides the drawbar.
        creep: the curve is linear below this slip.
        limit: slip above which the force grows no further.
    """

    ratio: float
    power: float
    rolling: float = 0.0
    creep: float = 0.005
    limit: float = 0.95

    def __post_init__(self) -> None:
        check_range("ratio", self.ratio, 1e-3, 10.0, "")
        check_range("power", self.power, 1.0, 20.0, "")
        check_range("rolling", self.rolling, 0.0, 1.0, "")
        check_range("creep", self.creep, 1e-6, 0.5, "")
        check_range("limit", self.limit, 0.5, 0.999, "")

    def slip(self, ratio: Array | float) -> Array:
        """Return the slip at which a wheel pulls.

        Args:
            ratio: (...) drawbar over load; on a slope its tangent.

        Returns:
            (...) slip; the curve itself, without creep and limit.
        """
        power = (np.maximum(np.asarray(ratio, dtype=float), 0.0) / self.ratio) ** self.power
        return np.asarray(power / (1.0 + power))

    def packed(self, wheel: Wheel, gravity: float) -> Array:
        """Return the law for a wheel as kernels take it.

        Args:
            wheel: its dimensions.
            gravity: not used.

        Returns:
            (LAW_SIZE,) array.
        """
        law = np.zeros(lay.LAW_SIZE)
        law[[lay.L_KIND, lay.L_RADIUS, lay.L_RATIO, lay.L_CREEP]] = lay.CURVE, wheel.radius, self.ratio, self.creep
        law[[lay.L_POWER, lay.L_ROLLING, lay.L_CAP]] = self.power, self.rolling, self.limit / (1.0 - self.limit)
        return law


@dataclass(frozen=True, kw_only=True)
class Soil:
    """Deformable soil. All parameters are in SI units; angles in rad.

    Pressure at depth z under a wheel of width b is (kc / b + kphi) z^n after Bekker, or (c kc + γ b kphi) (z / b)^n after Reece,
    with dimensionless kc and kphi and weight density γ. Normal
    stress after Wong and Reece, shear stress after Janosi and Hanamoto.

    Attributes:
        name, title, source, grade: text. Grade A: published measurement; B: fitted or taken from a secondary source; C: partly
            estimated.
        cohesion: c, Pa.
        friction_angle: phi, rad.
        kc: cohesive modulus, N/m^(n+1); dimensionless for Reece.
        kphi: frictional modulus, N/m^(n+2); dimensionless for Reece.
        exponent: n.
        exponent_terms: change of n with slip s and side motion y: factors of s, s², y, y s and y s² (slip sinkage), z in m.
        pressure: "bekker" or "reece".
        shear_modulus: K, m; kx of Ishigami if `side_shear_modulus` is given.
        shear_modulus_angle: growth of K with |slip angle|, m/rad.
        side_shear_modulus: across the wheel (ky of Ishigami), m. None: as along it.
        side_shear_modulus_angle: growth of ky, m/rad.
        coupled: True: shear stress opposes the shear displacement. False: its components are independent (Ishigami).
        density: kg/m³.
        peak, peak_terms: a; the largest normal stress is at a times the entry angle. Terms as for the exponent; Wong and Reece's
            a1 is the first.
        exit, exit_terms: exit depth over sinkage: the rim leaves the soil there. Terms as for the exponent.
        slip_speed: slip in these terms is relative to the speed along the "heading" or of "travel".
        exponent_grouser, exit_grouser: growth of n and of the exit fraction with grouser height / radius × slip², driving.
        destructive_angle: of the soil that the side wall bulldozes, rad. None: pi/4 - phi/2.
        bulldozing: factor on the bulldozing force; 0: none.
        rut_exponent: a of z_n = z_1 n^(1/a), the depth of a rut after n passes.
    """

    name: str
    title: str = ""
    source: str = ""
    grade: str = ""
    cohesion: float
    friction_angle: float
    kc: float
    kphi: float
    exponent: float
    exponent_terms: Terms = NO_TERMS
    pressure: str = "bekker"
    shear_modulus: float
    shear_modulus_angle: float = 0.0
    side_shear_modulus: float | None = None
    side_shear_modulus_angle: float = 0.0
    coupled: bool = True
    density: float
    peak: float = 0.4
    peak_terms: Terms = (0.15, 0.0, 0.0, 0.0, 0.0)
    exit: float = 0.0
    exit_terms: Terms = NO_TERMS
    slip_speed: str = "heading"
    exponent_grouser: float = 0.0
    exit_grouser: float = 0.0
    destructive_angle: float | None = None
    bulldozing: float = 1.0
    rut_exponent: float = 3.0

    def __post_init__(self) -> None:
        check_soil(self)

    def packed(self, wheel: Wheel, gravity: float) -> Array:
        """Return the law for a wheel as kernels take it.

        Args:
            wheel: its dimensions.
            gravity: m/s².

        Returns:
            (LAW_SIZE,) array.
        """
        height = wheel.grousers.height if wheel.grousers else 0.0
        lug = height / wheel.width
        law = np.zeros(lay.LAW_SIZE)
        law[lay.L_KIND], law[lay.L_RADIUS], law[lay.L_WIDTH] = lay.SOIL, wheel.radius + height, wheel.width
        law[lay.L_COHESION] = self.cohesion * (1.0 + 2.0 * lug)
        law[lay.L_FRICTION] = math.tan(self.friction_angle) * (1.0 + 0.64 * lug * (0.5 * math.pi - math.atan(lug)))
        law[lay.L_STIFFNESS] = self.stiffness(wheel.width, gravity) * self.rut_hardening(wheel.passes)
        for at, name in ((lay.L_EXPONENT, "exponent"), (lay.L_PEAK, "peak"), (lay.L_EXIT, "exit")):
            law[at] = getattr(self, name)
            law[at + 1 : at + lay.TERMS] = getattr(self, f"{name}_terms")
        law[lay.L_KX], law[lay.L_KX_ANGLE] = self.shear_modulus, self.shear_modulus_angle
        side = self.side_shear_modulus is not None
        law[lay.L_KY] = self.side_shear_modulus if side else self.shear_modulus
        law[lay.L_KY_ANGLE] = self.side_shear_modulus_angle if side else self.shear_modulus_angle
        law[lay.L_COUPLED], law[lay.L_TRAVEL] = self.coupled, self.slip_speed == "travel"
        law[lay.L_LUG] = height / wheel.radius
        law[lay.L_LUG_EXPONENT], law[lay.L_LUG_EXIT] = self.exponent_grouser, self.exit_grouser
        phi = self.friction_angle
        angle = 0.25 * math.pi - 0.5 * phi if self.destructive_angle is None else self.destructive_angle
        cot = 1.0 / math.tan(angle)
        first = cot + math.tan(angle + phi)
        second = cot + cot * cot * math.tan(phi)
        law[lay.L_BULLDOZE_1] = self.bulldozing * first * self.cohesion
        law[lay.L_BULLDOZE_2] = self.bulldozing * first * second * 0.5 * self.density * gravity
        law[lay.L_DEEPEST] = DEEPEST * law[lay.L_RADIUS]
        return law

    def stiffness(self, width: float, gravity: float) -> float:
        """Return k of the pressure p = k z^n at zero slip.

        Args:
            width: of the wheel, m.
            gravity: m/s²; only Reece's form depends on it.

        Returns:
            k, Pa/m^n.
        """
        if self.pressure == "bekker":
            return self.kc / width + self.kphi
        weight = self.density * gravity
        return float((self.cohesion * self.kc + weight * width * self.kphi) / width**self.exponent)

    def rut_hardening(self, passes: int) -> float:
        """Return the factor on the stiffness for a pass in a rut.

        By it the depth of the rut grows as passes^(1 / rut_exponent).

        Args:
            passes: number of the pass, 1 on undisturbed soil.

        Returns:
            At least 1.
        """
        deeper = passes ** (1.0 / self.rut_exponent) - (passes - 1) ** (1.0 / self.rut_exponent)
        return float(deeper ** (-0.5 * (2.0 * self.exponent + 1.0)))
