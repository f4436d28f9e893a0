"""Gravity at the surface of planets, and its check."""

from __future__ import annotations

from .arrays import is_number
from .errors import RockerbogieError

#: Gravity at the surface, m/s²: the standard value on Earth, mean values on Mars and the Moon.
GRAVITY = {"earth": 9.80665, "mars": 3.72076, "moon": 1.62}
#: Least and largest gravity, m/s²: Phobos has 0.006, Jupiter 25. Values in mm/s² or cm/s² are larger.
LEAST, LARGEST = 1e-3, 100.0


def check_gravity(gravity: float) -> float:
    """Return gravity after a check.

    Args:
        gravity: m/s².

    Returns:
        The same, as a float.

    Raises:
        RockerbogieError: not a number from 0.001 to 100.
    """
    if not (is_number(gravity) and LEAST <= gravity <= LARGEST):
        shown = f"{gravity:g} m/s²" if is_number(gravity) else f"{gravity!r:.60}"
        hint = " (is it in mm/s²?)" if is_number(gravity) and gravity > LARGEST else ""
        raise RockerbogieError(
            f"gravity is {shown}{hint}; give {LEAST:g} to {LARGEST:g} m/s², such as rockerbogie.GRAVITY['mars']"
        )
    return float(gravity)
