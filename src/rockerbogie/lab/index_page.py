"""Page of viser with a script for touch screens and for browsers without a graphics card."""

from __future__ import annotations

import gzip
from functools import lru_cache

#: Two corrections, before viser's own script runs:
#: 1. Browsers give a touch to the element that it begins on. viser takes that for a drag of its own and drops taps on the
#:    terrain, so the picture's touches are released.
#: 2. A browser that draws on the processor draws twice as many pictures per second without antialiasing.
SCRIPT = b"""<script>(() => {
  addEventListener("pointerdown", (event) => {
    const { target, pointerId, pointerType } = event;
    if (pointerType !== "touch" || !(target instanceof HTMLCanvasElement)) return;
    if (target.hasPointerCapture(pointerId)) target.releasePointerCapture(pointerId);
  }, true);
  const gl = document.createElement("canvas").getContext("webgl2");
  const info = gl && gl.getExtension("WEBGL_debug_renderer_info");
  const name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  if (!/swiftshader|llvmpipe|software|basic render/i.test(name)) return;
  const get = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return get.call(this, kind, kind.startsWith("webgl") ? { ...options, antialias: false } : options);
  };
})()</script>"""
_HEAD = b"<head>"


@lru_cache(maxsize=2)
def with_script(body: bytes, encoding: str) -> bytes:
    """Insert the script at the start of a page.

    Args:
        body: of the HTTP response.
        encoding: its header `Content-Encoding`: gzip or identity.

    Returns:
        The new body in the same encoding; unchanged without a head.
    """
    packed = encoding == "gzip"
    text = gzip.decompress(body) if packed else body
    text = text.replace(_HEAD, _HEAD + SCRIPT, 1)
    return gzip.compress(text) if packed else text
