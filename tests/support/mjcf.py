"""Loading of exported MJCF in a long process."""

from __future__ import annotations

from typing import Any

ROOM = [100_000] * 300  # bytes: blocks below malloc's limit for memory maps, 30 MB in all


def load_mjcf(text: str) -> Any:
    """Return MuJoCo's model of a text, also where the heap cannot grow in place.

    If the memory after the heap is taken, malloc finds other memory and leaves ENOMEM in errno. MuJoCo 4.0.0 then reports an
    "unknown error" of the number it reads. Blocks allocated and freed before give it memory, so that the second attempt succeeds.

    Args:
        text: the MJCF.

    Returns:
        The `mujoco.MjModel`.

    Raises:
        ValueError: MuJoCo refuses the text.
    """
    import mujoco

    try:
        return mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        if "unknown error in attribute" not in str(error):
            raise
    room = [bytes(size) for size in ROOM]
    del room
    return mujoco.MjModel.from_xml_string(text)
