"""Contents of pictures that commands draw."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image


def count_colours(file: Path) -> int:
    """Return the number of different colours of a picture.

    Args:
        file: any picture that Pillow reads.
    """
    with Image.open(file) as image:
        rgb = np.asarray(image.convert("RGB"), dtype=np.uint32)
    return len(np.unique(rgb @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)))  # numbers sort faster than rows
