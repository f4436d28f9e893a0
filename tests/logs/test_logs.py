"""Logs in three formats, there and back; the MCAP also as other libraries read it."""

from __future__ import annotations

import csv
from xml.etree import ElementTree

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.logs.joint_log import read_log
from rockerbogie.logs.odometry import odometry
from rockerbogie.motion.drive import to_csv
from support.helpers import assert_close


@pytest.fixture(scope="module")
def rover():
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def run(rover):
    ground = rb.surfaces.rough(5, max_slope=0.3, min_radius=0.8, size=20.0, spacing=0.06)
    return rb.drive(rover, ground, rb.Path.waypoints([(-5, -3), (0, 0), (3, 5)], radius=4.0), 0.05, step=0.05)


def same_way(log, run, rover, tol, reason):
    here, there = odometry(rover, run), odometry(rover, log)
    for name in ("x", "y", "z", "yaw"):
        assert_close(there[name], here[name], tol, "m, rad", reason)


def test_csv_and_netcdf_equal_the_run(run, rover, tmp_path):
    to_csv(run, tmp_path / "run.csv")
    run.isel(wheel=[3, 1, 0, 2, 5, 4]).to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    same_way(read_log(tmp_path / "run.nc", rover), run, rover, 1e-12, "the same numbers, wheels found by name")
    same_way(read_log(tmp_path / "run.csv", rover), run, rover, 1e-6, "ten digits")


def test_csv_with_custom_columns(run, rover, tmp_path):
    """Other names, degrees, wheels that do not steer left out."""
    file = tmp_path / "mine.csv"
    names = {"t": "time", **{f"drive{k}": f"wheel_rate_{w}" for k, w in enumerate(rover.wheel_names)}}
    names |= {f"turn{k}": f"steering_{w}" for k, w in enumerate(rover.wheel_names) if rover.steers[k]}
    with open(file, "w", newline="") as stream:
        writer = csv.writer(stream)
        heads = [f"turn{k} [deg]" for k in np.flatnonzero(rover.steers)]
        writer.writerow(["t [s]", *[f"drive{k}[rpm]" for k in range(6)], *heads, "roll", "pitch", "yaw [deg]"])
        for k in range(run.sizes["time"]):
            at = run.isel(time=k)
            turn = np.degrees(at["steering"].values[rover.steers])
            spin = at["wheel_rate"].values * 30 / np.pi
            writer.writerow(
                [float(at["time"]), *spin, *turn, float(at["roll"]), float(at["pitch"]), np.degrees(float(at["yaw"]))]
            )
    log = read_log(file, rover, names=names)
    same_way(log, run[["wheel_rate", "steering", "roll", "pitch", "yaw"]], rover, 1e-9, "units turned to SI")


def test_mcap_round_trip(run, rover, tmp_path):
    pytest.importorskip("rosbags", reason="the ros extra is not installed")
    from rockerbogie.logs.mcap import write_mcap

    write_mcap(rover, run, tmp_path / "run.mcap")
    log = read_log(tmp_path / "run.mcap", rover)
    for name in ("steering", "rocker", "bogie", "roll", "pitch", "yaw", "wheel_rate"):
        assert_close(log[name], run[name], 1e-9, "SI", "float64 in, float64 out; stamps to the nanosecond")
    same_way(log, run, rover, 1e-6, "wheel angles are the integral of the rates")
    bare = odometry(rover, run, start=(1.0, 2.0, 3.0))
    write_mcap(rover, bare, tmp_path / "odometry.mcap")
    assert (tmp_path / "odometry.mcap").stat().st_size > 1000


def test_mcap_is_read_by_other_libraries(run, rover, tmp_path):
    pytest.importorskip("rosbags", reason="the ros extra is not installed")
    mcap = pytest.importorskip("mcap.reader", reason="the mcap library reads it for a second opinion; it is not installed")
    ros2 = pytest.importorskip("mcap_ros2.decoder", reason="mcap-ros2-support decodes it for a second opinion; not installed")
    from rockerbogie.logs.mcap import write_mcap

    write_mcap(rover, run, tmp_path / "run.mcap")
    with open(tmp_path / "run.mcap", "rb") as stream:
        reader = mcap.make_reader(stream, decoder_factories=[ros2.DecoderFactory()])
        assert reader.get_header().profile == "ros2"
        latched = {
            c.topic: "durability: transient_local" in c.metadata["offered_qos_profiles"]
            for c in reader.get_summary().channels.values()
        }
        assert latched["/robot_description"]
        assert latched["/tf_static"]
        assert not latched["/joint_states"]
        last = {channel.topic: message for _, channel, _, message in reader.iter_decoded_messages()}
    assert last["/robot_description"].data.startswith(rb.to_urdf(rover))
    end = run.isel(time=-1)
    at = last["/odom"].pose.pose.position
    assert_close([at.x, at.y, at.z], [float(end[k]) for k in "xyz"], 1e-12, "m", "the last pose")
    joints = dict(zip(last["/joint_states"].name, last["/joint_states"].position, strict=True))
    assert_close(joints["rocker_right_joint"], rover.right_rocker(float(end["rocker"])), 1e-12, "rad", "through the differential")
    links = {link.get("name") for link in ElementTree.fromstring(rb.to_urdf(rover)).findall("link")}
    placed = [t.child_frame_id for topic in ("/tf", "/tf_static") for t in last[topic].transforms]
    assert sorted(placed) == sorted(links), "each link of the URDF has one transform; base_link's is from odom"
    # walk the frames to a wheel's hub and compare with our own
    step = {t.child_frame_id: t for t in last["/tf"].transforms}
    from scipy.spatial.transform import Rotation

    for i, name in enumerate(rover.wheel_names):
        T, frame = np.eye(4), f"wheel_{name}"
        while frame != "base_link":
            t = step[frame].transform
            up = np.eye(4)
            up[:3, :3] = Rotation.from_quat([t.rotation.x, t.rotation.y, t.rotation.z, t.rotation.w]).as_matrix()
            up[:3, 3] = t.translation.x, t.translation.y, t.translation.z
            T, frame = up @ T, step[frame].header.frame_id
        hub = rb.wheel_frames(rover, end["rocker"], end["bogie"], end["steering"])[i, :3, 3]
        assert_close(T[:3, 3], hub, 1e-12, "m", "frames sent are those of eqs 2-4")


def test_wrong_files_are_refused_in_one_sentence(run, rover, tmp_path):
    with pytest.raises(rb.RockerbogieError, match="no log at"):
        read_log(tmp_path / "none.csv", rover)
    odd = tmp_path / "log.txt"
    odd.write_text("x")
    with pytest.raises(rb.RockerbogieError, match=r"give a \.csv, \.nc or \.mcap"):
        read_log(odd, rover)
    cases = {
        "time [s]\n": "holds no rows",
        "q,a\n0,1\n": "no column 'time'",
        "time [s],wheel_rate_LF [furlong]\n0,1\n": "is in 'furlong'",
        "time,roll\n0,1\n1,soft\n": "row 3, column 'roll' holds 'soft'",
        "time,roll\n0,1\n1,2\n": "no wheel_angle or wheel_rate for all six wheels",
    }
    for text, words in cases.items():
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(rb.RockerbogieError, match=words):
            read_log(tmp_path / "bad.csv", rover)
    with pytest.raises(rb.RockerbogieError, match="has no column 'nope'"):
        read_log(tmp_path / "bad.csv", rover, names={"nope": "roll"})
    (tmp_path / "bad.nc").write_text("not netcdf")
    with pytest.raises(rb.RockerbogieError, match="cannot be read as NetCDF"):
        read_log(tmp_path / "bad.nc", rover)
    run.assign_coords(wheel=list("abcdef")).to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with pytest.raises(rb.RockerbogieError, match="is of wheels a, b, c"):
        read_log(tmp_path / "run.nc", rover)
    pytest.importorskip("rosbags", reason="the ros extra is not installed")
    (tmp_path / "bad.mcap").write_text("not a bag")
    with pytest.raises(rb.RockerbogieError, match="cannot be read as a ROS 2 bag"):
        read_log(tmp_path / "bad.mcap", rover)
