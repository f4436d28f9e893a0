"""Scene with which visitors begin, and what panels use of a visitor's session."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Awaitable, Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from ..gravity import GRAVITY
from ..rover.model import Rover
from ..terrain.heightfield import Terrain
from .forces_view import ForcesView
from .rover_view import RoverView
from .state import LabState
from .terrain_view import TerrainView

if TYPE_CHECKING:
    import viser
    import xarray as xr


@dataclass
class Lab:
    """Scene with which each visitor begins, and the sessions of the visitors."""

    rover: Rover
    terrain: Terrain
    maps: xr.Dataset | None = None
    run: xr.Dataset | None = None
    gravity: float = GRAVITY["earth"]
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    light: bool = False
    live: Iterable[Any] | None = None  # poses of a running robot
    sessions: dict[int, Any] = field(default_factory=dict)
    server: Any = None
    _heavy: threading.Semaphore = field(default_factory=lambda: threading.Semaphore(1))

    @contextlib.contextmanager
    def heavy(self) -> Iterator[None]:
        """Hold the right to a long computation: one at a time for all visitors.

        Returns:
            The context.
        """
        with self._heavy:
            yield

    @property
    def url(self) -> str:
        """Address of the page for a browser on this machine."""
        host = self.server.get_host()
        name = "127.0.0.1" if host in ("0.0.0.0", "::") else host
        return f"http://{f'[{name}]' if ':' in name else name}:{self.server.get_port()}"

    def close(self, number: int) -> None:
        """End the session of a visitor who has left.

        Args:
            number: viser's number of the visitor.
        """
        session = self.sessions.pop(number, None)
        if session is not None:
            session.close()

    def stop(self) -> None:
        """End all sessions and the server."""
        for number in list(self.sessions):
            self.close(number)
        self.server.stop()


class Visit(Protocol):
    """Session of one visitor as its panels use it."""

    lab: Lab
    client: viser.ClientHandle
    state: LabState
    maps: xr.Dataset | None
    colour: str
    light: bool
    ghost: RoverView
    terrain_view: TerrainView
    forces: ForcesView
    drive_panel: Any

    @property
    def closed(self) -> bool:
        """True after the visitor has left."""

    def later(self, action: Callable[[], None], key: Any = None) -> None:
        """Run an action on the session's thread.

        Args:
            action: takes nothing.
            key: a later action with the same key replaces this one.
        """

    def leave(self) -> None:
        """Leave the run and the robot: the rover stays where it is, free to be moved."""

    def callback(self, action: Callable[[Any], Any], key: Any = None) -> Callable[[Any], Awaitable[None]]:
        """Return a callback for viser that hands an action over.

        Args:
            action: takes the value that the visitor gave to the control; None for a key.
            key: as `later`.

        Returns:
            The callback.
        """

    def notify(self, title: str, text: str, colour: Any = "blue") -> None:
        """Show a message in the page.

        Args:
            title: its heading.
            text: one or two sentences.
            colour: red for errors.
        """

    def redraw(self) -> None:
        """Draw at the next frame."""

    def show_rover(self) -> None:
        """Build the meshes of the rover."""

    def show_terrain(self) -> None:
        """Build the meshes of the terrain."""

    def look(self) -> None:
        """Turn the camera to the rover."""
