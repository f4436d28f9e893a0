"""Server of the page: who may connect and what may be sent; errors of the command."""

from __future__ import annotations

import base64
import gzip
import os
import socket
import urllib.request
from collections.abc import Iterator
from typing import Any

import pytest

pytest.importorskip("viser", reason="viser is not installed: pip install '.[lab]'")

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.lab.index_page import SCRIPT
from rockerbogie.lab.server import free_port, limit_uploads, same_site, start_lab
from rockerbogie.lab.uploads import MOST_BYTES
from support.patience import PATIENCE


@pytest.fixture(scope="module")
def lab() -> Iterator[Any]:
    lab = start_lab(rb.load_rover("osr"), rb.surfaces.plane(size=4.0))
    yield lab
    lab.stop()


def ask(lab: Any, host: str | None = None, origin: str | None = None, upgrade: bool = True, path: str = "/") -> str:
    """Send one request, and return the first line of the response."""
    port = lab.server.get_port()
    lines = [f"GET {path} HTTP/1.1", f"Host: {host or f'127.0.0.1:{port}'}"]
    if origin:
        lines.append(f"Origin: {origin}")
    if upgrade:
        key = base64.b64encode(os.urandom(16)).decode()
        lines += ["Upgrade: websocket", "Connection: Upgrade", f"Sec-WebSocket-Key: {key}", "Sec-WebSocket-Version: 13"]
    with socket.create_connection(("127.0.0.1", port), timeout=PATIENCE) as connection:
        connection.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        return connection.recv(200).decode(errors="replace").splitlines()[0]


def test_only_the_page_itself_may_connect(lab: Any) -> None:
    port = lab.server.get_port()
    assert " 101 " in ask(lab, origin=f"http://127.0.0.1:{port}")
    assert " 101 " in ask(lab, host=f"localhost:{port}", origin=f"http://localhost:{port}")
    for origin in ("http://evil.example", f"http://127.0.0.1:{port + 1}", "null"):
        assert " 403 " in ask(lab, origin=origin), origin
    assert " 403 " in ask(lab, host=f"evil.example:{port}", origin=f"http://evil.example:{port}")
    assert " 403 " in ask(lab, host="evil.example", upgrade=False)
    assert " 200 " in ask(lab, upgrade=False)


def test_the_page_has_the_script_in_each_encoding(lab: Any) -> None:
    for encoding in ("gzip", "identity"):
        request = urllib.request.Request(lab.url, headers={"Accept-Encoding": encoding})
        with urllib.request.urlopen(request, timeout=PATIENCE) as response:
            body = response.read()
            assert response.headers["Content-Encoding"] == encoding
        text = gzip.decompress(body) if encoding == "gzip" else body
        assert text.count(SCRIPT) == 1
        assert text.index(SCRIPT) < text.index(b"<script data-p"), "before viser's own script"


def test_no_file_of_the_machine_is_served(lab: Any) -> None:
    for path in ("/../../../../../../etc/passwd", "/%2e%2e/%2e%2e/%2e%2e/%2e%2e/etc/passwd", "/..%5c..%5cx"):
        assert " 404 " in ask(lab, upgrade=False, path=path)


@pytest.mark.parametrize(
    ("host", "origin", "local", "allowed"),
    [
        ("127.0.0.1:8080", "http://127.0.0.1:8080", True, True),
        ("[::1]:8080", "http://[::1]:8080", True, True),
        ("[::1]", None, True, True),
        ("rover.lan:8080", "http://rover.lan:8080", True, False),
        ("rover.lan:8080", "http://rover.lan:8080", False, True),
        ("rover.lan:8080", "http://other.lan:8080", False, False),
        ("", None, True, False),
    ],
)
def test_requests_of_other_sites_are_refused(host: str, origin: str | None, local: bool, allowed: bool) -> None:
    assert same_site(host, origin, local) is allowed


def test_the_page_listens_on_loopback_and_opens_no_tunnel(lab: Any) -> None:
    assert lab.server.get_host() == "127.0.0.1"
    assert lab.url == f"http://127.0.0.1:{lab.server.get_port()}"
    assert lab.server.request_share_url() is None
    addresses = {info[4][0] for info in socket.getaddrinfo(socket.gethostname(), None, socket.AF_INET)} - {
        "127.0.0.1",
        "127.0.1.1",
    }
    for address in addresses:
        with pytest.raises(OSError):
            socket.create_connection((address, lab.server.get_port()), timeout=2).close()


class Part:
    """Message of an upload."""

    def __init__(self, **fields: Any) -> None:
        self.__dict__ |= fields


class Gui:
    """Uploads of viser's GUI as far as `limit_uploads` uses them."""

    def __init__(self) -> None:
        self._websock_interface = self
        self._current_file_upload_states: dict[str, dict[str, int]] = {}
        self.handlers: dict[Any, Any] = {}
        self.started: list[Any] = []
        self.parts: list[Any] = []
        self.gui = self

    def unregister_handler(self, kind: Any, own: Any) -> None:
        assert own in (self._handle_file_transfer_start, self._handle_file_transfer_part)

    def register_handler(self, kind: Any, handler: Any) -> None:
        self.handlers[kind.__name__] = handler

    def _handle_file_transfer_start(self, number: int, message: Any) -> None:
        self.started.append(message)

    def _handle_file_transfer_part(self, number: int, message: Any) -> None:
        self.parts.append(message)


def test_large_uploads_are_refused_when_announced_and_when_they_grow() -> None:
    gui, reasons = Gui(), []
    limit_uploads(gui, reasons.append)  # type: ignore[arg-type]
    start, part = gui.handlers["FileTransferStartUpload"], gui.handlers["FileTransferPart"]
    start(0, Part(size_bytes=10, part_count=1))
    start(0, Part(size_bytes=MOST_BYTES + 1, part_count=1))
    start(0, Part(size_bytes=10, part_count=10**9))
    assert len(gui.started) == 1
    assert len(reasons) == 2
    gui._current_file_upload_states["a"] = {"transferred_bytes": 8, "total_bytes": 10}
    part(0, Part(transfer_uuid="a", content=b"xx"))
    part(0, Part(transfer_uuid="a", content=b"xxx"))
    assert len(gui.parts) == 1
    assert "a" not in gui._current_file_upload_states


def test_a_port_in_use_is_refused_and_the_default_takes_the_next(lab: Any) -> None:
    port = lab.server.get_port()
    with pytest.raises(rb.RockerbogieError, match="in use"):
        free_port("127.0.0.1", port)
    assert free_port("127.0.0.1", None) != port


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--host", "no.such.host.invalid"], "--host"),
        (["--host", "203.0.113.7"], "--host"),
        (["--port", "99999"], "--port"),
        (["--rover", "nonsense"], "rover"),
        (["--terrain", "nonsense.tif"], "nonsense.tif"),
        (["--map", "nonsense.nc"], "nonsense.nc"),
        (["--run", "nonsense.nc"], "nonsense.nc"),
        (["--gravity", "pluto"], "--gravity"),
    ],
)
def test_bad_input_gives_one_sentence(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lab", "--no-browser", *(["-t", "surface:plane"] if "--terrain" not in arguments else []), *arguments]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_a_missing_extra_is_one_sentence(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "viser", None)
    assert main(["lab", "--no-browser", "-t", "surface:plane"]) == 2
    assert "pip install 'rockerbogie[lab]'" in capsys.readouterr().err
