"""Logs as users have them: one lap of 2 m radius in every form met in public.

The lap is made by plane geometry alone. It is 12.566 m long, ends at its start, and turns by +360°. Each case must give
that, or a clear refusal.
"""

from __future__ import annotations

import json
import shutil
import sqlite3
import warnings

import numpy as np
import pytest
import xarray as xr

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.logs.channels import LogWarning
from rockerbogie.logs.odometry import flat_odometry
from support.helpers import assert_close
from support.lap import LAP_LENGTH, NAMES, Lap, imu_message, joint_message, quaternion, write_bag

ROVER = rb.load_rover("osr")
LAP = Lap(hz=10.0)
WHEELS = [f"wheel_{w}_joint" for w in NAMES]
STEERED = [w for w, steers in zip(NAMES, ROVER.steers, strict=True) if steers]
CORNERS = [f"steer_{w}_joint" for w in STEERED]


def run(file, **options):
    """Return the track of a log and the warnings of reading it."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", LogWarning)
        log = rb.read_log(file, ROVER, **options)
        track = rb.odometry(ROVER, None, log)
    return track, [str(w.message) for w in caught], log


def assert_lap(track, reason, tol=0.005):
    """Check a track against the circle: half a percent of its length, and of its turn."""
    assert_close(float(track["distance"][-1]), LAP_LENGTH, tol * LAP_LENGTH, "m", f"{reason}: 2π · 2 m")
    end = np.hypot(track["x"][-1] - track["x"][0], track["y"][-1] - track["y"][0])
    assert_close(float(end), 0.0, tol * LAP_LENGTH, "m", f"{reason}: the lap ends at its start")
    turned = np.degrees(float(track["yaw"][-1] - track["yaw"][0]))
    assert_close(turned, 360.0, 3.6, "deg", f"{reason}: to the left, once")


def refused(file, words, **options):
    with pytest.raises(rb.RockerbogieError, match=words):
        rb.read_log(file, ROVER, **options)


# -- CSV --------------------------------------------------------------------------------------------------------------

ANGLES, RATES, STEER = [f"wheel_angle_{w}" for w in NAMES], [f"wheel_rate_{w}" for w in NAMES], [f"steering_{w}" for w in STEERED]


def table(**changes):
    """Return the lap as columns by header, some changed; `None` removes one."""
    columns = {"time": LAP.t, **dict(zip(ANGLES, LAP.angle.T, strict=True))}
    columns |= {name: np.full(len(LAP.t), LAP.steering[NAMES.index(name[-2:])]) for name in STEER}
    return {name: values for name, values in (columns | changes).items() if values is not None}


def write_csv(folder, columns, sep=",", decimal=".", encoding="utf-8", before=""):
    file = folder / "log.csv"
    rows = [
        [v if isinstance(v, str) else repr(float(v)).replace(".", decimal) for v in row]
        for row in zip(*columns.values(), strict=True)
    ]
    file.write_text(before + "\n".join(sep.join(row) for row in [list(columns), *rows]) + "\n", encoding=encoding)
    return file


def rpm():
    rates = {f"{name} [RPM]": np.full(len(LAP.t), rate * 30 / np.pi) for name, rate in zip(RATES, LAP.rate, strict=True)}
    return rates | table(**dict.fromkeys(ANGLES))


@pytest.mark.parametrize(
    ("columns", "form"),
    [
        (table(), {}),
        (table(), {"sep": ";", "decimal": ","}),
        (table(), {"sep": "\t"}),
        (table(), {"encoding": "utf-16"}),
        (table(), {"before": "# a note\n"}),
        (table(mode=["AUTO"] * len(LAP.t)), {}),
        (table(**{"current [A]": LAP.t}), {}),
        ({("time [ms]" if k == "time" else k): 1e3 * v if k == "time" else v for k, v in table().items()}, {}),
        ({("time [us]" if k == "time" else k): 1e6 * v if k == "time" else v for k, v in table().items()}, {}),
        ({("time [ns]" if k == "time" else k): 1e9 * (1.7e9 + v) if k == "time" else v for k, v in table().items()}, {}),
        ({(f"{k} (deg)" if k != "time" else "Time (s)"): np.degrees(v) if k != "time" else v for k, v in table().items()}, {}),
        ({(f"{k} [°]" if k in STEER else k): np.degrees(v) if k in STEER else v for k, v in table().items()}, {}),
        ({k.lower(): v for k, v in table().items()}, {}),
        ({("t" if k == "time" else k): v for k, v in table().items()}, {}),
        ({("Timestamp [s]" if k == "time" else k): v for k, v in table().items()}, {}),
        (rpm(), {}),
        (table(**{a: (v + np.pi) % (2 * np.pi) - np.pi for a, v in zip(ANGLES, LAP.angle.T, strict=True)}), {}),
        (table(time=[f"2024-05-01T12:{int(t // 60):02d}:{t % 60:09.6f}Z" for t in LAP.t]), {}),
    ],
    ids=["plain", "semicolons and decimal commas", "tabs", "utf-16", "comment", "text column", "ampere", "ms", "us", "epoch ns",
         "degrees in round brackets", "degree sign", "lower case", "t", "timestamp", "RPM", "wrapped at pi", "dates"],
)  # fmt: skip
def test_csv_in_every_form_gives_the_lap(columns, form, tmp_path):
    assert_lap(run(write_csv(tmp_path, columns, **form))[0], "CSV")


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        (table(**dict.fromkeys(STEER)), "no steering of the 4 wheels"),
        (table(**{STEER[2]: None}), f"no {STEER[2]}"),
        (table(time=1e3 * LAP.t), r"no unit: write it in the header, as in time \[ms\]"),
        (table(**{n: np.degrees(np.full(len(LAP.t), LAP.steering[NAMES.index(n[-2:])])) for n in STEER}), "if it is in degrees"),
        ({f"{k} [count]" if k in ANGLES else k: v for k, v in table().items()}, "--counts-per-turn"),
        (table(**{ANGLES[0]: None}), f"{ANGLES[0]} are missing"),
        ({f"{k} [m]" if k in STEER else k: v for k, v in table().items()}, "a unit of length"),
    ],
    ids=[
        "no steering",
        "one corner missing",
        "milliseconds without unit",
        "degrees without unit",
        "counts",
        "five wheels",
        "metres",
    ],
)
def test_csv_with_missing_columns_is_refused(columns, words, tmp_path):
    refused(write_csv(tmp_path, columns), words)


def test_names_must_exist_in_the_log_and_in_the_package(tmp_path):
    file = write_csv(tmp_path, {{"steering_LF": "fl", "steering_RF": "fr"}.get(k, k): v for k, v in table().items()})
    assert_lap(run(file, names={"fl": "steering_LF", "fr": "steer_RF_joint"})[0], "names given")
    refused(file, "no steering_LF, steering_RF of the 4", names={})
    refused(file, "both 'fl' and 'fr'", names={"fl": "steering_LF", "fr": "steering_LF"})
    refused(file, "no column named 'stering_LF'; did you mean 'steering_LF'", names={"fl": "stering_LF"})
    refused(file, "has no column 'front_left'", names={"front_left": "steering_LF"})
    minus = write_csv(
        tmp_path, {("corner" if k == "steering_LF" else k): -v if k == "steering_LF" else v for k, v in table().items()}
    )
    assert_lap(run(minus, names={"corner": "-steering_LF"})[0], "a minus turns the sign")


def test_gaps_swaps_duplicates_and_wild_values_are_repaired_and_counted(tmp_path):
    columns = {k: np.array(v) for k, v in table().items()}
    columns[ANGLES[2]][700] = np.nan
    columns[STEER[0]][300] = 40.0
    columns[ANGLES[4]][500] += 1e4
    order = np.r_[:100, 101, 100, 102:800, 799, 800 : len(LAP.t)]
    track, said, log = run(write_csv(tmp_path, {k: v[order] for k, v in columns.items()}))
    assert_lap(track, "repaired")
    assert not said
    for words in (
        "1 missing values",
        "1 swapped rows",
        "1 rows with duplicate stamps",
        "wheel LF: 1 single wild value",
        "steering_LR: 1 single",
    ):
        assert words in log.attrs["notes"], words
    file = write_csv(tmp_path, table())
    text = file.read_text().splitlines()
    file.write_text("\n".join([*text[:-1], text[-1][:60]]))
    track, _, log = run(file)
    assert_lap(track, "last line cut off")
    assert "last line is cut off" in log.attrs["notes"]
    clock = LAP.t.copy()
    clock[600:] -= 3.0
    refused(write_csv(tmp_path, table(time=clock)), "time goes back by 2.9 s")


def test_counters_that_roll_over_or_restart(tmp_path):
    span = 65536 / 1440 * 2 * np.pi
    track, _, log = run(write_csv(tmp_path, table(**dict(zip(ANGLES, ((LAP.angle + 0.9 * span) % span).T, strict=True)))))
    assert_lap(track, "a 16-bit counter rolls over")
    assert "rolled over or restarted" in log.attrs["notes"]
    angle = LAP.angle.copy()
    angle[700:] -= angle[700]
    assert_lap(run(write_csv(tmp_path, table(**dict(zip(ANGLES, angle.T, strict=True)))))[0], "counters restart at 0")
    counts = np.round(LAP.angle / (2 * np.pi) * 1440)
    file = write_csv(
        tmp_path, {f"{k} [count]" if k in ANGLES else k: v for k, v in table(**dict(zip(ANGLES, counts.T, strict=True))).items()}
    )
    assert_lap(run(file, counts_per_turn=1440)[0], "counts with the counts of a turn given")
    assert_lap(
        run(write_csv(tmp_path, table(**dict(zip(ANGLES, counts.T, strict=True)))), counts_per_turn=1440)[0], "whole numbers"
    )


def test_wrong_signs_are_reported_and_corrected_by_an_option(tmp_path):
    columns = table(**{a: -v for a, v in zip(ANGLES[1::2], LAP.angle.T[1::2], strict=True)})
    _, said, _ = run(write_csv(tmp_path, columns))
    assert "--flip wheel_RR --flip wheel_RM --flip wheel_RF" in said[0]
    assert_lap(run(write_csv(tmp_path, columns), flip=["wheel_RR", "wheel_RM", "wheel_RF"])[0], "right wheels turned")
    columns = table(**{n: -table()[n] for n in STEER})
    assert "--flip steering" in run(write_csv(tmp_path, columns))[1][0]
    assert_lap(run(write_csv(tmp_path, columns), flip=["steering"])[0], "steering turned")
    refused(write_csv(tmp_path, columns), "no column named 'steerin'", flip=["steerin"])


# -- encoders ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("counts", "hz"), [(96, 100), (360, 200), (360, 10), (720, 50), (4096, 50)])
@pytest.mark.parametrize("sensors", ["all", "imu", "suspension", "none"])
def test_length_does_not_depend_on_counts_or_rate(counts, hz, sensors):
    track = rb.odometry(
        ROVER,
        None,
        Lap(hz=hz, laps=0.25).dataset(counts, imu=sensors in ("all", "imu"), suspension=sensors in ("all", "suspension")),
    )
    assert_close(float(track["distance"][-1]), LAP_LENGTH / 4, 0.005 * LAP_LENGTH / 4, "m", "0.5 % of a quarter of the lap")
    assert_close(float(track["yaw"][-1]), np.pi / 2, 0.01, "rad", "a quarter turn")
    assert_close(float(track["z"][-1]), 0.0, 0.012 * LAP_LENGTH / 4, "m", "on flat terrain")


def test_stalled_wheel_does_not_make_the_rover_climb():
    lap = Lap(hz=10.0)
    log = lap.dataset(None, imu=False, suspension=False)
    angle = log["wheel_angle"].values
    angle[500:550, 3] = angle[500, 3]
    angle[550:, 3] -= angle[550, 3] - angle[500, 3]
    track = rb.odometry(ROVER, None, log)
    assert_close(float(np.abs(track["z"]).max()), 0.0, 0.02, "m", "flat terrain; 1.9 m without a prior")
    assert_lap(track, "one wheel stalls for 5 s")
    assert_lap(flat_odometry(ROVER, log), "flat odometry of the same")


# -- Datasets and NetCDF ----------------------------------------------------------------------------------------------


def datasets():
    base = LAP.dataset(None, imu=False, suspension=False)
    rates = base.drop_vars("wheel_angle").assign(wheel_rate=(("time", "wheel"), np.tile(LAP.rate, (len(LAP.t), 1))))
    degrees = base.copy(deep=True)
    for name in ("wheel_angle", "steering"):
        degrees[name] = (("time", "wheel"), np.degrees(base[name].values), {"units": "degrees"})
    dates = np.datetime64("2024-05-01") + (LAP.t * 1e9).astype("timedelta64[ns]")
    return {
        "dates": rates.assign_coords(time=dates),
        "ms": rates.assign_coords(time=("time", 1e3 * LAP.t, {"units": "ms"})),
        "seconds": rates.assign_coords(time=("time", LAP.t, {"units": "seconds"})),
        "degrees": degrees,
        "other order": base.isel(wheel=[4, 5, 2, 3, 0, 1]),
        "transposed": base.transpose("wheel", "time"),
    }


@pytest.mark.parametrize("name", list(datasets()))
def test_units_and_labels_of_datasets_are_used(name, tmp_path):
    data = datasets()[name]
    assert_lap(rb.odometry(ROVER, None, data), f"{name} in memory")
    data.to_netcdf(tmp_path / "log.nc", engine="h5netcdf")
    assert_lap(run(tmp_path / "log.nc")[0], f"{name} in NetCDF")


def test_sides_are_read_by_name():
    bogie = np.stack([np.full(len(LAP.t), 0.3), np.zeros(len(LAP.t))], axis=-1)
    base = LAP.dataset(None, imu=False, suspension=False)
    one = base.assign(bogie=(("time", "side"), bogie)).assign_coords(side=["left", "right"])
    two = base.assign(bogie=(("time", "side"), bogie[:, ::-1])).assign_coords(side=["right", "left"])
    assert_close(rb.odometry(ROVER, None, two)["z"], rb.odometry(ROVER, None, one)["z"], 0.0, "m", "the same data")


def test_a_log_in_memory_that_disagrees_with_itself_warns():
    log = LAP.dataset(None, imu=True, suspension=False)
    with pytest.warns(LogWarning, match="yaw contradicts the wheels"):
        rb.odometry(ROVER, None, log.assign(yaw=-log["yaw"]))
    with pytest.warns(LogWarning, match="no steering"):
        rb.odometry(ROVER, None, log.drop_vars("steering"))


def test_old_argument_order_works_with_a_deprecation_warning():
    log = LAP.dataset(None, imu=True, suspension=True).isel(time=slice(0, 50))
    ground = rb.surfaces.plane(size=12.0)
    new = rb.odometry(ROVER, ground, log)
    with pytest.warns(DeprecationWarning, match=r"odometry\(rover, terrain, log\)"):
        old = rb.odometry(ROVER, log, ground)
    xr.testing.assert_identical(old, new)
    xr.testing.assert_identical(rb.odometry(ROVER, log), rb.odometry(ROVER, None, log))
    with pytest.raises(rb.RockerbogieError, match="log is 'log.csv', not a Dataset"):
        rb.odometry(ROVER, None, "log.csv")


# -- bags -------------------------------------------------------------------------------------------------------------

pytest.importorskip("rosbags", reason="the ros extra is not installed")


def joints(k, stamp=None, names=None, position=True, velocity=True, angle=None, steering=None):
    names = names or WHEELS + CORNERS
    at = np.r_[LAP.angle[k] if angle is None else angle, LAP.steering[ROVER.steers] if steering is None else steering]
    return joint_message(
        LAP.ns[k] if stamp is None else stamp, names, at if position else None, np.r_[LAP.rate, np.zeros(4)] if velocity else None
    )


def bag(folder, messages, **options):
    return write_bag(folder / "bag", messages, **options)


def plain(**changes):
    return [("/joint_states", LAP.ns[k], joints(k, **changes)) for k in range(len(LAP.t))]


def test_humble_sqlite3_and_folders_without_metadata(tmp_path):
    folder = bag(tmp_path, plain(), sqlite=True)
    database = next(folder.glob("*.db3"))
    with sqlite3.connect(database) as c:  # as Humble writes it: no message definitions
        for name in ("message_definitions", "schema", "metadata"):
            c.execute(f"drop table if exists {name}")
        c.execute(
            "create table t(id integer primary key, name text, type text, serialization_format text, offered_qos_profiles text)"
        )
        c.execute("insert into t select id, name, type, serialization_format, '' from topics")
        c.execute("drop table topics")
        c.execute("alter table t rename to topics")
    c.close()
    assert_lap(run(database)[0], "the .db3 itself")
    (folder / "metadata.yaml").unlink()
    track, _, log = run(folder)
    assert_lap(track, "a folder without metadata.yaml")
    assert "no metadata.yaml" in log.attrs["notes"]
    shutil.rmtree(folder)
    half = len(LAP.t) // 2
    parts = [
        next(write_bag(tmp_path / f"part{k}", plain()[s]).glob("*.mcap"))
        for k, s in enumerate((slice(0, half), slice(half, None)))
    ]
    folder.mkdir()
    for part in parts:
        shutil.copy(part, folder)
    assert_lap(run(folder)[0], "two files, no metadata.yaml")


def test_joints_on_several_topics_and_foreign_joints(tmp_path):
    messages = []
    for k in range(len(LAP.t)):
        messages.append(("/drive/joint_states", LAP.ns[k], joint_message(LAP.ns[k], WHEELS, LAP.angle[k], LAP.rate)))
        messages.append(
            ("/corner/joint_states", LAP.ns[k], joint_message(LAP.ns[k] + 20_000_000, CORNERS, LAP.steering[ROVER.steers], None))
        )
    assert_lap(run(bag(tmp_path, messages))[0], "two topics")
    assert_lap(run(bag(tmp_path, [("/joint_states", a, m) for _, a, m in messages]))[0], "alternating on one topic")
    mast = [
        m
        for k, one in enumerate(plain())
        for m in (one, ("/joint_states", one[1], joint_message(LAP.ns[k] + 3_000_000, ["mast_pan"], [0.0], [0.0])))
    ]
    track, _, log = run(bag(tmp_path, mast))
    assert_lap(track, "a mast's joints between")
    assert "not used: mast_pan" in log.attrs["read"]
    command = [
        m
        for k, one in enumerate(plain())
        for m in (
            one,
            *[
                ("/joint_commands", one[1], joints(k, LAP.ns[k] + d, angle=np.zeros(6), steering=np.zeros(4)))
                for d in (0, 50_000_000)
            ],
        )
    ]
    track, _, log = run(bag(tmp_path, command))
    assert_lap(track, "commands at twice the rate")
    assert "/joint_commands" in log.attrs["notes"]
    twins = [(t, a, m) for _, a, m in plain() for t in ("/one", "/two")]
    refused(bag(tmp_path, twins), "in topics /one and /two: name the one to read with --topic")
    assert_lap(run(bag(tmp_path, twins), topics=["/two"])[0], "the topic given")
    refused(bag(tmp_path, [("/imu", LAP.ns[0], imu_message(LAP.ns[0]))]), "no sensor_msgs/JointState with messages; it has /imu")


def test_recording_of_nasas_open_source_rover(tmp_path):
    """Names, topics and the corner's sign (positive to the right) are those of osr-rover-code."""
    side, end = {"L": "left", "R": "right"}, {"F": "front", "M": "middle", "R": "back"}
    drive = [f"drive_{side[w[0]]}_{end[w[1]]}" for w in NAMES]
    corner = [f"corner_{side[w[0]]}_{end[w[1]]}" for w in STEERED]
    messages = []
    for k in range(len(LAP.t)):
        messages.append(("/drive_state", LAP.ns[k], joint_message(LAP.ns[k], drive, LAP.angle[k], LAP.rate)))
        messages.append(
            ("/corner_state", LAP.ns[k], joint_message(LAP.ns[k] + 20_000_000, corner, -LAP.steering[ROVER.steers], None))
        )
    file = bag(tmp_path, messages)
    refused(file, "Its joints are /drive_state: drive_.*; /corner_state: corner_")
    wheels = {a: f"wheel_angle_{b}" for a, b in zip(drive, NAMES, strict=True)}
    refused(file, "has no steering of the 4 wheels that steer; it also has corner_", names=wheels)
    signed = wheels | {a: f"-steering_{b}" for a, b in zip(corner, STEERED, strict=True)}
    assert_lap(run(file, names=signed)[0], "all ten names, corners with a minus")
    _, said, _ = run(file, names={k: v.removeprefix("-") for k, v in signed.items()})
    assert "--flip steering" in said[0]


def test_time_stamps_of_all_kinds(tmp_path):
    zero = LAP.ns - LAP.ns[0]
    cases = {
        "no stamps": 0 * zero,
        "a clock that begins at 0": zero,
        "three unstamped": np.where(np.arange(len(zero)) < 3, 0, zero + 10**9),
    }
    swapped = LAP.ns.copy()
    swapped[[500, 501]] = swapped[[501, 500]]
    twice = LAP.ns.copy()
    twice[800] = twice[799]
    back = LAP.ns - np.where(np.arange(len(zero)) > 600, 3 * 10**9, 0)
    for label, stamps in (cases | {"swapped": swapped, "duplicate": twice, "set back by 3 s": back}).items():
        messages = [
            (
                "/joint_states",
                LAP.ns[k],
                joints(np.argsort(np.argsort(stamps, kind="stable"))[k] if label == "swapped" else k, int(stamps[k])),
            )
            for k in range(len(LAP.t))
        ]
        track, said, _ = run(bag(tmp_path, messages))
        assert_lap(track, label)
        assert bool(said) == (label == "set back by 3 s")
    lost = [m for k, m in enumerate(plain()) if not 400 <= k < 700]
    assert_lap(run(bag(tmp_path, lost))[0], "30 s of messages lost")


def test_positions_and_rates_are_compared(tmp_path):
    track, said, _ = run(bag(tmp_path, plain(angle=np.zeros(6))))
    assert_lap(track, "positions stuck at 0")
    assert "stand still while their rates do not" in said[0]
    broadcaster = [
        (
            "/joint_states",
            LAP.ns[k],
            joint_message(
                LAP.ns[k],
                WHEELS + CORNERS,
                np.r_[np.full(6, np.nan), LAP.steering[ROVER.steers]],
                np.r_[LAP.rate, np.full(4, np.nan)],
            ),
        )
        for k in range(len(LAP.t))
    ]
    assert_lap(run(bag(tmp_path, broadcaster))[0], "NaN positions beside good rates")
    zeros = [
        m
        for k, one in enumerate(plain())
        for m in (
            one,
            ("/joint_states", one[1], joints(k, LAP.ns[k] + 3_000_000, angle=np.zeros(6), steering=np.zeros(4), velocity=False)),
        )
    ]
    track, said, _ = run(bag(tmp_path, zeros))
    assert_lap(track, "a second publisher's zeros")
    assert "two publishers" in said[0]


TURN = (0, 0, LAP.wz)


def heading(k, sign=1.0):
    return quaternion(0, 0, sign * LAP.yaw[k])


#: Orientation and angular velocity of the message at row k; words of a warning, "" for none; options that make it right.
IMUS = {
    "good": (lambda k: (heading(k), TURN), "", None),
    "identity attitude": (lambda k: ((0, 0, 0, 1), TURN), "it never changes", None),
    "length 1.02": (lambda k: (1.02 * heading(k), TURN), "", None),
    "scalar first": (lambda k: (np.roll(heading(k), 1), TURN), "of tilt", None),
    "upside down": (
        lambda k: (quaternion(np.pi, 0, LAP.yaw[k]), (0, 0, -LAP.wz)),
        "--imu-mounting 180,0,0",
        {"imu_mounting": (np.pi, 0.0, 0.0)},
    ),
    "camera axes, gyro alone": (
        lambda k: (None, (0, -LAP.wz, 0)),
        "--imu-mounting -90,0,0",
        {"imu_mounting": (-np.pi / 2, 0.0, 0.0)},
    ),
    "north-east-down": (lambda k: (heading(k, -1.0), (0, 0, -LAP.wz)), "--imu-frame ned", {"imu_frame": "ned"}),
    "degrees per second": (lambda k: (None, (0, 0, np.degrees(LAP.wz))), "degrees", None),
    "gap of 75 s": (lambda k: None if 250 <= k < 1000 else (heading(k), TURN), "no attitude from 24.9 to 100.0 s", None),
    "middle half": (lambda k: (heading(k), TURN) if 314 < k < 942 else None, "no attitude from", None),
    "one NaN": (lambda k: ((np.nan,) * 4 if k == 900 else heading(k), TURN), "", None),
}


@pytest.mark.parametrize("name", list(IMUS))
def test_imu_is_compared_with_the_wheels(name, tmp_path):
    row, words, options = IMUS[name]
    messages = []
    for k, joint in enumerate(plain()):
        messages.append(joint)
        if row(k) is not None:
            messages.append(("/imu", LAP.ns[k], imu_message(LAP.ns[k], *row(k))))
    file = bag(tmp_path, messages)
    track, said, _ = run(file)
    assert_lap(track, name)
    assert words in " ".join(said)
    assert bool(said) == bool(words)
    if options:
        track, said, log = run(file, **options)
        assert_lap(track, f"{name}, with {options}")
        assert not said
        assert "gyro" in log


def test_imu_is_chosen_by_content_and_its_clock_is_compared(tmp_path):
    good = lambda k: imu_message(LAP.ns[k], quaternion(0, 0, LAP.yaw[k]), (0, 0, LAP.wz))  # noqa: E731
    camera = lambda k: imu_message(LAP.ns[k], (0, 0, 0, 1), (0, -LAP.wz, 0), "camera_imu_optical_frame")  # noqa: E731
    for order in (("/imu/data", "/imu/camera"), ("/imu/camera", "/imu/data")):
        both = [
            m
            for k, one in enumerate(plain())
            for m in (one, *[(t, one[1], good(k) if t == "/imu/data" else camera(k)) for t in order])
        ]
        track, said, log = run(bag(tmp_path, both))
        assert_lap(track, f"two IMUs, {order[0]} first")
        assert not said
        assert "/imu/data is used of 2 IMUs" in log.attrs["notes"]
    assert_lap(run(bag(tmp_path, both), imu="none")[0], "no IMU")
    refused(bag(tmp_path, both), "no topic '/imu' of sensor_msgs/Imu; it has", imu="/imu")
    late = [
        m
        for k, one in enumerate(plain())
        for m in (one, ("/imu", one[1], imu_message(LAP.ns[k] + 150 * 10**9, quaternion(0, 0, LAP.yaw[k]), (0, 0, LAP.wz))))
    ]
    track, said, _ = run(bag(tmp_path, late))
    assert_lap(track, "a clock 150 s off")
    assert "its clock is +150 s off" in said[0]


# -- round trips and the command --------------------------------------------------------------------------------------


def test_every_file_the_command_writes_reads_back_to_the_same_numbers(tmp_path, capsys):
    source = bag(
        tmp_path,
        [
            m
            for k, one in enumerate(plain()[:300])
            for m in (one, ("/imu", one[1], imu_message(LAP.ns[k], quaternion(0, 0, LAP.yaw[k]), (0, 0, LAP.wz))))
        ],
    )
    assert main(["odometry", str(source), "-r", "osr", "-o", str(tmp_path / "out"), "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert any("wheel_angle [rad]: topic /joint_states" in line and "10 Hz" in line for line in summary["read"])
    first, _, _ = run(source)
    for name in ("odometry.csv", "odometry.nc", "odometry.mcap"):
        again, _, log = run(tmp_path / "out" / name)
        assert_close(log["time"], first["time"], 3e-7, "s", f"{name}: epoch time in float64")
        for channel in ("x", "y", "z", "yaw"):
            tol = 0.0 if name != "odometry.mcap" else 1e-9
            assert_close(log[channel], first[channel], max(tol, 1e-15), "m, rad", f"{name}: all digits")
            assert_close(again[channel], first[channel], 1e-6, "m, rad", f"{name}: odometry of it is the same")
    with open(tmp_path / "out" / "odometry.csv") as stream:
        times = [line.split(",")[0] for line in stream][1:]
    assert len(set(times)) == 300, "epoch time keeps its digits"


def test_covariances_reach_odom(tmp_path):
    mcap = pytest.importorskip("mcap.reader", reason="the mcap library reads it for a second opinion; it is not installed")
    ros2 = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support decodes it for a second opinion; not installed")
    track = rb.odometry(ROVER, None, LAP.dataset(None, imu=True, suspension=True).isel(time=slice(0, 200)))
    rb.write_mcap(ROVER, track, tmp_path / "run.mcap")
    with open(tmp_path / "run.mcap", "rb") as stream:
        reader = mcap.make_reader(stream, decoder_factories=[ros2.DecoderFactory()])
        odom = [m for _, channel, _, m in reader.iter_decoded_messages() if channel.topic == "/odom"]
    assert_close(np.reshape(odom[-1].pose.covariance, (6, 6)), track["pose_covariance"][-1], 1e-15, "", "row by row")
    assert_close(np.reshape(odom[-1].twist.covariance, (6, 6)), track["twist_covariance"][-1], 1e-15, "", "row by row")
    sigma = np.sqrt(np.diagonal(track["pose_covariance"].values, axis1=1, axis2=2))
    assert (np.diff(sigma[:, 0]) > 0).mean() > 0.9, "uncertainty of the position grows along the way"
    assert (np.linalg.eigvalsh(track["pose_covariance"].values) > -1e-12).all()


def test_runs_that_a_bag_cannot_hold_are_refused(tmp_path):
    log = LAP.dataset(None, imu=True, suspension=True).isel(time=slice(0, 20))
    track = rb.odometry(ROVER, None, log).assign(wheel_angle=log["wheel_angle"])
    file = tmp_path / "run.mcap"
    rb.write_mcap(ROVER, track.isel(time=[0]), file)
    rb.write_mcap(
        ROVER,
        track.assign_coords(time=np.datetime64("2024-05-01") + (track["time"].values * 1e9).astype("timedelta64[ns]")),
        file,
    )
    log = rb.read_log(file, ROVER, straight=True)
    assert_close(float(log["time"][0]), 1714521600.0, 1e-6, "s", "2024-05-01 UTC")
    for change, words in (
        (track.assign_coords(time=track["time"] - 5), "ROS stamps hold 0 to 2"),
        (track.assign_coords(time=track["time"] + 3e9), "ROS stamps hold 0 to 2"),
        (track.assign_coords(time=track["time"] * 0), "does not grow after row 1"),
        (track.where(False), "no row with a pose"),
        (track.drop_vars("yaw"), "the run has no yaw"),
        (track.isel(time=[]), "no rows"),
    ):
        with pytest.raises(rb.RockerbogieError, match=words):
            rb.write_mcap(ROVER, change, file)
    with pytest.warns(DeprecationWarning, match=r"write_mcap\(rover, run, file\)"):
        rb.write_mcap(track, ROVER, file)


def test_command_prints_sources_repairs_and_warnings(tmp_path, capsys):
    flipped = write_csv(tmp_path, table(**{n: -table()[n] for n in STEER}), sep=";")
    assert main(["odometry", str(flipped), "-r", "osr"]) == 0
    said = capsys.readouterr()
    assert "read steering [rad]: columns steering_LR" in said.out
    assert "10 Hz" in said.out
    assert "columns are separated by semicolons" in said.out
    assert "expected error of the 3-D end" in said.out
    assert said.err.startswith("warning: wheels and steering disagree")
    assert main(["odometry", str(flipped), "-r", "osr", "--flip", "steering", "--json"]) == 0
    summary = json.loads(capsys.readouterr().out)
    assert not summary["warnings"]
    assert_close(summary["odometry"]["3-D"]["length"], LAP_LENGTH, 0.005 * LAP_LENGTH, "m", "the lap")
    assert main(["odometry", str(flipped), "-r", "osr", "--name", "a=b"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


# -- attitude logs ----------------------------------------------------------------------------------------------------


def test_attitude_logs_in_degrees_with_gaps_or_other_separators(tmp_path, capsys):
    """Compare with plane geometry: at yaw 30°, pitch is −3.525° and roll −5.320°."""
    x, y = np.meshgrid(np.arange(-20, 20.5, 0.5), np.arange(-20, 20.5, 0.5))
    terrain = rb.Terrain.from_array(100 + 0.10 * x - 0.05 * y, 0.5, (-20, -20), "linear")
    rover, n = rb.load_rover("curiosity"), 8
    columns = {
        "x": np.linspace(-5, 5, n),
        "y": np.linspace(-3, 3, n),
        "roll": np.full(n, -5.320),
        "pitch": np.full(n, -3.525),
        "yaw": np.full(n, 30.0),
    }
    with pytest.raises(rb.RockerbogieError, match=r"row 2, column 'roll' gives a roll of -5.32 rad, beyond π/2.*roll \[deg\]"):
        rb.validate(rover, terrain, write_csv(tmp_path, columns), draws=0)
    right = {f"{k} [deg]" if k in ("roll", "pitch", "yaw") else k: v.copy() for k, v in columns.items()}
    right["pitch [deg]"][[3, 6]] = np.nan
    for sep in (",", ";", "\t"):
        found = rb.validate(rover, terrain, write_csv(tmp_path, right, sep=sep), draws=0)
        assert found.attrs["left_out"] == 2
        assert "2 rows with missing values were left out" in found.attrs["notes"]
        assert found.sizes["row"] == n - 2
        assert_close(np.degrees(found["rms"]), 0.0, 1e-2, "deg", "the plane's own attitude")
        assert sep == "," or "separated by" in found.attrs["notes"]


def test_two_names_of_time_need_a_choice(tmp_path):
    columns = {"t": LAP.t, "stamp": LAP.t, **table(time=None)}
    refused(write_csv(tmp_path, columns), "has times stamp and t: name one of them, as in --name stamp=time")
    assert_lap(run(write_csv(tmp_path, columns), names={"t": "time"})[0], "named")


def test_a_run_file_over_t_is_read(tmp_path):
    LAP.dataset(None, imu=False, suspension=False).rename(time="t").to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    assert_lap(run(tmp_path / "run.nc")[0], "NetCDF over t")
