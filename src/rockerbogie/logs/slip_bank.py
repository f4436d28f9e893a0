"""Bank of filters that forecasts slip (docs/forecast.md)."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.special import expit, logit, ndtr

from ..arrays import Array

#: Filters of the bank: change of the level per metre and error of a measurement (variances of the logit of slip), change of
#: its growth per metre, and gain on the sine of the slope.
CHANGES, ERRORS, GROWTHS, GAINS = (0.0025, 0.02, 0.08, 0.3, 1.0), (0.003, 0.01, 0.03, 0.1), (0.0, 0.004), (0.0, 6.0)
#: Weight of each change before the first measurement.
PRIOR = (0.2, 0.3, 0.3, 0.15, 0.05)
#: Error of a slip that was measured by corrected positions, variance of its logit: 2 % of the distance.
POSITION_ERROR = 0.02
#: Level before the first measurement, slip; its variance, and that of the growth.
START, START_VARIANCE, GROWTH_VARIANCE = 0.2, 1.0, 0.012
#: Share of a growth that is left after 1 m; share of the weights that returns to the prior at each measurement.
DAMPING, SHARED = 0.8, 0.1
#: Slope from which the gain counts (sine); slips are limited to SMALLEST … 1 − SMALLEST before their logit is taken.
USUAL_SLOPE, SMALLEST = 0.2, 0.02
_NODES, _SHARES = (values for values in np.polynomial.hermite_e.hermegauss(31))
_SHARES = _SHARES / _SHARES.sum()


class SlipBank:
    """Bank of local-level filters for the logit of slip, weighted by their past predictions.

    Each filter has a level (the soil), a growth per metre and a gain on the slope. A share of the weights returns to the prior at
    each measurement, so that the bank recovers from a change of soil.
    """

    def __init__(self) -> None:
        grid = np.array(list(product(CHANGES, ERRORS, GROWTHS, GAINS)))
        self.change, self.error, self.growing, self.gain = grid.T
        n = len(grid)
        self.level, self.growth = np.full(n, float(logit(START))), np.zeros(n)
        self.P00, self.P01 = np.full(n, START_VARIANCE), np.zeros(n)
        self.P11 = np.where(self.growing > 0, GROWTH_VARIANCE, 0.0)
        self.prior = np.array([PRIOR[CHANGES.index(change)] for change in self.change])
        self.prior /= self.prior.sum()
        self.weight = self.prior

    def ahead(self, travel: float) -> tuple[Array, Array, Array, Array, Array]:
        """Return the state after some travel without a measurement.

        Args:
            travel: m.

        Returns:
            Level, growth and the covariance P00, P01, P11, each (filters,).
        """
        kept, moving = DAMPING**travel, np.where(self.growing > 0, travel, 0.0)
        return (
            self.level + moving * self.growth,
            kept * self.growth,
            self.P00 + 2 * moving * self.P01 + moving**2 * self.P11 + self.change * travel,
            kept * (self.P01 + moving * self.P11),
            kept**2 * self.P11 + self.growing * travel,
        )

    def advance(self, travel: float) -> None:
        """Move the state over some travel.

        Args:
            travel: m.
        """
        self.level, self.growth, self.P00, self.P01, self.P11 = self.ahead(travel)

    def measure(self, slip: float, slope: float, from_position: bool) -> None:
        """Update all filters by a measured slip.

        Weights change only by slips of the log, because the filters differ in the error of these.

        Args:
            slip: measured slip.
            slope: sine of the slope on which it was measured.
            from_position: measured by corrected positions.
        """
        error = np.full_like(self.error, POSITION_ERROR) if from_position else self.error
        variance = self.P00 + error
        off = _logit(slip) - self.level - self.gain * (slope - USUAL_SLOPE)
        if not from_position:
            score = np.log(self.weight) - 0.5 * (np.log(variance) + off**2 / variance)
            weight = np.exp(score - score.max())
            self.weight = (1 - SHARED) * weight / weight.sum() + SHARED * self.prior
        k0, k1 = self.P00 / variance, self.P01 / variance
        self.level, self.growth = self.level + k0 * off, self.growth + k1 * off
        self.P00, self.P01, self.P11 = self.P00 * (1 - k0), self.P01 * (1 - k0), self.P11 - k1 * self.P01

    def predictive(self, travel: float, slope: float) -> tuple[Array, Array]:
        """Return mean and standard deviation (filters,) of the logit of a coming slip.

        Args:
            travel: m.
            slope: sine of the slope there.

        Returns:
            Means and standard deviations.
        """
        level, _, P00, _, _ = self.ahead(travel)
        return level + self.gain * (slope - USUAL_SLOPE), np.sqrt(P00 + self.error)

    def exceeding(self, travel: float, slope: float, limit: float) -> float:
        """Return the probability that one of the next two measurements, 1 m apart, exceeds a limit.

        Args:
            travel: travel until the first of the two, m.
            slope: sine of the slope there.
            limit: slip.

        Returns:
            Probability, 0 to 1.
        """
        level, growth, P00, P01, P11 = self.ahead(travel)
        first = level[:, None] + np.sqrt(P00)[:, None] * _NODES
        along, moving = P01 / P00, np.where(self.growing > 0, 1.0, 0.0)
        second = first + (moving * growth)[:, None] + (moving * along)[:, None] * (first - level[:, None])
        spread = np.sqrt(self.change + moving * (P11 - along * P01) + self.error)
        free = _logit(limit) - (self.gain * (slope - USUAL_SLOPE))[:, None]
        below = ndtr((free - first) / np.sqrt(self.error)[:, None]) * ndtr((free - second) / spread[:, None])
        return float(np.clip(1 - self.weight @ (below @ _SHARES), 0.0, 1.0))

    def moments(self, travel: float, slope: float, quantiles: Array) -> tuple[float, Array]:
        """Forecast mean and quantiles of the slip that the log will hold after some travel.

        Args:
            travel: m.
            slope: sine of the slope there.
            quantiles: (k,) probabilities.

        Returns:
            Mean, and (k,) slips.
        """
        mean, sigma = self.predictive(travel, slope)
        expected = float(self.weight @ (expit(mean[:, None] + sigma[:, None] * _NODES) @ _SHARES))
        low, high = (np.full(len(quantiles), value) for value in ((mean - 8 * sigma).min(), (mean + 8 * sigma).max()))
        for _ in range(50):
            half = 0.5 * (low + high)
            above = self.weight @ ndtr((half - mean[:, None]) / sigma[:, None]) > quantiles
            low, high = np.where(above, low, half), np.where(above, half, high)
        return expected, expit(0.5 * (low + high))

    def held(self, travel: float, slope: float, known: float, shares: Array, quantiles: Array) -> tuple[float, Array]:
        """Forecast the log's slip over a distance in which it is measured once more.

        Args:
            travel: until the next measurement, m.
            slope: sine of the slope there.
            known: slip before it.
            shares: (n,) shares of the distance before it, equally probable, 0 to 1.
            quantiles: (k,) probabilities.

        Returns:
            Mean, and (k,) slips; NaN without a known slip.
        """
        if np.isnan(known):
            return np.nan, np.full(len(quantiles), np.nan)
        mean, sigma = self.predictive(travel, slope)
        coming = float(self.weight @ (expit(mean[:, None] + sigma[:, None] * _NODES) @ _SHARES))
        # equal shares, as of measurements at equal distances, are one term of the sum
        whole, (part, times) = np.mean(shares == 1), np.unique(shares[shares < 1], return_counts=True)
        part = part[:, None]
        low, high = np.full(len(quantiles), min(known, 0.0)), np.ones(len(quantiles))
        for _ in range(40):
            half = 0.5 * (low + high)
            with np.errstate(divide="ignore"):
                free = logit(np.clip((half - part * known) / (1 - part), 0.0, 1.0))
            below = np.einsum("f,fnk->nk", self.weight, ndtr((free - mean[:, None, None]) / sigma[:, None, None]))
            above = whole * (half >= known) + times @ below / len(shares) > quantiles
            low, high = np.where(above, low, half), np.where(above, half, high)
        return float(np.mean(shares * known + (1 - shares) * coming)), 0.5 * (low + high)


def _logit(slip: float) -> float:
    """Return the logit of a slip, limited to where it is finite."""
    return float(logit(np.clip(slip, SMALLEST, 1 - SMALLEST)))
