"""Parser for XML from unknown sources.

It accepts no entities and no document types, and limits depth and size.
"""

from __future__ import annotations

import math
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ...errors import RoverError

MAX_BYTES = 20_000_000
MAX_DEPTH = 200
MAX_ELEMENTS = 200_000
#: Most numbers in one attribute or element (a differential's coefficients); a longer list is not read.
MAX_NUMBERS = 24
#: Largest length, mass, moment or angle that is read (SI).
LARGEST = 1e9


def parse_xml(data: bytes | str, what: str) -> Element:
    """Return the root element of an XML text.

    Args:
        data: the text; the encoding of bytes is the declared one.
        what: the file's name, for messages.

    Returns:
        The root element.

    Raises:
        RoverError: not well-formed, too large or too deep, or with a document type (where entities are declared).
    """
    raw = data.encode() if isinstance(data, str) else data
    if len(raw) > MAX_BYTES:
        raise RoverError(
            f"{what}: {len(raw) / 1e6:.0f} MB of XML; a rover takes well under one, the limit is {MAX_BYTES / 1e6:.0f} MB"
        )
    builder = TreeBuilder()
    depth = count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if depth > MAX_DEPTH or count > MAX_ELEMENTS:
            raise RoverError(f"{what}: XML nested deeper than {MAX_DEPTH} or with more than {MAX_ELEMENTS} elements is refused")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: object) -> None:
        raise RoverError(
            f"{what}: it declares a document type or entities, which a robot file does not need: remove the <!DOCTYPE ...>"
        )

    parser = expat.ParserCreate("utf-8" if isinstance(data, str) else None)
    parser.StartElementHandler, parser.EndElementHandler, parser.CharacterDataHandler = start, end, builder.data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(raw, True)
    except (expat.ExpatError, LookupError, ValueError) as error:
        if isinstance(error, RoverError):
            raise
        raise RoverError(f"{what}: not well-formed XML: {error}") from None
    return builder.close()


def numbers(
    text: str | None, count: int, where: str, default: tuple[float, ...] | None = None, *, finite: bool = True
) -> tuple[float, ...]:
    """Return numbers from an attribute or an element's text.

    Args:
        text: the attribute or text; None or blank if there is none.
        count: how many numbers it must hold.
        where: file and element, for messages.
        default: returned if there is no text; None: the text is required.
        finite: if False, numbers may be infinite or above `LARGEST`, as limits are; NaN is refused.

    Returns:
        `count` numbers, or the default.

    Raises:
        RoverError: missing without a default, not that many numbers, or not finite.
    """
    if text is None or not text.strip():
        if default is None:
            raise RoverError(f"{where} is missing; it takes {count} number{'s' * (count > 1)}")
        return default
    words = text.split(maxsplit=MAX_NUMBERS + 1)
    try:
        values = tuple(float(w) for w in words if "_" not in w)  # float() reads 1_0 as ten
    except ValueError:
        values = ()
    good = all(abs(v) <= LARGEST or (not finite and not math.isnan(v)) for v in values)
    if len(words) != count or len(values) != count or not good:
        raise RoverError(
            f"{where} is {text.strip()[:60]!r}; it takes {count} finite number{'s' * (count > 1)}, {LARGEST:g} at most"
        )
    return values
