"""Measurements of `rockerbogie lab`: its server without browsers, its page in Chromium.

python tools/lab_load.py drag            settled poses per second received during a drag, and the server's time per pose
python tools/lab_load.py open            time until a 2,000 x 2,000 terrain has arrived at a visitor
python tools/lab_load.py visitors 600    ten visitors that drag, leave and return, for so many seconds: memory per wave

With `tests` on PYTHONPATH, in headless Chromium without a graphics card:
python tools/lab_load.py painted [1280x800]   settled poses per second painted during a drag
python tools/lab_load.py painted-open         time until a 2,000 x 2,000 terrain is painted, and poses per second on it

Each of these states the share of the machine's processors that other programs used meanwhile.
"""

from __future__ import annotations

import asyncio
import gc
import json
import os
import sys
import time
from typing import Any

import msgspec.msgpack
import numpy as np
import websockets
import zstandard

import rockerbogie as rb
from rockerbogie.lab.server import start_lab

VISITORS = 10
#: Pointer messages per second, as the browser sends them.
RATE = 20.0
#: Time for which ten visitors drag and then look, s, before they leave.
DRAG, PAUSE = 4.0, 5.0


class Visitor:
    """Connection of one visitor, with counts of what arrives."""

    def __init__(self, url: str) -> None:
        self.url = url.replace("http", "ws")
        self.poses = self.bytes = 0
        self.numbers = ""
        self.nodes: set[str] = set()
        self.last = 0.0

    async def __aenter__(self) -> Visitor:
        import viser

        origin = self.url.replace("ws", "http")
        protocol = websockets.Subprotocol(f"viser-v{viser.__version__}")
        self.socket = await websockets.connect(self.url, subprotocols=[protocol], max_size=None, origin=websockets.Origin(origin))
        self.reader = asyncio.create_task(self._read())
        await self.send(
            type="ViewerCameraMessage", wxyz=(1.0, 0, 0, 0), position=(3.0, 3, 3), fov=0.9, near=0.01, far=100.0,
            image_height=600, image_width=800, look_at=(0.0, 0, 0), up_direction=(0.0, 0, 1),
        )  # fmt: skip
        return self

    async def __aexit__(self, *_: Any) -> None:
        await self.socket.close()
        self.reader.cancel()

    async def send(self, **message: Any) -> None:
        await self.socket.send(msgspec.msgpack.encode(message))

    async def _read(self) -> None:
        unpack = zstandard.ZstdDecompressor()
        async for raw in self.socket:
            packed = int.from_bytes(raw[8:16], "little")
            messages = msgspec.msgpack.decode(unpack.decompress(raw[16 : 16 + packed]))["messages"]
            self.bytes += len(raw)
            self.last = time.perf_counter()
            for message in messages:
                kind, name = message["type"], message.get("name", "")
                if kind == "LocalStorageGetItemRequestMessage":
                    uuid = message["request_uuid"]
                    await self.send(type="LocalStorageGetItemResponseMessage", value="card", error=None, request_uuid=uuid)
                self.poses += kind == "SetPositionMessage" and name == "/rover/body"
                if kind in ("GlbMessage", "MeshMessage"):
                    self.nodes.add(name)
                if kind == "GuiUpdateMessage" and 'data-key="roll"' in str(message.get("updates", "")):
                    self.numbers = str(message["updates"])

    async def drag(self, session: Any, seconds: float, radius: float) -> None:
        """Drag the rover in a circle, at the browser's rate."""
        begin = time.perf_counter()
        z = float(session.state.pose.z) - float(session.terrain_view.offset[2])
        phase = "start"
        while (spent := time.perf_counter() - begin) < seconds:
            point = (radius * np.cos(spent) - radius, radius * np.sin(spent), z)
            await self.send(
                type="SceneNodeDragMessage", phase=phase, name="/rover/body/body", instance_index=None,
                start_position=(0.0, 0.0, z), start_screen_pos=(0.5, 0.5), end_position=tuple(map(float, point)),
                end_screen_pos=(0.5, 0.5), button="left", modifier=None, owner=str(session.client.client_id),
            )  # fmt: skip
            phase = "update"
            await asyncio.sleep(1 / RATE)


async def until(condition: Any, patience: float = 120.0) -> None:
    """Wait until a condition is true."""
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError
        await asyncio.sleep(0.02)


async def measure_drag() -> dict[str, Any]:
    """Measure one visitor's drag of Curiosity over a surface like Mars."""
    lab = start_lab(rb.load_rover("curiosity"), rb.surfaces.mars(seed=1))
    async with Visitor(lab.url) as visitor:
        await until(lambda: lab.sessions and visitor.numbers)
        session = next(iter(lab.sessions.values()))
        await visitor.drag(session, 2.0, 1.5)
        times: list[float] = []
        work: list[float] = []
        draw = session.draw

        def timed() -> None:
            began, worked = time.perf_counter(), time.thread_time()
            session.state.settle()  # the settle of this frame again, so that its time counts
            draw()
            times.append(time.perf_counter() - began)
            work.append(time.thread_time() - worked)

        session.draw = timed
        before, began = visitor.poses, time.perf_counter()
        await visitor.drag(session, 10.0, 1.5)
        rate = (visitor.poses - before) / (time.perf_counter() - began)
    lab.stop()
    ms = 1e3 * np.array(times)
    return {
        "settled poses per second": rate, "server ms per pose, median": float(np.median(ms)),
        "of these on the processor, mean": float(1e3 * np.mean(work)),
        "server ms per pose, 95 %": float(np.percentile(ms, 95)),
        "frames": len(ms),
    }  # fmt: skip


async def measure_open() -> dict[str, Any]:
    """Measure the time until a terrain of 2,000 by 2,000 nodes has arrived."""
    terrain = rb.surfaces.fractal(size=199.9, spacing=0.1, seed=2)
    lab = start_lab(rb.load_rover("curiosity"), terrain)
    began = time.perf_counter()
    async with Visitor(lab.url) as visitor:
        await until(lambda: lab.sessions and visitor.numbers)
        session = next(iter(lab.sessions.values()))
        await until(
            lambda: len([n for n in visitor.nodes if n.startswith("/terrain/coarse")]) == len(session.terrain_view._tiles)
        )
        await asyncio.sleep(1.0)
        spent = visitor.last - began
        note, count, size = session.terrain_view.note, len(session.terrain_view._tiles), visitor.bytes
    lab.stop()
    return {"nodes": terrain.z.shape, "seconds": spent, "MB sent": size / 1e6, "tiles": count, "note": note}


#: Counts pictures, and pictures that show a new pose of the body.
COUNT = """() => {
  const view = window.__viserMutable, before = view.scene.onAfterRender, count = window.count = { pictures: 0, poses: 0 };
  let last = "";
  view.scene.onAfterRender = (...all) => {
    before(...all);
    const now = view.nodeRefFromName["/rover/body"].matrixWorld.elements.map((v) => v.toFixed(7)).join();
    count.pictures += 1;
    count.poses += now !== last;
    last = now;
  };
}"""
#: Drags the rover in a circle, with one event per picture as a browser sends them.
DRAG_THERE = """([x, y]) => {
  const canvas = window.__viserMutable.canvas, begun = performance.now();
  const send = (kind, x, y) => canvas.dispatchEvent(new PointerEvent(kind, {
    clientX: x, clientY: y, bubbles: true, pointerId: 1, pointerType: "mouse", isPrimary: true, buttons: 1,
    button: kind === "pointermove" ? -1 : 0 }));
  const move = () => {
    const angle = 0.0015 * (performance.now() - begun);
    send("pointermove", x + 60 * Math.sin(angle), y + 30 * (1 - Math.cos(angle)));
    requestAnimationFrame(move);
  };
  send("pointerdown", x, y);
  move();
}"""
#: True once so many meshes of terrain are in the scene and a picture with them is drawn.
PAINTED = """(meshes) => {
  const view = window.__viserMutable, nodes = view ? view.nodeRefFromName : {};
  const drawn = (name) => { let found = false; nodes[name].traverse((o) => { found ||= Boolean(o.isMesh); }); return found; };
  const ready = Object.keys(nodes).filter((name) => /^.terrain.(coarse|light)/.test(name) && nodes[name] && drawn(name));
  if (ready.length < meshes) return false;
  if (window.wanted === undefined) window.wanted = window.__viserTestpoints.rendererInfo.render.frame + 1;
  return window.__viserTestpoints.rendererInfo.render.frame > window.wanted;
}"""


def processors() -> tuple[float, float]:
    """Return the processor time used by this process with its children, and by all, s."""

    def tree(pid: int) -> list[int]:
        with open(f"/proc/{pid}/task/{pid}/children") as file:
            return [pid, *(p for child in file.read().split() for p in tree(int(child)))]

    own = 0
    for pid in tree(os.getpid()):
        with open(f"/proc/{pid}/stat") as file:
            own += sum(map(int, file.read().rpartition(")")[2].split()[11:13]))
    with open("/proc/stat") as file:
        user, nice, system, _, _, irq, soft, steal = map(int, file.readline().split()[1:9])
    tick = os.sysconf("SC_CLK_TCK")
    return own / tick, (user + nice + system + irq + soft + steal) / tick


def drag_painted(page: Any, session: Any, seconds: float) -> dict[str, Any]:
    """Drag the rover in an open page, and count what is painted."""
    from support.browser import close_notes, pixel_of

    time.sleep(3.0)
    close_notes(page)
    state = session.state
    start = pixel_of(page, session, (state.x, state.y, float(state.pose.z) + 0.75 * float(state.rover.rocker_pivot[0, 2])))
    page.evaluate(COUNT)
    page.evaluate(DRAG_THERE, [float(v) for v in start])
    time.sleep(2.0)
    frames, count, (own, every), began = (
        session.frames,
        page.evaluate("() => ({...window.count})"),
        processors(),
        time.perf_counter(),
    )
    time.sleep(seconds)
    now, (own_now, every_now), spent = page.evaluate("() => ({...window.count})"), processors(), time.perf_counter() - began
    poses = now["poses"] - count["poses"]
    return {
        "poses painted per second": poses / spent, "pictures per second": (now["pictures"] - count["pictures"]) / spent,
        "poses sent per second": (session.frames - frames) / spent, "light drawing": session.light,
        "processor ms per pose painted": 1e3 * (own_now - own) / max(poses, 1),
        "processors used by other programs": (every_now - every - own_now + own) / spent, "of": os.cpu_count(),
    }  # fmt: skip


def measure_painted(size: str) -> dict[str, Any]:
    """Drag the Open Source Rover over rocks in Chromium."""
    from support.browser import chromium, open_page

    width, height = map(int, size.split("x"))
    lab = start_lab(rb.load_rover("osr"), rb.surfaces.rocks())
    with chromium() as browser:
        page = open_page(browser, lab.url, (width, height))
        found = drag_painted(page, next(iter(lab.sessions.values())), 8.0)
    lab.stop()
    return found


def measure_painted_open() -> dict[str, Any]:
    """Open a terrain of 2,000 by 2,000 nodes in Chromium, and drag a rover on it."""
    import rockerbogie.lab.server as server
    from support.browser import chromium

    found = {}
    for light in (True, False):
        server.draws_on_processor = lambda client, light=light: light
        lab = start_lab(rb.load_rover("curiosity"), rb.surfaces.fractal(size=199.9, spacing=0.1, seed=2))
        with chromium() as browser:
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.set_default_timeout(180_000)
            began = time.perf_counter()
            page.goto(lab.url)
            page.wait_for_selector('[data-key="roll"]', state="attached")
            numbers = time.perf_counter() - began
            session = next(iter(lab.sessions.values()))
            page.wait_for_function(PAINTED, arg=max(1, len(session.terrain_view._tiles)))
            spent = time.perf_counter() - began
            dragged = drag_painted(page, session, 6.0)
            found["light" if light else "full"] = {"seconds until numbers": numbers, "seconds until painted": spent} | dragged
        lab.stop()
    return found


def memory() -> float:
    """Return the resident memory of this process, MB."""
    gc.collect()
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * 4096 / 1e6


async def measure_visitors(seconds: float) -> dict[str, Any]:
    """Let ten visitors drag, leave and return; record memory, sessions and cross-talk."""
    lab = start_lab(rb.load_rover("osr"), rb.surfaces.rocks(k=0.1, seed=3, size=6.0))
    end, waves, mixed, poses = time.monotonic() + seconds, [], 0, 0
    while time.monotonic() < end:
        visitors = [await Visitor(lab.url).__aenter__() for _ in range(VISITORS)]
        await until(lambda: len(lab.sessions) == VISITORS)
        await until(lambda visitors=visitors: all(v.numbers for v in visitors))
        sessions = [lab.sessions[k] for k in sorted(lab.sessions)]
        for k, session in enumerate(sessions):
            session.later(lambda session=session, k=k: session.state.move(0.1 * k, -0.1 * k, 0.2 * k))
        await asyncio.sleep(1.0)
        mixed += sum(abs(s.state.x - 0.1 * k) > 1e-12 for k, s in enumerate(sessions))
        await asyncio.gather(*(v.drag(s, DRAG, 0.02 * (k + 1)) for k, (v, s) in enumerate(zip(visitors, sessions, strict=True))))
        await asyncio.sleep(PAUSE)
        for session in sessions:
            state = session.state
            alone = rb.settle(state.rover, state.terrain, state.x, state.y, state.yaw)
            mixed += not np.array_equal(alone.q, state.pose.q)
        poses += sum(v.poses for v in visitors)
        for visitor in visitors:
            await visitor.__aexit__()
        await until(lambda: not lab.sessions)
        for session in sessions:
            session.join(10.0)
        alive = sum(s._thread.is_alive() for s in sessions)
        del sessions, session, visitors, visitor
        waves.append(round(memory(), 1))
        print(f"wave {len(waves)}: {waves[-1]} MB, threads alive {alive}", file=sys.stderr, flush=True)
    lab.stop()
    third = waves[len(waves) // 3]
    return {"waves MB": waves, "growth from a third on, %": 100 * (waves[-1] / third - 1), "mixed": mixed, "poses": poses}


def main() -> None:
    """Run one measurement and print it as JSON."""
    what, *more = sys.argv[1:] or ["drag"]
    if what in ("painted", "painted-open"):
        found = measure_painted(*(more or ["1280x800"])) if what == "painted" else measure_painted_open()
    else:
        seconds = float(more[0]) if more else 600.0
        work = {"drag": measure_drag, "open": measure_open, "visitors": lambda: measure_visitors(seconds)}[what]()  # type: ignore[operator]
        found = asyncio.run(work)
    print(json.dumps(found, indent=1, default=str))


if __name__ == "__main__":
    main()
