"""Mutation of logs: CSV, NetCDF run files and ROS 2 bags (MCAP, SQLite) of a quarter lap.

Each mutated log must be refused by one sentence, give the lap, or carry a warning or a note. It must not crash or take long.
The lap is known from plane geometry (support/lap.py). Changes of meaning (a scaled column, say) and changes of single bytes are
both made; files whose numbers were not touched have to give the lap.
"""

from __future__ import annotations

import io
import random
import tempfile
import time
import warnings
from collections import Counter
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import rockerbogie as rb
from support.lap import NAMES, RADIUS, ROVER, SPEED, Lap, imu_message, joint_message, quaternion, write_bag

LONGEST = 20.0  # s of processor time
LAP = Lap(hz=5.0, laps=0.25)
TOLERANCE = 0.02 * 2 * np.pi * RADIUS / 4  # m, at the end of a quarter of the lap
CELLS = ("", "nan", "inf", "abc", "1e308", "-1", "0", "1,5", "1000", "1e-320")
FACTORS = (-1.0, 57.3, 1000.0, 0.001)
STEERED = [k for k in range(6) if ROVER.steers[k]]


def columns() -> dict[str, np.ndarray]:
    """Return the log by the column names of a CSV file."""
    steering = {f"steering_{NAMES[k]}": np.full(len(LAP.t), LAP.steering[k]) for k in STEERED}
    return {"time": LAP.t, **{f"wheel_angle_{w}": LAP.angle[:, k] for k, w in enumerate(NAMES)}, **steering}


def mutate_csv(rng: random.Random, file: Path) -> None:
    """Write a CSV log with one change of cells, rows, columns, header or bytes."""
    data = columns()
    cells = [[f"{name} [{'s' if name == 'time' else 'rad'}]" for name in data]]
    cells += [[repr(float(v)) for v in row] for row in zip(*data.values(), strict=True)]
    row, column, way = rng.randrange(1, len(cells)), rng.randrange(len(cells[0])), rng.randrange(9)
    if way == 0:
        cells[row][column] = rng.choice(CELLS)
    elif way == 1:
        cells[row][column] = repr(float(cells[row][column]) * rng.choice(FACTORS))
    elif way == 2:
        factor = rng.choice(FACTORS)
        for one in cells[1:]:
            one[column] = repr(float(one[column]) * factor)
    elif way == 3:
        del cells[row : row + rng.choice((1, 3, 40))]
    elif way == 4:
        cells.insert(rng.randrange(1, len(cells)), cells[row])
    elif way == 5:
        head = cells[0]
        head[column] = rng.choice(("", "x", head[column - 1], head[column].upper(), head[column].replace("[", "[m")))
    elif way == 6:
        for one in cells:
            del one[column]
    text = "\n".join(",".join(one) for one in cells) + "\n"
    if way == 7:
        text = text[: rng.randrange(len(text))]
    if way == 8:
        at = rng.randrange(len(text))
        text = text[:at] + rng.choice(("\0", '"', "\n", ";", ",", "é", "#")) + text[at + rng.choice((0, 1, 5)) :]
    file.write_text(text, encoding="utf-8")


def mutate_bytes(data: bytes, rng: random.Random) -> bytes:
    """Return a copy with a few bytes changed, removed, doubled or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 20))):
        if not out:
            break
        at = min(int(rng.random() ** 2 * len(out)), len(out) - 1)  # headers more often than data
        way = rng.randrange(5)
        if way < 3:
            out[at] = rng.choice((0, 1, 127, 128, 255, out[at] ^ (1 << rng.randrange(8)), rng.randrange(256)))
        elif way == 3:
            del out[at : at + rng.choice((1, 4, 100))]
        elif rng.random() < 0.3:
            out = out[: max(at, 1)]
        else:
            out = out[:at] + out[at : at + 8] + out[at:]
    return bytes(out)


def run_file() -> xr.Dataset:
    """Return the log as a run file holds it."""
    data = LAP.dataset(None, imu=True, suspension=True)
    units = {name: {"units": "rad"} for name in data.data_vars}
    return data.assign({name: data[name].assign_attrs(units[str(name)]) for name in data.data_vars})


@lru_cache
def netcdf() -> bytes:
    """Return the unmutated NetCDF file."""
    buffer = io.BytesIO()
    run_file().to_netcdf(buffer, engine="h5netcdf")
    return buffer.getvalue()


def mutate_netcdf(rng: random.Random, file: Path) -> None:
    """Write a NetCDF run file with changed bytes, or one change of variable, unit or rows."""
    way, data = rng.randrange(9), run_file()
    if way < 4:
        file.write_bytes(mutate_bytes(netcdf(), rng))
        return
    name = str(rng.choice(sorted(map(str, data.data_vars))))
    if way == 4:
        data = data.drop_vars(name)
    elif way == 5:
        data[name] = (data[name] * rng.choice(FACTORS)).assign_attrs(data[name].attrs)
    elif way == 6:
        data[name].attrs["units"] = rng.choice(("deg", "m", "", "rad/s", "furlong", "degrees"))
    elif way == 7:
        values = data[name].values.copy()
        values.flat[rng.randrange(values.size)] = rng.choice((np.nan, np.inf, 1e308, 0.0, -1.0, 1000.0))
        data[name] = (data[name].dims, values, data[name].attrs)
    else:
        order = np.arange(data.sizes["time"])
        change = rng.randrange(4)
        row = rng.randrange(len(order) - 3)
        if change == 0:
            order = np.delete(order, slice(row, row + rng.choice((1, 3, 40))))
        elif change == 1:
            order[row], order[row + 1] = order[row + 1], order[row]
        elif change == 2:
            order = np.insert(order, row, order[row])
        else:
            data = data.isel(wheel=rng.sample(range(6), 6))  # names of wheels are read: the same log
        data = data.isel(time=order)
    data.to_netcdf(file, engine="h5netcdf")


def messages() -> list[list[Any]]:
    """Return topic, time of reception, and the fields of each message of a bag."""
    names = [f"wheel_{w}_joint" for w in NAMES] + [f"steer_{NAMES[k]}_joint" for k in STEERED]
    position = np.concatenate([LAP.angle, np.tile(LAP.steering[STEERED], (len(LAP.t), 1))], axis=1)
    out: list[list[Any]] = []
    for k, stamp in enumerate(LAP.ns):
        out.append(["/joint_states", int(stamp), [names.copy(), position[k].copy(), None]])
        out.append(["/imu", int(stamp), [quaternion(0.0, 0.0, LAP.yaw[k]), (0.0, 0.0, LAP.wz)]])
    return out


@lru_cache
def bag(sqlite: bool) -> bytes:
    """Return the unmutated bag."""
    with tempfile.TemporaryDirectory() as folder:
        return write_messages(messages(), Path(folder) / "bag", sqlite).read_bytes()


def write_messages(out: list[list[Any]], folder: Path, sqlite: bool) -> Path:
    """Write a bag; return its file."""
    made = []
    for topic, stamp, fields in out:
        message = joint_message(stamp, *fields) if topic != "/imu" else imu_message(stamp, *fields)
        made.append((topic, stamp, message))
    write_bag(folder, made, sqlite=sqlite)
    return next(folder.glob("*.db3" if sqlite else "*.mcap"))


def mutate_bag(rng: random.Random, file: Path) -> None:
    """Write a bag with changed bytes, or with one change of messages, joints or values."""
    sqlite, way = file.suffix == ".db3", rng.randrange(10)
    if way < 5:
        file.write_bytes(mutate_bytes(bag(sqlite), rng))
        return
    out = messages()
    row, joint = 2 * rng.randrange(len(out) // 2), rng.randrange(10)
    fields = out[row][2]
    if way == 5:
        fields[1][joint] = rng.choice((np.nan, np.inf, 1e308, 0.0, -1.0, 1000.0))
    elif way == 6:
        factor = rng.choice(FACTORS)
        for one in out[::2]:
            one[2][1][joint] *= factor
    elif way == 7:
        new = rng.choice(("", "x", fields[0][joint - 1], fields[0][joint].upper(), "wheel_LF"))
        for one in out[::2]:
            one[2][0][joint] = new
    elif way == 8:
        change = rng.randrange(3)
        if change == 0:
            del out[row : row + rng.choice((1, 3, 80))]
        elif change == 1:
            out[row], out[row - 2] = out[row - 2], out[row]
        else:
            out.insert(row, out[row])
    else:
        cut = rng.choice((0, 1, 5))  # fields of unequal length
        fields[1] = fields[1][:cut]
    write_messages(out, file.parent / "bag", sqlite).replace(file)


KINDS = {"log.csv": mutate_csv, "log.nc": mutate_netcdf, "log.mcap": mutate_bag, "log.db3": mutate_bag}


def check(file: Path) -> tuple[str, float]:
    """Return the outcome of one file, and the distance of its end from the lap's, m."""
    try:
        log = rb.read_log(file, ROVER)
        track = rb.odometry(ROVER, None, log)
    except rb.RockerbogieError as error:
        return "refused" if "\n" not in str(error) else f"refused in two lines: {error}", 0.0
    # the part of the lap that most wheels rolled: a wrong time stamp does not move the end
    rolled = (log["wheel_angle"][-1] - log["wheel_angle"][0]).values / LAP.rate
    turned = SPEED / RADIUS * float(np.median(rolled))
    end = np.array([np.sin(turned), 1 - np.cos(turned)]) * RADIUS
    off = float(np.hypot(float(track["x"][-1]) - end[0], float(track["y"][-1]) - end[1]))
    if off < TOLERANCE:
        return "right", off
    return ("wrong, with a remark" if log.attrs["warnings"] or track.attrs["warnings"] or log.attrs["notes"] else "silent"), off


def run(count: int, seed: int = 0, *, stop: bool = True) -> Counter[str]:
    """Mutate and read `count` logs; return how many were refused, right, or wrong with a remark.

    Args:
        count: number of logs; formats take turns.
        seed: of the mutations.
        stop: raise at the first fault; else print and count faults.

    Returns:
        Counts by outcome.
    """
    rng, tally, names = random.Random(seed), Counter[str](), list(KINDS)
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for k in range(count):
            file = Path(folder) / names[k % len(names)]
            file.unlink(missing_ok=True)
            KINDS[file.name](rng, file)
            start = time.process_time()
            fault = ""
            try:
                outcome, off = check(file)
            except Exception as error:
                outcome, off, fault = "crash", 0.0, f"{type(error).__name__}: {error}"
            if outcome.startswith("refused in"):
                fault = outcome
            if outcome == "silent":
                fault = f"the end is off by {off:.3f} m without a remark"
            if time.process_time() - start > LONGEST:
                fault = f"took {time.process_time() - start:.1f} s"
            tally[outcome] += 1
            if fault:
                text = f"seed {seed}, log {k} ({file.name}): {fault}"
                if stop:
                    raise AssertionError(text)
                print(text, flush=True)
                file.rename(Path(tempfile.gettempdir()) / f"fault_{seed}_{k}{file.suffix}")
    return tally
