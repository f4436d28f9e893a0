"""Accessor `.rockerbogie` of xarray Datasets: a run or a map as a three-dimensional view.

`import rockerbogie` registers it, before or after xarray is imported.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray as xr

if TYPE_CHECKING:
    from .show import View


@xr.register_dataset_accessor("rockerbogie")  # type: ignore[no-untyped-call]
class DatasetView:
    """View of a run or a map; the last value of a notebook's cell is shown in three dimensions."""

    def __init__(self, data: xr.Dataset) -> None:
        self._data = data

    def show(self, **more: Any) -> View:
        """Show the run or map, as `rockerbogie.show`.

        Args:
            more: arguments of `rockerbogie.show`.

        Returns:
            The view.
        """
        from .show import show

        return show(self._data, **more)

    def to_html(self, file: str | Path, **more: Any) -> Path:
        """Write the run or map as a page, as `rockerbogie.to_html`.

        Args:
            file: the page, ending in .html.
            more: arguments of `rockerbogie.to_html`.

        Returns:
            The file.
        """
        from .show import to_html

        return to_html(self._data, file, **more)

    def _repr_html_(self) -> str:
        """Return the frame that a notebook shows."""
        from .replay import page
        from .show import View

        return View(page(self._data))._repr_html_()
