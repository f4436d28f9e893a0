"""Tables of numbers in text files, with columns `name [unit]`."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import Array
from ..errors import RockerbogieError

#: Unit -> (quantity, factor to SI). Text is compared in lower case.
UNITS: dict[str, tuple[str, float]] = {
    "1": ("number", 1.0),
    "s": ("time", 1.0), "ms": ("time", 1e-3), "us": ("time", 1e-6), "ns": ("time", 1e-9), "min": ("time", 60.0),
    "m": ("length", 1.0), "mm": ("length", 1e-3), "cm": ("length", 1e-2), "km": ("length", 1e3),
    "rad": ("angle", 1.0), "mrad": ("angle", 1e-3), "deg": ("angle", np.pi / 180), "rev": ("angle", 2 * np.pi),
    "rad/s": ("angular rate", 1.0), "deg/s": ("angular rate", np.pi / 180), "rpm": ("angular rate", np.pi / 30),
    "rev/s": ("angular rate", 2 * np.pi), "m/s": ("speed", 1.0), "mm/s": ("speed", 1e-3), "cm/s": ("speed", 1e-2),
    "count": ("count", 1.0), "count/s": ("count rate", 1.0),
}  # fmt: skip
#: Other spellings of units.
SPELLINGS = {
    "second": "s", "seconds": "s", "sec": "s", "secs": "s", "millisecond": "ms", "milliseconds": "ms", "msec": "ms", "µs": "us",
    "μs": "us", "microseconds": "us", "usec": "us", "nanoseconds": "ns", "nsec": "ns", "minutes": "min",
    "meters": "m", "metres": "m", "meter": "m", "metre": "m", "millimeters": "mm", "millimetres": "mm", "kilometers": "km",
    "radians": "rad", "radian": "rad", "degrees": "deg", "degree": "deg", "°": "deg", "turns": "rev", "turn": "rev",
    "revolutions": "rev", "°/s": "deg/s", "degrees/s": "deg/s", "dps": "deg/s", "radians/s": "rad/s", "rad s-1": "rad/s",
    "degree/s": "deg/s", "rad.s-1": "rad/s", "m s-1": "m/s", "m.s-1": "m/s", "r/min": "rpm", "rps": "rev/s",
    "counts": "count", "ticks": "count", "tick": "count", "counts/s": "count/s", "ticks/s": "count/s",
}  # fmt: skip
HEADER = re.compile(r"^\s*(.+?)\s*(?:\[\s*([^\]]*?)\s*\])?\s*$")
ROUND_UNIT = re.compile(r"^(.+?)\s*\(([^()]*)\)$")
DECIMAL_COMMA = re.compile(r"^[+-]?\d*,\d+(?:[eE][+-]?\d+)?$")
SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
MISSING = ("", "nan", "null", "none", "na", "n/a")


def find_unit(text: str) -> tuple[str, float] | None:
    """Return the quantity and the factor to SI of a unit.

    Args:
        text: a unit in any of its spellings, such as "deg", "degrees" or "°".

    Returns:
        ("angle", 0.01745…) and so on; `None` if the unit is not in `UNITS`.
    """
    short = text.strip().lower()
    return UNITS.get(SPELLINGS.get(short, short))


class Table(Mapping[str, Array]):
    """Columns of a CSV file by name, in SI; each is converted when it is first used.

    Args:
        file: the file's name, for messages.
        names: column names without units.
        units: units as written; "" where the header has none.
        rows: cells of each row, as text.
        lines: line number of each row, for messages.
        notes: remarks on the file's form, such as its separators.
    """

    def __init__(
        self, file: str, names: list[str], units: list[str], rows: list[list[str]], lines: list[int], notes: list[str]
    ) -> None:
        self.file, self.names, self.units, self.rows, self.lines, self.notes = file, names, units, rows, lines, notes

    def __iter__(self) -> Iterator[str]:
        return iter(dict.fromkeys(self.names))

    def __len__(self) -> int:
        return len(set(self.names))

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __getitem__(self, name: str) -> Array:
        if name not in self.names:
            raise KeyError(name)
        return self.numbers(name)

    def find(self, name: str) -> int | None:
        """Return the index of a column.

        Args:
            name: its name, with or without the unit in brackets.

        Returns:
            The index; `None` if the file has no such column.

        Raises:
            RockerbogieError: two columns have that name.
        """
        bare, _ = _split_header(name)
        count = self.names.count(bare)
        if count > 1:
            raise RockerbogieError(f"{self.file} has {count} columns named {bare!r}: rename or delete all but one")
        return self.names.index(bare) if count else None

    def text(self, name: str) -> list[str]:
        """Return a column's cells as text, without blanks around them.

        Args:
            name: the column, with or without its unit.

        Returns:
            One string per row; "" for a missing cell.

        Raises:
            RockerbogieError: no such column, or two.
        """
        k = self.find(name)
        if k is None:
            raise RockerbogieError(f"{self.file} has no column {name!r}; it has {', '.join(self.names)}")
        return [row[k].strip() for row in self.rows]

    def numbers(self, name: str, unit: str | None = None) -> Array:
        """Return a column in SI.

        Args:
            name: the column, with or without its unit.
            unit: the unit to use instead of the header's.

        Returns:
            (n,) values; NaN for empty cells.

        Raises:
            RockerbogieError: no such column, a unit that is not known, or a cell that is not a number.
        """
        cells = self.text(name)
        k = self.find(name)
        assert k is not None
        written = self.units[k] if unit is None else unit
        factor = find_unit(written)[1] if written and find_unit(written) else 1.0  # type: ignore[index]
        if written and find_unit(written) is None:
            raise RockerbogieError(
                f"{self.file}: column {self.names[k]!r} is in {written!r}, which is not a known unit; "
                f"known are {', '.join(UNITS)}"
            )
        values = np.empty(len(cells))
        for n, cell in enumerate(cells):
            try:
                values[n] = float(cell) if cell.lower() not in MISSING else np.nan
            except ValueError:
                raise RockerbogieError(
                    f"{self.file}: row {self.lines[n]}, column {self.names[k]!r} holds {cell!r}, which is no number"
                ) from None
        return values * factor if factor != 1.0 else values

    def times(self, name: str) -> Array:
        """Return a column of times, given as numbers or as dates in ISO 8601.

        Args:
            name: the column.

        Returns:
            (n,) s; dates count from 1970-01-01 UTC.

        Raises:
            RockerbogieError: as for `numbers`.
        """
        cells = self.text(name)
        first = next((cell for cell in cells if cell.lower() not in MISSING), "")
        if not re.match(r"^\d{4}-\d{2}-\d{2}", first):
            return self.numbers(name)
        values = np.empty(len(cells))
        for n, cell in enumerate(cells):
            try:
                values[n] = _seconds(cell) if cell.lower() not in MISSING else np.nan
            except ValueError:
                raise RockerbogieError(
                    f"{self.file}: row {self.lines[n]}, column {name!r} holds {cell!r}, which is no date"
                ) from None
        return values


def read_columns(path: Path, *, cut_off: bool = False) -> Table:
    """Read a CSV file with a header line of `name [unit]`.

    Columns are separated by commas, semicolons or tabs; with the last two, numbers may have decimal commas. Lines that
    begin with # are skipped. UTF-8 and UTF-16 are read. Empty cells after the last column are ignored.

    Args:
        path: the CSV file.
        cut_off: True if the last line may be cut off, as in a log whose recording was interrupted. It is then left out, with
            a note.

    Returns:
        A `Table`: column name → values (n,) in SI and rad, NaN where a cell is empty. Columns are converted at first use.

    Raises:
        RockerbogieError: the file cannot be read or has no rows of numbers, or a row has too few or too many cells.
    """
    try:
        data = path.read_bytes()
        text = data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig")
    except OSError as error:
        raise RockerbogieError(f"{path.name} cannot be read as CSV: {error.strerror or error}") from None
    except UnicodeDecodeError as error:
        raise RockerbogieError(f"{path.name} cannot be read as CSV: it is not UTF-8 text ({error.reason})") from None
    all_lines = text.splitlines()
    kept = [(n + 1, line) for n, line in enumerate(all_lines) if line.strip() and not line.lstrip().startswith("#")]
    if not kept:
        raise RockerbogieError(f"{path.name} holds no rows of numbers")
    separator = max(SEPARATORS, key=kept[0][1].count)
    notes = [] if separator == "," else [f"columns are separated by {SEPARATORS[separator]}"]
    try:
        rows = [next(csv.reader(io.StringIO(line), delimiter=separator)) for _, line in kept]
    except csv.Error as error:
        raise RockerbogieError(f"{path.name} cannot be read as CSV: {error}") from None
    if len(rows) < 2:
        raise RockerbogieError(f"{path.name} holds no rows of numbers below its header")
    lines = [n for n, _ in kept[1:]]
    headers, rows = rows[0], rows[1:]
    if separator != "," and any(DECIMAL_COMMA.match(cell.strip()) for row in rows[:50] for cell in row):
        rows = [[cell.replace(",", ".") if DECIMAL_COMMA.match(cell.strip()) else cell for cell in row] for row in rows]
        notes.append("numbers have decimal commas")
    if cut_off and len(rows) > 1 and len(rows[-1]) < len(headers):
        notes.append(f"the last line is cut off and was left out (line {lines[-1]})")
        rows, lines = rows[:-1], lines[:-1]
    _check_widths(path.name, headers, rows, lines, separator)
    split = [_split_header(header) for header in headers]
    return Table(path.name, [name for name, _ in split], [unit for _, unit in split], rows, lines, notes)


def _check_widths(file: str, headers: list[str], rows: list[list[str]], lines: list[int], separator: str) -> None:
    """Raise if a row has fewer cells than the header has columns, or more that are not empty."""
    for row, line in zip(rows, lines, strict=True):
        if len(row) < len(headers):
            raise RockerbogieError(
                f"{file}: line {line} has {len(row)} cells and the header {len(headers)} columns: complete the line, or end it "
                f"with empty cells for missing values"
            )
        if len(row) > len(headers) and any(cell.strip() for cell in row[len(headers) :]):
            raise RockerbogieError(
                f"{file}: line {line} has {len(row)} cells and the header {len(headers)} columns, separated by "
                f"{SEPARATORS[separator]}: if numbers have decimal commas, separate columns by semicolons or tabs"
            )


def _split_header(header: str) -> tuple[str, str]:
    """Return a column's name and its unit ("" if none is given)."""
    match = HEADER.match(header)
    if match is None:
        return header.strip(), ""
    name, unit = match[1], match[2]
    if unit is not None and (not unit or (unit.isdigit() and f"{name}[" in header)):
        return header.strip(), ""  # an index, as in position[1]; `status [1]` is a number
    if unit is None:
        round_ = ROUND_UNIT.match(name)
        if round_ and find_unit(round_[2]):
            return round_[1], round_[2]
    return name, unit or ""


def _seconds(text: str) -> float:
    """Return seconds since 1970-01-01 UTC of a date in ISO 8601; without a zone, UTC."""
    date, _, digits = text.partition(".")
    fraction = re.match(r"\d+", digits)
    rest = digits[fraction.end() :] if fraction else ""
    moment = datetime.fromisoformat(date + rest)
    offset = moment.utcoffset()
    whole = (moment.replace(tzinfo=None) - datetime(1970, 1, 1)).total_seconds()
    return whole - (offset.total_seconds() if offset else 0.0) + (float(f"0.{fraction[0]}") if fraction else 0.0)


def write_columns(file: str | Path, columns: Mapping[str, Sequence[Any] | Array]) -> None:
    """Write columns as CSV, with all digits: they read back to the same bits.

    Args:
        file: the file, overwritten.
        columns: header -> values, all of one length.

    Raises:
        RockerbogieError: the file cannot be written.
    """
    values = [np.asarray(column).tolist() for column in columns.values()]
    try:
        with open(file, "w", newline="", encoding="utf-8") as stream:
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows([_cell(value) for value in row] for row in zip(*values, strict=True))
    except OSError as error:
        raise RockerbogieError(f"cannot write {str(file)!r}: {error.strerror}") from None


def _cell(value: Any) -> str:
    """Return a cell's text: the shortest that reads back to the same number."""
    if isinstance(value, float):
        return str(int(value)) if value.is_integer() and abs(value) < 1e15 and (value or not np.signbit(value)) else repr(value)
    return str(int(value)) if isinstance(value, bool) else str(value)
