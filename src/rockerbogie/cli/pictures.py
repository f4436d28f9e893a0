"""Options of the commands for pictures, films and pages, their checks, and their writing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

from cyclopts import Parameter

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

    from ..settling.pose import Pose
    from ..statics.climb import Climb

Film = Annotated[Path | None, Parameter(name=["--film", "--video"])]
Html = Annotated[Path | None, Parameter(name="--html")]
Theme = Annotated[Literal["light", "dark"], Parameter(name="--theme")]
Format = Annotated[Literal["png", "svg", "pdf"], Parameter(name="--format")]


class Pictures(NamedTuple):
    """File format and theme of a command's pictures."""

    format: Literal["png", "svg", "pdf"]
    theme: Literal["light", "dark"]

    def name(self, stem: str) -> str:
        """Return the file name of a picture.

        Args:
            stem: name without ending.

        Returns:
            The name with the ending of the format.
        """
        return f"{stem}.{self.format}"

    def save(self, made: Figure, folder: Path, stem: str) -> Path:
        """Write a picture.

        Args:
            made: the figure.
            folder: an existing folder.
            stem: name without ending.

        Returns:
            The file.
        """
        from ..figures.style import save

        return save(made, folder / self.name(stem), theme=self.theme)


def checked_film(film: Path | None) -> list[Path]:
    """Return the film among the files to write, after a check of its name and libraries.

    Args:
        film: its name, or None.

    Returns:
        The film; an empty list for None.

    Raises:
        RockerbogieError: another ending than .gif or .mp4; PyAV not installed (.mp4).
    """
    if film is None:
        return []
    from ..figures.film import check_film

    check_film(film)
    return [film]


def checked_page(html: Path | None) -> list[Path]:
    """Return the page among the files to write, after a check of its name.

    Args:
        html: its name, or None.

    Returns:
        The page; an empty list for None.

    Raises:
        RockerbogieError: another ending than .html.
    """
    if html is None:
        return []
    from ..figures.scene.show import check_page

    return [check_page(html)]


def write_page(subject: Pose | Climb | xr.Dataset, html: Path | None, force: bool) -> list[Path]:
    """Write the page of a pose, a run or a climb.

    Args:
        subject: the pose, run or climb.
        html: the page, or None for no page.
        force: replace a file that this package did not write.

    Returns:
        The file; an empty list without a page.
    """
    if html is None:
        return []
    from ..figures.scene.show import to_html

    return [to_html(subject, html, force=force)]
