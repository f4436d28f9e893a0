"""Layers of a map, their units and meanings, and their Dataset."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import RockerbogieError, unknown_name
from ..settling.status import Status
from .limits import BITS, FORCES, Limits

if TYPE_CHECKING:
    import xarray as xr


class Layer(NamedTuple):
    """One variable of a map."""

    per_heading: bool  # (heading, y, x), or a summary (y, x)
    kind: str  # NumPy's name of its type
    units: str
    long_name: str
    usual: bool = True  # made unless layers are named

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of its axes."""
        return ("heading", "y", "x") if self.per_heading else ("y", "x")

    @property
    def blank(self) -> float:
        """Value where no tile has been written: 0 for integers, NaN for others."""
        return 0 if self.kind.startswith("uint") else math.nan


LAYERS = {
    "status": Layer(True, "uint8", "1", "status of the settled pose"),
    "tilt": Layer(True, "float64", "rad", "angle between the body's z and the vertical"),
    "roll": Layer(True, "float64", "rad", "roll"),
    "pitch": Layer(True, "float64", "rad", "pitch, nose down positive"),
    "rocker": Layer(True, "float64", "rad", "left rocker angle"),
    "bogie_left": Layer(True, "float64", "rad", "left bogie angle to its rocker"),
    "bogie_right": Layer(True, "float64", "rad", "right bogie angle to its rocker"),
    "clearance": Layer(True, "float64", "m", "least height of the body's box over the terrain"),
    "exceeded": Layer(True, "uint8", "1", "limits exceeded"),
    "margin": Layer(True, "float64", "rad", "angle left to the closest limit, negative beyond it", False),
    "required_friction": Layer(True, "float64", "1", "least friction coefficient that holds the rover", False),
    "tip_margin": Layer(True, "float64", "rad", "least angle by which gravity must turn until the rover tips over", False),
    "max_torque": Layer(True, "float64", "N m", "largest motor torque of the six wheels", False),
    "passable": Layer(False, "float32", "1", "share of headings at which no limit is exceeded"),
    "worst_tilt": Layer(False, "float64", "rad", "greatest tilt over all headings"),
    "best_tilt": Layer(False, "float64", "rad", "least tilt over all headings"),
    "best_heading": Layer(False, "float64", "rad", "passable heading of least tilt, from +x, counter-clockwise"),
    "worst_clearance": Layer(False, "float64", "m", "least clearance over all headings"),
    "worst_exceeded": Layer(False, "uint8", "1", "limits exceeded at any heading"),
    "worst_margin": Layer(False, "float64", "rad", "least margin over all headings", False),
    "worst_friction": Layer(False, "float64", "1", "greatest required friction over all headings", False),
    "worst_tip_margin": Layer(False, "float64", "rad", "least tip margin over all headings", False),
    "worst_torque": Layer(False, "float64", "N m", "largest motor torque over all headings", False),
    "slope": Layer(False, "float64", "rad", "slope of the terrain at the cell", False),
    "aspect": Layer(False, "float64", "rad", "direction in which the terrain falls, from +x, counter-clockwise", False),
    "roughness": Layer(False, "float64", "m", "RMS height of the terrain about its plane over a wheelbase", False),
}


#: Layer of forces -> its summary.
WORST = {"required_friction": "worst_friction", "tip_margin": "worst_tip_margin", "max_torque": "worst_torque"}

#: Layers of `reachability`.
REACH = {
    "reachable": Layer(False, "float32", "1", "share of headings at which the rover can reach the cell"),
    "reach_cost": Layer(False, "float64", "m", "least cost of reaching the cell, metres of flat terrain"),
}


def kind_of(name: str, limits: Limits) -> str:
    """Return NumPy's name of a layer's type.

    Args:
        name: of the layer.
        limits: of the map; the bits of limits of forces need 16 bits.

    Returns:
        The name.
    """
    kind = LAYERS[name].kind
    return "uint16" if name.endswith("exceeded") and limits.forces else kind


def chosen_layers(names: Iterable[str] | None, bounded: Iterable[str] = ()) -> tuple[str, ...]:
    """Return layer names in the order of `LAYERS`.

    Args:
        names: layers, or None for the usual ones; "all" stands for all of them.
        bounded: layers of forces that have a limit: they are usual then, and so are their summaries.

    Returns:
        The names, each once.

    Raises:
        RockerbogieError: an unknown name, or no name.
    """
    if names is None:
        more = {layer for name in bounded for layer in (name, WORST[name])}
        return tuple(name for name, layer in LAYERS.items() if layer.usual or name in more)
    asked = [names] if isinstance(names, str) else list(names)
    if "all" in asked:
        return tuple(LAYERS)
    for name in asked:
        if name not in LAYERS:
            raise RockerbogieError(unknown_name("layer", str(name), LAYERS))
    if not asked:
        raise RockerbogieError(f"layers is empty: name some of {', '.join(LAYERS)}, or give None for the usual ones")
    return tuple(name for name in LAYERS if name in asked)


def attributes(name: str, crs: str | None, kind: str) -> dict[str, Any]:
    """Return the attributes of a layer by the CF conventions.

    Args:
        name: of the layer.
        crs: of the map, or None.
        kind: NumPy's name of its type.

    Returns:
        Units, long name, flags, and the name of the grid mapping if there is a CRS.
    """
    layer = LAYERS[name]
    given: dict[str, Any] = {"units": layer.units, "long_name": layer.long_name}
    if name == "status":
        given["flag_values"] = np.array([int(code) for code in Status], dtype=np.uint8)
        given["flag_meanings"] = " ".join(code.name for code in Status)
    if name.endswith("exceeded"):
        bits = {limit: bit for limit, bit in BITS.items() if kind == "uint16" or limit not in FORCES}
        given["flag_masks"] = np.array(list(bits.values()), dtype=kind)
        given["flag_meanings"] = " ".join(bits)
    if crs:
        given["grid_mapping"] = "spatial_ref"
    return given


def dataset(
    data: Mapping[str, Any], heading: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64], about: dict[str, Any]
) -> xr.Dataset:
    """Return the Dataset of a map.

    Args:
        data: layers by name: NumPy or lazy arrays.
        heading: (n,) rad.
        x: (cols,) of the cell centres, m.
        y: (rows,) of the cell centres, m.
        about: attributes of the map; its `crs` becomes the grid mapping `spatial_ref`.

    Returns:
        Dataset over (heading, y, x).
    """
    import xarray as xr

    crs = about.get("crs")
    coords: dict[str, Any] = {
        "heading": ("heading", heading, {"units": "rad", "long_name": "heading from +x, counter-clockwise"}),
        **{
            axis: (axis, at, {"units": "m", "long_name": f"{axis} of the cell's centre", "axis": axis.upper(),
                              "standard_name": f"projection_{axis}_coordinate"})
            for axis, at in (("y", y), ("x", x))
        },
    }  # fmt: skip
    if crs:
        coords["spatial_ref"] = ((), np.int64(0), _grid_mapping(crs))
    layers = {name: (LAYERS[name].dims, data[name], attributes(name, crs, str(data[name].dtype))) for name in data}
    return xr.Dataset(layers, coords, about)


def _grid_mapping(crs: str) -> dict[str, str]:
    """Return the attributes of a CRS in CF's grid mapping variable."""
    try:
        from rasterio.crs import CRS
        from rasterio.errors import CRSError
    except ImportError:
        return {"crs_wkt": crs, "spatial_ref": crs}
    with contextlib.suppress(CRSError):  # a name that is unknown to GDAL is kept
        crs = str(CRS.from_user_input(crs).to_wkt())
    return {"crs_wkt": crs, "spatial_ref": crs}
