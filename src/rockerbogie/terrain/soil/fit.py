"""Fits of soil parameters to wheel trials, and of a slip curve to drives on slopes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import least_squares

from ..._kernels.jit.parallel import parallel_for
from ..._kernels.soil import forces as kernel
from ..._kernels.soil import layout as lay
from ...arrays import Array
from ...errors import RockerbogieError
from ...gravity import GRAVITY, check_gravity
from .laws import Grousers, SlipCurve, Soil, Wheel

#: Standard errors of trials that weigh the residuals: drawbar and side force over load, sinkage (m).
DRAWBAR_ERROR, SIDE_ERROR, SINKAGE_ERROR = 0.05, 0.25, 0.0025
#: Names of terms: `peak.1` is the factor of slip in `peak_terms`, and so on.
TERM_NAMES = tuple(f"{name}.{k}" for name in ("exponent", "peak", "exit") for k in range(1, lay.TERMS))
#: Step of parameters for derivatives, relative to their prior's standard deviation.
STEP = 1e-4


@dataclass(frozen=True, eq=False)
class WheelTrials:
    """Trials of single wheels in steady motion; all arrays broadcast to (n,).

    Attributes:
        radius, width: of the wheel, m.
        grousers: their height, m; 0: smooth.
        load: vertical load, N.
        rim, vx, vy: rim speed, speed of the axle along the heading and to its left, m/s; rim and vx at least 0.
        drawbar, side: measured forces along the heading and to its left, N; NaN: not measured.
        sinkage: m; NaN: not measured.
    """

    radius: ArrayLike
    width: ArrayLike
    grousers: ArrayLike
    load: ArrayLike
    rim: ArrayLike
    vx: ArrayLike
    vy: ArrayLike
    drawbar: ArrayLike = np.nan
    side: ArrayLike = np.nan
    sinkage: ArrayLike = np.nan

    def arrays(self) -> dict[str, Array]:
        """Return all columns as arrays (n,).

        Returns:
            Arrays by name.

        Raises:
            RockerbogieError: shapes do not broadcast, or a load, speed or dimension is not finite or negative.
        """
        names = [field.name for field in dataclasses.fields(self)]
        try:
            spread = np.broadcast_arrays(*(np.atleast_1d(np.asarray(getattr(self, name), dtype=float)) for name in names))
        except (TypeError, ValueError):
            raise RockerbogieError(f"trials: {', '.join(names)} must be numbers of shapes that broadcast") from None
        columns = {name: np.array(part).ravel() for name, part in zip(names, spread, strict=True)}
        for name in names[:6]:
            if not (np.isfinite(columns[name]) & (columns[name] >= 0.0)).all():
                raise RockerbogieError(f"trials: {name} must be finite and at least 0 in all trials")
        if not (columns["load"] > 0.0).all() or not np.isfinite(columns["vy"]).all():
            raise RockerbogieError("trials: load must be above 0 and vy finite in all trials")
        return columns

    def take(self, rows: ArrayLike) -> WheelTrials:
        """Return some of the trials.

        Args:
            rows: indices or a mask (n,).

        Returns:
            The trials.
        """
        index = np.asarray(rows)
        return WheelTrials(**{name: column[index] for name, column in self.arrays().items()})


@dataclass(frozen=True, eq=False)
class TrialResiduals:
    """Computed less measured values of trials, (n,) each; NaN where not measured.

    Attributes:
        drawbar, side: over the load.
        sinkage: m.
        overloaded: True where the soil cannot carry the load; forces are then those at the deepest sinkage.
    """

    drawbar: Array
    side: Array
    sinkage: Array
    overloaded: Array

    def rms(self, rows: ArrayLike = True) -> tuple[float, float, float]:
        """Return the RMS of the residuals of drawbar, side force and sinkage.

        Args:
            rows: mask (n,) of the trials that count.

        Returns:
            Drawbar and side force over load, sinkage in m.
        """
        mask = np.broadcast_to(np.asarray(rows, dtype=bool), self.drawbar.shape)
        values = [part[mask] for part in (self.drawbar, self.side, self.sinkage)]
        drawbar, side, sinkage = (
            float(np.sqrt(np.mean(v[np.isfinite(v)] ** 2))) if np.isfinite(v).any() else np.nan for v in values
        )
        return drawbar, side, sinkage


@dataclass(frozen=True, eq=False)
class WheelFit:
    """Result of `fit_wheel_trials`.

    Attributes:
        soil: the fitted soil.
        values, deviations: fitted parameters and their standard deviations by name, from the linearised posterior.
        covariance: (n, n) of the parameters, in the order of `values`.
        cost: half the sum of squares, priors included.
        residuals: of the trials that were fitted.
    """

    soil: Soil
    values: dict[str, float]
    deviations: dict[str, float]
    covariance: Array
    cost: float
    residuals: TrialResiduals

    def samples(self, count: int, seed: int = 0) -> list[Soil]:
        """Return soils drawn from the linearised posterior.

        Parameters are drawn together, from a normal distribution, and clipped to the limits of the fit.

        Args:
            count: number of soils, at least 1.
            seed: of the random numbers.

        Returns:
            The soils.

        Raises:
            RockerbogieError: a count below 1.
        """
        if isinstance(count, bool) or not isinstance(count, int) or count < 1:
            raise RockerbogieError(f"count is {count!r:.40}; give a whole number of samples, at least 1")
        names = list(self.values)
        drawn = np.random.default_rng(seed).multivariate_normal(list(self.values.values()), self.covariance, count)
        drawn = np.clip(drawn, *_bounds(names))
        return [changed_soil(self.soil, dict(zip(names, row, strict=True))) for row in drawn.tolist()]


def trial_residuals(soil: Soil, trials: WheelTrials, *, gravity: float = GRAVITY["earth"]) -> TrialResiduals:
    """Compute the residuals of trials under a soil.

    Args:
        soil: the soil.
        trials: the trials.
        gravity: m/s².

    Returns:
        The residuals.
    """
    columns = trials.arrays()
    return _residuals(soil, columns, _wheels(columns), check_gravity(gravity))


def fit_wheel_trials(
    soil: Soil,
    trials: WheelTrials,
    priors: Mapping[str, tuple[float, float]],
    *,
    gravity: float = GRAVITY["earth"],
    weights: tuple[ArrayLike, ArrayLike, ArrayLike] = (DRAWBAR_ERROR, SIDE_ERROR, SINKAGE_ERROR),
    steps: int = 40,
) -> WheelFit:
    """Fit parameters of a soil to wheel trials by least squares with priors.

    Args:
        soil: parameters that are not fitted, and the start.
        trials: the trials.
        priors: name -> (mean, standard deviation) of the parameters to fit: fields of Soil, `TERM_NAMES` such as "peak.1", and
            "stiffness", the decadic logarithm of kphi. The fit starts at the means.
        gravity: m/s².
        weights: standard errors of drawbar / load, side force / load and sinkage (m), numbers or (n,).
        steps: largest number of Gauss-Newton steps.

    Returns:
        The fit.

    Raises:
        RockerbogieError: an unknown parameter, or trials that are not valid.
    """
    columns, field = trials.arrays(), check_gravity(gravity)
    wheels = _wheels(columns)
    for name in priors:
        if name != "stiffness" and name not in TERM_NAMES and not isinstance(getattr(soil, name, ""), int | float | None):
            raise RockerbogieError(
                f"parameter {name!r} is not known: give fields of Soil, 'stiffness', or {', '.join(TERM_NAMES)}"
            )
    names = list(priors)
    mean, deviation = (np.array([priors[name][k] for name in names]) for k in (0, 1))
    low, high = _bounds(names)

    def equations(x: Array) -> Array:
        found = _residuals(changed_soil(soil, dict(zip(names, mean + deviation * x, strict=True))), columns, wheels, field)
        parts = [
            np.where(np.isfinite(part), part, 0.0) / error
            for part, error in zip((found.drawbar, found.side, found.sinkage), weights, strict=True)
        ]
        return np.concatenate([*parts, x])

    limits = (np.maximum((low - mean) / deviation, -1e3), np.minimum((high - mean) / deviation, 1e3))
    start = np.clip(np.zeros(len(names)), limits[0] + 1e-9, limits[1] - 1e-9)
    solved = least_squares(equations, start, bounds=limits, diff_step=STEP, max_nfev=steps)
    values = dict(zip(names, (mean + deviation * solved.x).tolist(), strict=True))
    covariance = np.linalg.inv(solved.jac.T @ solved.jac) * np.outer(deviation, deviation)
    spread = np.sqrt(np.diag(covariance))
    fitted = changed_soil(soil, values)
    return WheelFit(
        fitted,
        values,
        dict(zip(names, spread.tolist(), strict=True)),
        covariance,
        float(solved.cost),
        _residuals(fitted, columns, wheels, field),
    )


def changed_soil(soil: Soil, values: Mapping[str, float]) -> Soil:
    """Return a soil with some parameters changed.

    Args:
        soil: the soil.
        values: by name, as for `fit_wheel_trials`.

    Returns:
        The changed soil.
    """
    changes: dict[str, object] = {name: value for name, value in values.items() if name != "stiffness" and "." not in name}
    if "stiffness" in values:
        changes["kphi"] = 10.0 ** values["stiffness"]
    for quantity in ("exponent", "peak", "exit"):
        terms = list(getattr(soil, f"{quantity}_terms"))
        for k in range(1, lay.TERMS):
            terms[k - 1] = values.get(f"{quantity}.{k}", terms[k - 1])
        changes[f"{quantity}_terms"] = tuple(terms)
    return dataclasses.replace(soil, **changes)  # type: ignore[arg-type]


def fit_slip_curve(ratio: ArrayLike, slip: ArrayLike, *, start: tuple[float, float] = (0.3, 3.0)) -> tuple[SlipCurve, float]:
    """Fit the two parameters of a slip curve to measured slips.

    Args:
        ratio: (n,) drawbar over load; of a rover on a slope, the slope's tangent.
        slip: (n,) from 0 to 1.
        start: first values of ratio and power.

    Returns:
        The curve and the RMS residual of slip.

    Raises:
        RockerbogieError: fewer than 2 points, or values that are not finite.
    """
    x, y = np.broadcast_arrays(np.asarray(ratio, dtype=float), np.asarray(slip, dtype=float))
    if x.size < 2 or not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise RockerbogieError("a slip curve needs at least 2 points with finite ratio and slip")
    solved = least_squares(lambda p: SlipCurve(p[0], p[1]).slip(x).ravel() - y.ravel(), start, bounds=((0.01, 1.0), (5.0, 20.0)))
    return SlipCurve(*solved.x.tolist()), float(np.sqrt(np.mean(solved.fun**2)))


def _wheels(columns: dict[str, Array]) -> tuple[list[Wheel], Array]:
    """Return the distinct wheels of trials and the wheel of each trial."""
    rows = np.stack([columns[name] for name in ("radius", "width", "grousers")], axis=1)
    distinct, which = np.unique(rows, axis=0, return_inverse=True)
    wheels = [Wheel(float(r), float(b), Grousers(float(h)) if h > 0.0 else None) for r, b, h in distinct]
    return wheels, np.ascontiguousarray(which.ravel(), dtype=np.int64)


def _residuals(soil: Soil, columns: dict[str, Array], wheels: tuple[list[Wheel], Array], gravity: float) -> TrialResiduals:
    """Return computed minus measured values of trials: forces over load, and sinkage, m.

    A value that cannot be computed counts as 1000 (N or m).
    """
    laws = np.array([soil.packed(wheel, gravity) for wheel in wheels[0]])
    n = columns["load"].size
    out, status = np.empty((n, lay.OUTPUTS)), np.empty(n, dtype=np.uint8)
    parallel_for(kernel.motion_batch, n, laws, wheels[1], *(columns[name] for name in ("load", "rim", "vx", "vy")), out, status)
    out = np.nan_to_num(out, nan=1e3)
    load = columns["load"]
    return TrialResiduals(
        drawbar=(out[:, 0] - columns["drawbar"]) / load,
        side=(out[:, 1] - columns["side"]) / load,
        sinkage=out[:, 3] - columns["sinkage"],
        overloaded=status == lay.OVERLOADED,
    )


def _bounds(names: list[str]) -> tuple[Array, Array]:
    """Return the limits of parameters inside those of Soil."""
    limits = {
        "stiffness": (4.0, 11.0), "cohesion": (5.0, 5e3), "friction_angle": (0.1, 1.0), "exponent": (0.3, 2.4),
        "peak": (0.0, 0.95),
        "exit": (0.0, 1.3), "shear_modulus": (3e-4, 0.15), "side_shear_modulus": (3e-4, 0.15), "bulldozing": (0.0, 8.0),
        "exponent_grouser": (-15.0, 15.0), "exit_grouser": (-15.0, 15.0), "destructive_angle": (0.1, 1.3),
    }  # fmt: skip
    pairs = [limits.get(name, (-4.0, 4.0)) for name in names]
    return np.array([low for low, _ in pairs]), np.array([high for _, high in pairs])
