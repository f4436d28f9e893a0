"""Page of viser with a script for touch screens and for browsers without a graphics card."""

from __future__ import annotations

import gzip
from functools import lru_cache
from importlib.resources import files

#: Script of `page.js`, which runs before viser's own.
SCRIPT = b"<script>" + files(__package__).joinpath("page.js").read_bytes() + b"</script>"
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
