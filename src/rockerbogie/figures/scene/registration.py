"""Registration of the accessor `.rockerbogie` when xarray is imported, without importing it."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType


class _Finder:
    """Finder that gives xarray's own module, and registers the accessor once it has been loaded."""

    _searching = False

    def find_spec(self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return the specification of xarray by the other finders; None for other modules."""
        if name != "xarray" or self._searching:
            return None
        from importlib.util import find_spec

        self._searching = True
        try:
            spec = find_spec(name)
        finally:
            self._searching = False
        if spec is not None and spec.loader is not None:
            load = spec.loader.exec_module

            def load_and_register(module: ModuleType) -> None:
                load(module)
                sys.meta_path.remove(self)
                register()

            spec.loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


def register() -> None:
    """Register the accessor."""
    importlib.import_module(f"{__package__}.accessor")


def register_with_xarray() -> None:
    """Register the accessor now if xarray is imported, else as soon as it is."""
    if "xarray" in sys.modules:
        register()
    else:
        sys.meta_path.insert(0, _Finder())
