"""Slip, wheel travel and energy per cell and heading of a map, and their part in a plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, is_number
from ..errors import RockerbogieError, expect
from ..motion.soil_slip import SoilSlip

if TYPE_CHECKING:
    import xarray as xr

#: Least cost of a metre, m: downhill, a motor needs no energy, and a sparse graph has no edge of cost 0.
LEAST = 0.01


@dataclass(frozen=True)
class SlipCost:
    """Part of slip in a plan: states to avoid, and the quantity to minimise.

    Args:
        soil: the slip curve, as `fit_soil(...).at_end`.
        limit: slip that is to be avoided, between 0 and 1.
        risk: largest probability of more than `limit` at a state that may be used, between 0 and 1.
        minimise: "time": wheel travel at constant wheel speed. "energy": motor work against slope and resistance.
        resistance: rolling resistance as a fraction of the weight, for the energy.
    """

    soil: SoilSlip
    limit: float = 0.8
    risk: float = 0.1
    minimise: Literal["time", "energy"] = "time"
    resistance: float = 0.1

    def __post_init__(self) -> None:
        expect(self.soil, SoilSlip, "soil", "give the curve or at_end of a fit_soil, or SoilSlip.from_json")
        for name, value in (("slip limit", self.limit), ("slip risk", self.risk)):
            if not (is_number(value) and 0 < value < 1):
                raise RockerbogieError(f"the {name} is {value!r:.60}; give a number between 0 and 1")
        if self.minimise not in ("time", "energy"):
            raise RockerbogieError(f"minimise is {self.minimise!r}; give 'time' or 'energy'")
        if not (is_number(self.resistance) and 0 < self.resistance < 1):
            raise RockerbogieError(
                f"resistance is {self.resistance!r:.60}; give a fraction of the weight between 0 and 1, such as 0.1"
            )


class SlipStates(NamedTuple):
    """Slip at the states of a map, each (headings, rows, cols)."""

    allowed: NDArray[np.bool_]  # probability of more than the limit is at most the risk
    travel: Array  # expected wheel travel per metre
    price: Array  # cost per metre, m of level terrain without slip


def slip_layers(maps: xr.Dataset, cost: SlipCost) -> xr.Dataset:
    """Add slip, speed made good and energy per metre to a map.

    Args:
        maps: from `traversability`, with its layers roll and pitch.
        cost: the slip curve and its limit.

    Returns:
        The map with layers over (heading, y, x): `slip_low`, `slip`, `slip_high` (quantiles 10, 50, 90 %), `slip_exceed`
        (probability of more than the limit), `speed_made_good` (as a fraction of the wheels' speed: 1 / expected wheel travel
        per metre) and `energy` (expected motor work per metre and weight; times weight in N: J/m). NaN where the rover does not
        settle.

    Raises:
        RockerbogieError: a map without roll and pitch.
    """
    expect(cost, SlipCost, "cost", "make one with rockerbogie.SlipCost(soil)")
    along, across = _sines(maps)
    dims = ("heading", "y", "x")
    slip = cost.soil.slip(along, across)
    travel = cost.soil.wheel_travel(along, across)
    values = {
        "slip_low": (slip[..., 0], "10 % quantile of slip"),
        "slip": (slip[..., 1], "median of slip"),
        "slip_high": (slip[..., 2], "90 % quantile of slip"),
        "slip_exceed": (cost.soil.exceeding(along, across, cost.limit), f"probability of slip above {cost.limit:g}"),
        "speed_made_good": (1 / travel, "speed as a fraction of the wheels' speed"),
        "energy": (_work(cost, along, across) * travel, "motor work per metre and weight"),
    }
    return maps.assign({name: (dims, array, {"units": "1", "long_name": text}) for name, (array, text) in values.items()})


def slip_states(maps: xr.Dataset, cost: SlipCost) -> SlipStates:
    """Return the states that slip allows, and their cost.

    Args:
        maps: from `traversability`, with its layers roll and pitch.
        cost: the slip curve and its limit.

    Returns:
        `SlipStates`.

    Raises:
        RockerbogieError: a map without roll and pitch.
    """
    along, across = _sines(maps)
    travel = cost.soil.wheel_travel(along, across)
    price = travel if cost.minimise == "time" else np.maximum(_work(cost, along, across) * travel / cost.resistance, LEAST)
    return SlipStates(cost.soil.exceeding(along, across, cost.limit) <= cost.risk, travel, price)


def _work(cost: SlipCost, along: Array, across: Array) -> Array:
    """Return motor work per metre of wheel travel and weight, 0 or more."""
    level = np.sqrt(np.maximum(1 - along**2 - across**2, 0.0))
    return np.asarray(np.maximum(along + cost.resistance * level, 0.0))


def _sines(maps: xr.Dataset) -> tuple[Any, Any]:
    """Return the sines of the slope ahead and to the left (headings, rows, cols)."""
    missing = [name for name in ("roll", "pitch") if name not in maps]
    if missing:
        raise RockerbogieError(
            f"slip on a map needs its layers roll and pitch for each heading, and it has no {missing[0]}: "
            "save the map as .zarr or .nc, or as .tif with --per-heading"
        )
    pitch, roll = (np.asarray(maps[name].transpose("heading", "y", "x").values, dtype=float) for name in ("pitch", "roll"))
    return -np.sin(pitch), np.cos(pitch) * np.sin(roll)
