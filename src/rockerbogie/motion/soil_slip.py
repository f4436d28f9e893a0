"""Empirical slip curve of a soil: slip by slope, as a distribution."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import expit, logit, ndtr, ndtri

from ..arrays import Array
from ..errors import RockerbogieError

#: Keys of a fit's JSON file for the soil of the whole drive and for that at its end.
CURVE, END_CURVE = "curve", "curve_at_end"


@dataclass(frozen=True)
class SoilSlip:
    """Slip by slope of one soil, fitted by `fit_soil`.

    logit(slip) = level + gain_along · along + gain_across · |across| with a normal error; along and across are the sines of the
    slope in the direction of travel (uphill positive) and across it.
    """

    level: float
    level_sigma: float  # standard deviation of the level at `centre`: change of the soil, and error of the fit
    gain_along: float
    gain_across: float
    gain_covariance: tuple[tuple[float, float], tuple[float, float]]
    centre: tuple[float, float]  # along and |across| at which level and gains are independent
    error: float  # variance of a measurement's logit
    along_range: tuple[float, float]  # of the measurements
    across_range: tuple[float, float]

    def distribution(self, along: ArrayLike, across: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Return mean and standard deviation of the logit of slip on a slope.

        Args:
            along: (...) sine of the slope in the direction of travel, uphill positive.
            across: (...) sine of the slope across it.

        Returns:
            (...) and (...).
        """
        u, v = np.broadcast_arrays(np.asarray(along, dtype=float), np.abs(np.asarray(across, dtype=float)))
        (a, b), (_, c) = self.gain_covariance
        du, dv = u - self.centre[0], v - self.centre[1]
        variance = self.level_sigma**2 + self.error + a * du**2 + 2 * b * du * dv + c * dv**2
        return np.asarray(self.level + self.gain_along * u + self.gain_across * v), np.sqrt(variance)

    def slip(self, along: ArrayLike, across: ArrayLike = 0.0, *, quantiles: ArrayLike = (0.1, 0.5, 0.9)) -> Array:
        """Return quantiles of the slip on a slope.

        Args:
            along, across: (...) as for `distribution`.
            quantiles: (k,) probabilities.

        Returns:
            (..., k) slips.
        """
        mean, sigma = self.distribution(along, across)
        return np.asarray(expit(mean[..., None] + sigma[..., None] * ndtri(np.asarray(quantiles, dtype=float))))

    def exceeding(self, along: ArrayLike, across: ArrayLike, limit: float) -> Array:
        """Return the probability that slip on a slope exceeds a limit.

        Args:
            along, across: (...) as for `distribution`.
            limit: slip, between 0 and 1.

        Returns:
            (...) probabilities.
        """
        mean, sigma = self.distribution(along, across)
        return np.asarray(ndtr((mean - logit(limit)) / sigma))

    def wheel_travel(self, along: ArrayLike, across: ArrayLike = 0.0) -> Array:
        """Return the expected wheel travel per metre of path, the mean of 1 / (1 − slip).

        Args:
            along, across: (...) as for `distribution`.

        Returns:
            (...) 1 or more.
        """
        mean, sigma = self.distribution(along, across)
        return np.asarray(1.0 + np.exp(mean + 0.5 * sigma**2))  # 1 / (1 - slip) = 1 + exp(logit of slip): lognormal

    def outside(self, along: ArrayLike, across: ArrayLike, margin: float) -> Any:
        """Return True (...) where a slope is beyond those of the measurements.

        Args:
            along, across: (...) as for `distribution`.
            margin: sine by which it may be.

        Returns:
            (...) bool.
        """
        u, v = np.asarray(along, dtype=float), np.abs(np.asarray(across, dtype=float))
        return (
            (u < self.along_range[0] - margin) | (u > self.along_range[1] + margin)
            | (v < self.across_range[0] - margin) | (v > self.across_range[1] + margin)
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the curve as JSON's types.

        Returns:
            Field -> value.
        """
        return asdict(self)

    @classmethod
    def from_json(cls, file: str | Path, *, at_end: bool = True) -> SoilSlip:
        """Read a curve from the fit_soil.json of `rockerbogie fit-soil`.

        Args:
            file: the file.
            at_end: the soil at the end of the drive; False: that of the whole drive, with a wider band.

        Returns:
            The curve.

        Raises:
            RockerbogieError: no such file, or no curve in it.
        """
        try:
            found = json.loads(Path(file).read_text(encoding="utf-8"))
            values = found[END_CURVE if at_end else CURVE]
            if values is None:
                raise RockerbogieError(
                    f"{str(file)!r} holds no slip curve: {found.get('no_curve_because', 'fit one with fit-soil')}"
                )
            pairs = {name: tuple(values[name]) for name in ("centre", "along_range", "across_range")}
            covariance = tuple(tuple(row) for row in values["gain_covariance"])
            return cls(**{**values, **pairs, "gain_covariance": covariance})
        except (OSError, ValueError, KeyError, TypeError) as error:
            if isinstance(error, RockerbogieError):
                raise
            raise RockerbogieError(
                f"{str(file)!r} cannot be read as a slip curve ({error}): give the fit_soil.json that rockerbogie fit-soil wrote"
            ) from None
