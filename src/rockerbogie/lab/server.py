"""Server of the page: sessions of visitors, limits on uploads, address and port."""

from __future__ import annotations

import contextlib
import http
import socket
import threading
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from .._kernels.jit.uncompiled import compile_first
from ..errors import RockerbogieError, require
from ..gravity import GRAVITY, check_gravity
from ..logs.live_pose import LivePose
from ..motion.drive import drive
from ..motion.path import Path
from ..rover.model import Rover
from ..settling.settle import settle
from ..terrain.heightfield import Terrain
from .context import Lab
from .index_page import with_script
from .live_panel import hand_over
from .readings import measure
from .state import start_position
from .style import BRAND
from .uploads import MOST_BYTES

if TYPE_CHECKING:
    import viser
    import xarray as xr


LOOPBACK = ("127.0.0.1", "localhost", "::1")
#: Names by which a browser on this machine may address the page.
_LOCAL_NAMES = frozenset({"127.0.0.1", "localhost", "[::1]"})
#: Paths of the page.
_INDEX = ("/", "/index.html")
#: First port that is tried, and how many after it.
PORT, PORTS = 8080, 20


def start_lab(
    rover: Rover,
    terrain: Terrain,
    *,
    maps: xr.Dataset | None = None,
    run: xr.Dataset | None = None,
    gravity: float = GRAVITY["earth"],
    host: str = "127.0.0.1",
    port: int | None = None,
    light: bool = False,
    live: Iterable[LivePose] | None = None,
) -> Lab:
    """Start the page and return at once.

    Args:
        rover: with which each visitor begins.
        terrain: likewise.
        maps: map of the terrain, from `traversability`.
        run: run of this rover on this terrain.
        gravity: m/s².
        host: address to listen at. The default is this machine only.
        port: None: the first free one from 8080.
        light: draw without shadows and with a coarser terrain, for browsers without a graphics card.
        live: poses of a running robot, which the rover tracks; it ends with its source.

    Returns:
        The lab; `stop` ends it.

    Raises:
        RockerbogieError: gravity is not from 0.001 to 100; viser is not installed; the address or port cannot be used.
    """
    require("the page", "lab", "viser", "trimesh")
    free = free_port(host, port)
    lab = Lab(rover, terrain, maps, run, check_gravity(gravity), (*start_position(terrain), 0.0), light, live=live)
    warm_up(lab)
    lab.server = _make_server(host, free)
    _decorate(lab)
    if live is not None:
        threading.Thread(target=hand_over, args=(live, lab.sessions), daemon=True, name="lab-live").start()
    return lab


def warm_up(lab: Lab) -> None:
    """Load or compile the kernels that the page uses, before the first visitor waits for them.

    Args:
        lab: the lab.
    """
    with compile_first():
        for mode in ("contact", "equilibrium"):
            pose = settle(lab.rover, lab.terrain, *lab.start, mode=mode)
            measure(pose)
            _ = pose.clearance, pose.contacts
    with compile_first(), contextlib.suppress(RockerbogieError):  # a start without terrain around it cannot be driven
        drive(lab.rover, lab.terrain, Path.straight(lab.start[:2], lab.start[2], 0.05), step=0.05)


def free_port(host: str, port: int | None) -> int:
    """Return a port that can be bound.

    Args:
        host: address.
        port: the only one to try; None: the first free one from 8080.

    Returns:
        The port.

    Raises:
        RockerbogieError: the address is not one of this machine, or no port is free.
    """
    if port is not None and not 0 < port < 65536:
        raise RockerbogieError(f"--port {port} is not a port: give a number from 1 to 65535")
    tried = range(PORT, PORT + PORTS) if port is None else [port]
    for one in tried:
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, one, type=socket.SOCK_STREAM)[0]
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                probe.bind(address)
            return int(one)
        except socket.gaierror:
            raise RockerbogieError(f"--host {host!r} is not an address: give 127.0.0.1, 0.0.0.0 or one of this machine") from None
        except OSError as error:
            if error.errno in (99, 49):  # address not available, on Linux and macOS
                raise RockerbogieError(f"--host {host!r} is not an address of this machine: give 127.0.0.1 or 0.0.0.0") from None
    if port is None:
        raise RockerbogieError(f"no port from {PORT} to {PORT + PORTS - 1} is free: give one with --port")
    raise RockerbogieError(f"port {port} is in use or not allowed: give another with --port, or none for the first free one")


def same_site(host: str, origin: str | None, local: bool) -> bool:
    """Return True if a request comes from the page itself.

    A browser sends `Origin` with every WebSocket. Without this check, any page that a visitor has open could control the lab.
    The check of `Host` prevents that a foreign name is resolved to this machine (DNS rebinding).

    Args:
        host: header `Host`.
        origin: header `Origin`, None without one.
        local: True if the server listens on loopback only.

    Returns:
        True if the origin is the page's own, and on loopback the host is a name of this machine.
    """
    name = host.rsplit(":", 1)[0] if not host.endswith("]") else host
    if local and name not in _LOCAL_NAMES:
        return False
    return origin is None or urlsplit(origin).netloc == host


def _make_server(host: str, port: int) -> viser.ViserServer:
    """Start viser's server with a check of each request and without its share link."""
    import viser
    import websockets.asyncio.server
    from websockets.datastructures import Headers
    from websockets.http11 import Response

    local = host in LOOPBACK
    serve = websockets.asyncio.server.serve

    def guarded(*args: Any, process_request: Any, **more: Any) -> Any:
        def check(connection: Any, request: Any) -> Any:
            if not same_site(request.headers.get("Host", ""), request.headers.get("Origin"), local):
                return Response(http.HTTPStatus.FORBIDDEN, "FORBIDDEN", Headers(), b"this address is not the page's own\n")
            response = process_request(connection, request)
            if response is not None and response.status_code == http.HTTPStatus.OK and urlsplit(request.path).path in _INDEX:
                response.body = with_script(response.body, response.headers.get("Content-Encoding", "identity"))
                del response.headers["Content-Length"]
                response.headers["Content-Length"] = str(len(response.body))
            return response

        return serve(*args, process_request=check, **more)

    with _STARTING:
        websockets.asyncio.server.serve = guarded
        try:
            with contextlib.redirect_stdout(None):
                server = viser.ViserServer(host=host, port=port, label="rocker-bogie lab", verbose=False)
        finally:
            websockets.asyncio.server.serve = serve
    server.request_share_url = lambda verbose=True: None  # never open a tunnel through a third party
    return server


_STARTING = threading.Lock()
#: Item of the browser's storage in which `page.js` leaves what draws, and the time to wait for it, s.
RENDERER, ANSWER = "renderer", 3.0
#: Intensity of the light from the sky.
SKY = 2.5


def _decorate(lab: Lab) -> None:
    """Set the theme, and open and close sessions with their visitors."""
    from .session import Session

    server = lab.server
    server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large", brand_color=BRAND)
    server.gui.main_panel.dock_right()
    server.scene.world_axes.visible = False
    # an environment map would cost a browser without a graphics card as much as all the rest
    server.scene.configure_environment_map(hdri=None)
    server.scene.add_light_hemisphere("/sky", sky_color=(255, 255, 255), ground_color=(190, 170, 150), intensity=SKY)

    def enter(client: viser.ClientHandle) -> None:
        """Open a visitor's session, which draws the scene and the panels and starts its thread."""
        limit_uploads(client, lambda text: client.add_notification("File not read", text, color="red"))
        session = Session(lab, client, draws_on_processor(client))
        lab.sessions[client.client_id] = session
        if client.client_id not in server.get_clients():  # left while the session was made
            lab.close(client.client_id)

    server.on_client_connect(enter)
    server.on_client_disconnect(lambda client: lab.close(client.client_id))


def draws_on_processor(client: viser.ClientHandle) -> bool:
    """Return True if a visitor's browser has no graphics card.

    Args:
        client: the visitor.

    Returns:
        True if `page.js` has found a renderer in software; False without an answer within `ANSWER`.
    """
    try:
        return bool(client.local_storage.get_item(RENDERER, ANSWER) == "processor")
    except (RuntimeError, TimeoutError):  # blocked by the browser, or left
        return False


def limit_uploads(client: viser.ClientHandle, refuse: Callable[[str], Any]) -> None:
    """Refuse files above `MOST_BYTES`, and parts beyond the announced size.

    Args:
        client: the visitor.
        refuse: called with the reason.
    """
    from viser import _messages

    gui, connection = client.gui, client.gui._websock_interface

    def start(number: Any, message: Any) -> None:
        if message.size_bytes > MOST_BYTES or message.part_count > MOST_BYTES // 1024:
            refuse(f"{message.size_bytes / 1e6:.0f} MB are more than the limit of {MOST_BYTES / 1e6:.0f} MB")
            return
        gui._handle_file_transfer_start(number, message)

    def part(number: Any, message: Any) -> None:
        state = gui._current_file_upload_states.get(message.transfer_uuid)
        if state is not None and state["transferred_bytes"] + len(message.content) > state["total_bytes"]:
            gui._current_file_upload_states.pop(message.transfer_uuid, None)
            refuse("the file is longer than its announced size")
            return
        gui._handle_file_transfer_part(number, message)

    for kind, own, guarded in (
        (_messages.FileTransferStartUpload, gui._handle_file_transfer_start, start),
        (_messages.FileTransferPart, gui._handle_file_transfer_part, part),
    ):
        connection.unregister_handler(kind, own)
        connection.register_handler(kind, guarded)
