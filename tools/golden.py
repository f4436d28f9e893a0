"""Write and check golden outputs: results that a reorganisation must not change.

    python tools/golden.py write            compute all outputs and write tests/golden/golden.npz
    python tools/golden.py check            compute all outputs and compare them; exit 1 if any differs
    python tools/golden.py check --only contact/curiosity --only map

Small arrays and texts are stored whole. Of larger arrays, the file holds every 8th row and a SHA-256 hash (first 16 bytes) of
each 32 rows. All NaN are equal; 0 and −0 differ. With other library versions or on another processor, bits may differ: the
check then compares the stored values to 1e-9 and does not compare hashes. Tip margins then may differ by twice their accuracy.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import re
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))
import golden_cases

import rockerbogie as rb

FILE = Path(__file__).resolve().parents[1] / "tests" / "golden" / "golden.npz"
LIBRARIES = ("numpy", "scipy", "numba", "llvmlite", "xarray", "mujoco")
TOLERANCE = 1e-9  # absolute, and relative above 1
#: Tolerances of results whose search branches on rounding, rad, where bits may differ; a bool with tolerance 1 is not compared.
SEARCHED = {".tip_margin": 1e-4, ".tip_bound": 1e-4, ".tip_angle": 1e-4, ".stays": 1.0}
STRIDE, CHUNK, HASH_BYTES = 8, 32, 16
#: Arrays up to this size are stored whole, and arrays with these names at any size.
WHOLE_BYTES = 2048
ALWAYS_WHOLE = ("/q", "/status", "/contact_count", "/clearance")
#: Arrays of which only hashes are stored; `terrain.height` shows the size of a difference.
HASHED = ("/terrain.z",)
NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def environment() -> dict[str, str]:
    """Return the environment on which bits depend: versions, processor, compiled kernels or not."""
    import llvmlite.binding
    import numba

    found = {name: version(name) for name in LIBRARIES}
    found["python"] = ".".join(platform.python_version_tuple()[:2])
    found |= {"machine": platform.machine(), "system": platform.system(), "libc": " ".join(platform.libc_ver())}
    found["processor"] = numba.config.CPU_NAME or llvmlite.binding.get_host_cpu_name()
    return found | {"compiled": str(not numba.config.DISABLE_JIT)}


def canonical(value: Any) -> np.ndarray:
    """Return an array in the compared form: contiguous, at least 1-D, one bit pattern for NaN."""
    array = np.ascontiguousarray(value).reshape(np.shape(value) or (1,))
    if array.dtype.kind == "f":
        array = np.where(np.isnan(array), array.dtype.type(np.nan), array)
    return array


def hashes(array: np.ndarray) -> np.ndarray:
    """Return the hash (chunks, HASH_BYTES) uint8 of each CHUNK rows."""
    parts = [hashlib.sha256(array[k : k + CHUNK].tobytes()).digest()[:HASH_BYTES] for k in range(0, len(array), CHUNK)]
    return np.frombuffer(b"".join(parts), dtype=np.uint8).reshape(-1, HASH_BYTES)


def stride_of(name: str, array: np.ndarray) -> int:
    """Return the stride of the stored rows of an array: 1, STRIDE, or 0 if no row is stored."""
    if name.endswith(HASHED):
        return 0
    return 1 if array.nbytes <= WHOLE_BYTES or name.endswith(ALWAYS_WHOLE) else STRIDE


def compute(names: Sequence[str]) -> Iterator[tuple[str, Any]]:
    """Yield full name and value of each output of the named groups: a text or a canonical array."""
    found = golden_cases.groups()
    for group in names:
        for name, value in found[group]():
            yield f"{group}/{name}", value if isinstance(value, str) else canonical(value)


def write(file: Path, names: Sequence[str], progress: Callable[[str], None] = lambda name: None) -> int:
    """Write the outputs of the named groups to a file; return their number."""
    index: dict[str, dict[str, Any]] = {}
    pools: dict[str, list[np.ndarray]] = {"hash": []}
    sizes: dict[str, int] = {}
    texts: dict[str, str] = {}
    for name, value in compute(names):
        progress(name)
        if isinstance(value, str):
            texts[name] = value
            continue
        stride, kind = stride_of(name, value), value.dtype.name
        index[name] = {"dtype": kind, "shape": value.shape, "stride": stride}
        if stride:
            rows = value[::stride].ravel()
            index[name]["start"] = sizes.get(kind, 0)
            sizes[kind] = sizes.get(kind, 0) + rows.size
            pools.setdefault(kind, []).append(rows)
        if stride != 1:
            index[name]["hash"] = sizes.get("hash", 0)
            pools["hash"].append(hashes(value))
            sizes["hash"] = sizes.get("hash", 0) + len(pools["hash"][-1])
    head = {"environment": environment(), "groups": list(names), "index": index, "texts": texts}
    packed = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(file, head=packed, **{kind: np.concatenate(parts) for kind, parts in pools.items() if parts})
    return len(index) + len(texts)


class Golden:
    """Golden outputs of a file."""

    def __init__(self, file: Path) -> None:
        with np.load(file, allow_pickle=False) as stored:
            self.pools = {name: stored[name] for name in stored.files}
        head = json.loads(self.pools.pop("head").tobytes())
        self.environment: dict[str, str] = head["environment"]
        self.groups: list[str] = head["groups"]
        self.index: dict[str, dict[str, Any]] = head["index"]
        self.texts: dict[str, str] = head["texts"]

    def names(self, groups: Sequence[str]) -> list[str]:
        """Return the names of all outputs of the groups."""
        return [name for name in (*self.index, *self.texts) if any(name.startswith(f"{group}/") for group in groups)]

    def changed_environment(self) -> list[str]:
        """Return a line for each difference between the file's environment and this one."""
        now = environment()
        keys = sorted({*now, *self.environment})
        pairs = ((key, self.environment.get(key, "-"), now.get(key, "-")) for key in keys)
        return [f"{key}: {then} in the file, {here} here" for key, then, here in pairs if then != here]

    def compare(self, name: str, value: Any, exact: bool) -> str:
        """Compare an output with the file's; return a description of the difference, or ""."""
        if isinstance(value, str):
            return _compare_text(self.texts[name], value, exact) if name in self.texts else "was an array, is a text"
        if name not in self.index:
            return "was a text, is an array"
        known = self.index[name]
        if (value.dtype.name, list(value.shape)) != (known["dtype"], known["shape"]):
            return f"was {known['dtype']} {tuple(known['shape'])}, is {value.dtype.name} {value.shape}"
        parts = []
        if known["stride"]:
            rows = value[:: known["stride"]]
            stored = self.pools[known["dtype"]][known["start"] : known["start"] + rows.size].reshape(rows.shape)
            tolerance = next((value for end, value in SEARCHED.items() if name.endswith(end)), TOLERANCE)
            parts.append(_compare_numbers(stored, rows, known["stride"], exact, tolerance))
        if exact and known["stride"] != 1:
            now = hashes(value)
            bad = np.flatnonzero((now != self.pools["hash"][known["hash"] : known["hash"] + len(now)]).any(axis=1))
            if bad.size:
                first, last = bad[0] * CHUNK, min((bad[0] + 1) * CHUNK, len(value)) - 1
                parts.append(f"{bad.size} of {len(now)} hashes differ, first of rows {first} to {last}")
        return "; ".join(part for part in parts if part)


def _compare_numbers(stored: np.ndarray, now: np.ndarray, stride: int, exact: bool, tolerance: float) -> str:
    """Return the number of differing elements, their largest difference and first index, or ""."""
    if exact or (now.dtype.kind != "f" and tolerance < 1.0):
        bits = np.dtype(f"u{now.dtype.itemsize}")
        differ = stored.view(bits) != now.view(bits)
    else:
        differ = ~np.isclose(now.astype(float), stored.astype(float), rtol=tolerance, atol=tolerance, equal_nan=True)
    if not differ.any():
        return ""
    first = np.argwhere(differ)[0]
    first[0] *= stride
    with np.errstate(invalid="ignore"):
        gap = np.abs(now[differ].astype(float) - stored[differ].astype(float))
    lone = int(np.isnan(gap).sum())
    largest = f"largest difference {np.nanmax(gap):.3g}" if lone < gap.size else "no two numbers to compare"
    some = "" if stride == 1 else f" in every {stride}th row"
    nans = f", {lone} of them NaN or infinite on one side" if lone else ""
    where = ", ".join(str(k) for k in first)
    return f"{int(differ.sum())} of {differ.size} elements{some} differ{nans}, {largest}, first at [{where}]"


def _compare_text(stored: str, now: str, exact: bool) -> str:
    """Return the first line in which two texts differ, or "".

    If not `exact`, numbers may differ by TOLERANCE.
    """
    before, after = stored.split("\n"), now.split("\n")
    for k, (a, b) in enumerate(zip(before, after, strict=False)):
        if a == b:
            continue
        if not exact and NUMBER.sub("#", a) == NUMBER.sub("#", b):
            pairs = [np.array([float(t) for t in NUMBER.findall(line)]) for line in (a, b)]
            if np.allclose(*pairs, rtol=TOLERANCE, atol=TOLERANCE):
                continue
        return f"line {k + 1} was {a[:100]!r}, is {b[:100]!r}"
    return "" if len(before) == len(after) else f"had {len(before)} lines, has {len(after)}"


class Report(NamedTuple):
    """Result of a check."""

    compared: int
    differing: dict[str, str]  # name -> description of the difference
    extra: list[str]  # outputs that the file does not hold


def check(golden: Golden, names: Sequence[str], exact: bool, progress: Callable[[str], None] = lambda name: None) -> Report:
    """Compute the named groups and compare them with the file; outputs not computed differ too."""
    missing = dict.fromkeys(golden.names(names), "is in the file, but was not computed")
    differing: dict[str, str] = {}
    extra: list[str] = []
    compared = 0
    for name, value in compute(names):
        progress(name)
        if missing.pop(name, None) is None:
            extra.append(name)
            continue
        compared += 1
        how = golden.compare(name, value, exact)
        if how:
            differing[name] = how
    return Report(compared, differing | missing, extra)


def main() -> int:
    """Run the command line; return 0 if all outputs are equal, 1 if any differs, 2 on bad input."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=("write", "check"))
    parser.add_argument("--file", type=Path, default=FILE, help="default: tests/golden/golden.npz")
    parser.add_argument("--only", action="append", default=[], metavar="PREFIX", help="groups with this prefix; may be repeated")
    options = parser.parse_args()
    names = [name for name in golden_cases.groups() if not options.only or name.startswith(tuple(options.only))]
    if not names:
        parser.error(f"no name of a group starts with {options.only}")
    started = time.perf_counter()
    print(f"package: {Path(rb.__file__).parent}")

    def progress(name: str) -> None:
        if sys.stderr.isatty():
            print(f"\r\x1b[K{name}", end="", file=sys.stderr, flush=True)

    if options.action == "write":
        count = write(options.file, names, progress)
        size = options.file.stat().st_size / 1e6
        print(f"\n{count} outputs of {len(names)} groups, {size:.2f} MB, {time.perf_counter() - started:.0f} s: {options.file}")
        return 0
    if not options.file.exists():
        parser.error(f"{options.file} does not exist: write it first, with the package before the change")
    golden = Golden(options.file)
    absent = [name for name in golden.groups if name not in golden_cases.groups() and name.startswith(tuple(options.only) or "")]
    changed = golden.changed_environment()
    if changed:
        print(f"The environment differs, so numbers are compared to {TOLERANCE:g} and hashes are not compared:")
        print("\n".join(f"  {line}" for line in changed))
    report = check(golden, [name for name in names if name in golden.groups], not changed, progress)
    print()
    for name in absent:
        print(f"{name}: this group of the file has no case now")
    for name, how in report.differing.items():
        print(f"{name}: {how}")
    fresh = [name for name in names if name not in golden.groups] + report.extra
    if fresh:
        print(f"not in the file, not compared: {len(fresh)}, first {fresh[0]}")
    bad = len(report.differing) + len(absent)
    print(f"{report.compared} outputs compared, {bad} differ, {time.perf_counter() - started:.0f} s")
    return 1 if bad or not report.compared else 0


if __name__ == "__main__":
    sys.exit(main())
