"""Three-dimensional views of poses, runs and maps: in a file, a notebook or the browser."""

from __future__ import annotations

import sys
import tempfile
import webbrowser
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from ...errors import RockerbogieError
from ...files.outputs import check_outputs
from ...rover.model import Rover
from ...settling.pose import Pose
from ...terrain.heightfield import Terrain
from .replay import TRIANGLES, page

if TYPE_CHECKING:
    import xarray as xr

    from ...motion.path_files import Route
    from ...statics.climb import Climb

#: Height of a view in a notebook, px.
HEIGHT = 560
_ENDINGS = (".html", ".htm")


def to_html(
    subject: Pose | Climb | xr.Dataset, file: str | Path, *, rover: Rover | None = None, terrain: Terrain | None = None,
    route: Route | None = None, title: str | None = None, triangles: int = TRIANGLES, force: bool = False,
) -> Path:  # fmt: skip
    """Write one self-contained page that shows a pose, a run or a map offline in any browser.

    Args:
        subject: from `settle`, `drive`, `simulate`, `climb`, `traversability` or `read_map`.
        file: the page, ending in .html.
        rover: of a run that was read from a file.
        terrain: of a run that was read from a file, or under a map (without it, the map is flat).
        route: from `plan`, drawn over a map.
        title: default: the names of rover and terrain.
        triangles: greatest number of triangles of the terrain; beyond it, only every k-th node is drawn.
        force: replace a file that this package did not write.

    Returns:
        The file.

    Raises:
        RockerbogieError: nothing that can be shown, another ending, or a file that cannot be written.
    """
    path = check_page(file)
    check_outputs([path], force=force)
    text = page(subject, rover=rover, terrain=terrain, route=route, title=title, triangles=triangles)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def check_page(file: str | Path) -> Path:
    """Check the name of a page.

    Args:
        file: its name.

    Returns:
        The path.

    Raises:
        RockerbogieError: another ending than .html.
    """
    path = Path(file)
    if path.suffix.lower() not in _ENDINGS:
        raise RockerbogieError(f"{str(file)!r} is not the name of a page: end it in .html")
    return path


@dataclass(frozen=True, repr=False)
class View:
    """A page that shows itself in a notebook.

    `html` is the whole page; `file` is the temporary file that was opened in the browser, or None in a notebook.
    """

    html: str
    file: Path | None = None

    def __repr__(self) -> str:
        where = "" if self.file is None else f", opened as {self.file}"
        return f"<View: a page of {len(self.html) / 1e6:.1f} MB{where}>"

    def _repr_html_(self) -> str:
        """Return the frame that a notebook shows."""
        style = f"width:100%;height:{HEIGHT}px;border:1px solid #8884;border-radius:6px"
        return f'<iframe srcdoc="{escape(self.html)}" style="{style}" sandbox="allow-scripts" title="rockerbogie"></iframe>'


def show(
    subject: Pose | Climb | xr.Dataset, *, rover: Rover | None = None, terrain: Terrain | None = None, route: Route | None = None,
    title: str | None = None, triangles: int = TRIANGLES,
) -> View:  # fmt: skip
    """Show a pose, a run or a map in three dimensions: in the notebook, or else in the browser.

    Outside a notebook, a temporary HTML file is written and opened. It is not deleted.

    Args:
        subject: from `settle`, `drive`, `simulate`, `climb`, `traversability` or `read_map`.
        rover: of a run that was read from a file.
        terrain: of a run that was read from a file, or under a map (without it, the map is flat).
        route: from `plan`, drawn over a map.
        title: default: the names of rover and terrain.
        triangles: greatest number of triangles of the terrain.

    Returns:
        The view; a notebook shows it if it is the last value of a cell.

    Raises:
        RockerbogieError: nothing that can be shown.
    """
    text = page(subject, rover=rover, terrain=terrain, route=route, title=title, triangles=triangles)
    if in_notebook():
        return View(text)
    with tempfile.NamedTemporaryFile("w", suffix=".html", prefix="rockerbogie-", delete=False, encoding="utf-8") as stream:
        stream.write(text)
    path = Path(stream.name)
    webbrowser.open(path.as_uri())
    return View(text, path)


def in_notebook() -> bool:
    """Return True in a Jupyter kernel.

    Returns:
        True if IPython runs with a kernel.
    """
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and hasattr(shell, "kernel")
