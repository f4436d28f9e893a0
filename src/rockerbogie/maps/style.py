"""Colours of a map by the share of headings passable, and a style for QGIS."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple
from xml.sax.saxutils import quoteattr

from ..files.outputs import SOURCE
from .geotiff import FIRST, bands

if TYPE_CHECKING:
    import xarray as xr


class Class(NamedTuple):
    """Class of cells with one colour."""

    most: float  # greatest share of headings passable
    colour: str
    label: str


#: Colours of Okabe and Ito, and Tol's wine, for the colour-blind. A share is that of the passable headings.
CLASSES = (
    Class(0.0, "#882255", "no heading passable"),
    Class(0.5, "#E69F00", "up to half of the headings passable"),
    Class(1 - 1e-6, "#F0E442", "more than half of the headings passable"),
    Class(1.0, "#009E73", "every heading passable"),
)


def write_style(maps: xr.Dataset, file: str | Path, *, per_heading: bool = False) -> Path:
    """Write the QGIS style (.qml) of a map's GeoTIFF.

    Args:
        maps: the map, with the layer `passable`.
        file: the .qml, named as the GeoTIFF; overwritten.
        per_heading: as for the GeoTIFF.

    Returns:
        The path of the file.
    """
    band = 1 + [layer.variable for layer in bands(maps, per_heading)].index(FIRST)
    items = "\n".join(
        f'          <item alpha="255" value={quoteattr(_bound(c.most))} color={quoteattr(c.colour)} label={quoteattr(c.label)}/>'
        for c in CLASSES
    )
    Path(file).write_text(_QML.format(band=band, items=items, source=SOURCE), encoding="utf-8")
    return Path(file)


def _bound(most: float) -> str:
    """Return the upper bound of a class as QGIS writes it."""
    return "inf" if most == 1.0 else f"{most:.9g}"


_QML = """<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>
<!-- {source} -->
<qgis version="3.22.0" styleCategories="Symbology|Rendering" hasScaleBasedVisibilityFlag="0">
  <pipe>
    <provider>
      <resampling enabled="false" zoomedInResamplingMethod="nearestNeighbour" \
zoomedOutResamplingMethod="nearestNeighbour" maxOversampling="2"/>
    </provider>
    <rasterrenderer type="singlebandpseudocolor" band="{band}" opacity="1" alphaBand="-1" nodataColor="" \
classificationMin="0" classificationMax="1">
      <rasterTransparency/>
      <minMaxOrigin>
        <limits>None</limits>
        <extent>WholeRaster</extent>
        <statAccuracy>Exact</statAccuracy>
      </minMaxOrigin>
      <rastershader>
        <colorrampshader colorRampType="DISCRETE" classificationMode="1" clip="0" minimumValue="0" maximumValue="1" \
labelPrecision="2">
{items}
        </colorrampshader>
      </rastershader>
    </rasterrenderer>
    <brightnesscontrast brightness="0" contrast="0" gamma="1"/>
    <huesaturation saturation="0" grayscaleMode="0" colorizeOn="0"/>
    <rasterresampler maxOversampling="2"/>
    <resamplingStage>resamplingFilter</resamplingStage>
  </pipe>
  <blendMode>0</blendMode>
</qgis>
"""
