"""Dials, uploads, charts, records, paths and tiles of the page, without a browser."""

from __future__ import annotations

import math
import re
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.lab.charts import MOST_POINTS, Line, chart
from rockerbogie.lab.dials import changed, dh_dials, has_dh, pivot_dials
from rockerbogie.lab.paths import path_through, step_of
from rockerbogie.lab.records import Record, difference
from rockerbogie.lab.uploads import (
    MOST_BYTES,
    message_of,
    plain_name,
    rover_names,
    surface,
    uploaded_rover,
    uploaded_terrain,
    without_paths,
)


@pytest.mark.parametrize("name", rover_names())
def test_dials_at_their_own_values_change_nothing(name: str) -> None:
    rover = rb.load_rover(name)
    dials = pivot_dials(rover)
    assert changed(rover, {d.key: d.value for d in dials})[0] is rover
    assert len({d.key for d in dials}) == len(dials)
    assert all(d.step > 0 for d in dials)


def test_each_dial_changes_its_own_size() -> None:
    rover = rb.load_rover("curiosity")
    own = {d.key: d.value for d in pivot_dials(rover)}
    moved, _ = changed(rover, own | {"bogie_pivot_z": own["bogie_pivot_z"] + 0.05})
    assert moved.bogie_pivot[0, 2] == pytest.approx(own["bogie_pivot_z"] + 0.05, abs=1e-12), "the number shown is the number used"
    shift = moved.bogie_pivot - rover.bogie_pivot
    assert np.allclose(shift, [(0, 0, shift[0, 2])] * 2)
    wider, _ = changed(rover, own | {"track": 1.1 * own["track"]})
    assert np.ptp(wider.hubs[:, 1]) == pytest.approx(1.1 * own["track"])
    assert np.allclose(wider.hubs[:, 1] / rover.hubs[:, 1], np.ptp(wider.hubs[:, 1]) / np.ptp(rover.hubs[:, 1]))
    bigger, _ = changed(rover, own | {"wheel_radius": own["wheel_radius"] + 0.02})
    assert np.allclose(bigger.wheel_radius, own["wheel_radius"] + 0.02)
    heavy, _ = changed(rover, own | {"mass": 1000.0})
    assert heavy.mass == pytest.approx(1000.0)
    free, _ = changed(rover, own | {"bogie_limit": 20.0})
    assert np.allclose(free.bogie_limits, np.radians([-20, 20]))


def test_constants_of_the_paper_are_dials_too() -> None:
    rover = rb.load_rover("elhami-dashti")
    assert has_dh(rover)
    own = {d.key: d.value for d in dh_dials(rover)}
    longer, _ = changed(rover, own | {"K6": own["K6"] + 0.03})
    assert longer.to_dh()["K6"] == pytest.approx(own["K6"] + 0.03)
    assert longer.to_dh()["K7"] == pytest.approx(rover.to_dh()["K7"], abs=1e-12)
    assert not has_dh(rb.load_rover("curiosity"))


def test_an_impossible_rover_is_refused_with_a_sentence() -> None:
    rover = rb.load_rover("osr")
    own = {d.key: d.value for d in pivot_dials(rover)}
    with pytest.raises(rb.RoverError):
        changed(rover, own | {"wheel_radius": -0.1})


def test_uploaded_rovers_are_those_of_the_files(tmp_path: Path) -> None:
    rover = rb.load_rover("perseverance")
    for name, text in (("a.toml", rb.to_toml(rover)), ("b.urdf", rb.to_urdf(rover)), ("c.sdf", rb.to_sdf(rover))):
        read, _ = uploaded_rover(name, text.encode())
        assert np.allclose(read.hubs, rover.hubs, atol=1e-9)
        assert read.mass == pytest.approx(rover.mass)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("x.exe", b""),
        ("x.toml", b"\xff\xfe"),
        ("x.toml", b"nonsense = ["),
        ("x.urdf", b"<robot>"),
        ("x.urdf", b'<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot name="r">&a;</robot>'),
        ("../../etc/x.toml", b"[wheel]\nradius = 'a'"),
    ],
)
def test_a_broken_rover_is_refused_without_paths(name: str, content: bytes) -> None:
    with pytest.raises(rb.RoverError) as error:
        uploaded_rover(name, content)
    text = message_of(error.value)
    assert "/" not in text.replace("n/a", "")
    assert "root:" not in text


def test_an_uploaded_mesh_reference_is_not_read(tmp_path: Path) -> None:
    secret = tmp_path / "secret.stl"
    secret.write_bytes(b"solid x\nendsolid x\n")
    text = rb.to_urdf(rb.load_rover("osr"))
    text = text.replace("</link>", f'<collision><geometry><mesh filename="{secret}"/></geometry></collision></link>', 1)
    rover, notes = uploaded_rover("x.urdf", text.encode())
    assert rover.hubs.shape == (6, 3)
    assert str(tmp_path) not in without_paths(" ".join(notes))


def geotiff(tmp_path: Path, rows: int = 40, cols: int = 50) -> bytes:
    rasterio = pytest.importorskip("rasterio")
    from rasterio.transform import from_origin

    z = np.add.outer(np.linspace(1, 0, rows), np.linspace(0, 2, cols)).astype("float32")
    file = tmp_path / "dem.tif"
    profile = {"driver": "GTiff", "height": rows, "width": cols, "count": 1, "dtype": "float32", "crs": "EPSG:32633"}
    with rasterio.open(file, "w", transform=from_origin(500000, 100, 0.1, 0.1), **profile) as raster:
        raster.write(z, 1)
    return file.read_bytes()


def test_an_uploaded_geotiff_is_the_terrain_of_its_file(tmp_path: Path) -> None:
    content = geotiff(tmp_path)
    terrain, _ = uploaded_terrain("../../my dem.tif", content)
    assert terrain.name == "my_dem"
    assert np.array_equal(terrain.z, rb.Terrain.from_raster(tmp_path / "dem.tif").z)


def test_other_formats_under_the_name_of_a_geotiff_are_refused(tmp_path: Path) -> None:
    geotiff(tmp_path)
    source = f"<SimpleSource><SourceFilename>{tmp_path}/dem.tif</SourceFilename></SimpleSource>"
    vrt = f"<VRTDataset><VRTRasterBand>{source}</VRTRasterBand></VRTDataset>"
    for content in (vrt.encode(), b"", b"II*\0" + b"\0" * 50, geotiff(tmp_path)[:200]):
        with pytest.raises(rb.TerrainError) as error:
            uploaded_terrain("dem.tif", content)
        assert str(tmp_path) not in message_of(error.value)
        assert "rockerbogie-lab" not in message_of(error.value)


def test_large_files_and_grids_are_refused(tmp_path: Path) -> None:
    with pytest.raises(rb.TerrainError, match="limit"):
        uploaded_terrain("dem.tif", b"II*\0" + bytes(MOST_BYTES))
    rasterio = pytest.importorskip("rasterio")
    from rasterio.transform import from_origin

    file = tmp_path / "bomb.tif"
    profile = {"driver": "GTiff", "height": 30000, "width": 30000, "count": 1, "dtype": "uint8", "crs": "EPSG:32633"}
    more = {"compress": "deflate", "sparse_ok": True, "transform": from_origin(500000, 100, 0.1, 0.1)}
    with rasterio.open(file, "w", **profile, **more):
        pass
    with pytest.raises(rb.TerrainError, match="nodes"):
        uploaded_terrain("bomb.tif", file.read_bytes())
    for text in ("mars?size=900&spacing=0.01", "rocks?size=900,900&spacing=0.01&k=0.01"):
        with pytest.raises(rb.TerrainError, match="nodes"):
            surface(text)


def test_names_and_messages_hold_no_folders() -> None:
    assert plain_name("C:\\fake\\..\\a b$c.tif") == "a_b_c.tif"
    assert plain_name("../../.ssh/id") == "id"
    assert plain_name("/") == "file"
    assert without_paths("cannot read /tmp/rockerbogie-lab-x/dem.tif: bad\n block") == "cannot read dem.tif: bad block"
    assert "ZeroDivisionError" in message_of(ZeroDivisionError("/root/x"))
    assert "/root" not in message_of(ZeroDivisionError("/root/x"))


def test_a_chart_is_well_formed_and_ends_at_its_extremes() -> None:
    x = np.linspace(0, 10, 5000)
    y = np.sin(x)
    y[2000:2100] = np.nan
    y[777] = 5.0
    text = chart("a < b", "°", x, "distance [m]", [Line("wave", y), Line("flat", np.zeros_like(x))], 2.5)
    svg = ElementTree.fromstring(text[: text.index("</svg>") + 6])
    paths = [node for node in svg if node.tag == "path"]
    assert len(paths) == 2
    first = paths[0].get("d") or ""
    assert first.count("M") == 2, "a gap begins a new piece"
    points = np.array(re.findall(r"[ML]([\d.]+) ([\d.]+)", first), dtype=float)
    assert len(points) <= MOST_POINTS + 2
    assert points[:, 1].min() < 30, "the peak of one sample is kept"
    assert f"{math.sin(2.5):.3g}" in text


def test_a_record_is_the_run_it_was_made_of() -> None:
    rover, terrain = rb.load_rover("osr"), rb.surfaces.sine(size=6.0)
    run = rb.drive(rover, terrain, rb.Path.straight((-1.0, 0.2), 0.3, 1.0), 0.05)
    record = Record.of(rover, terrain, run)
    k = 37
    frame = record.at(float(record.time[k]))
    assert frame.nearest == k
    assert frame.position == pytest.approx((float(run["x"][k]), float(run["y"][k]), float(run["yaw"][k])), abs=1e-9)
    assert frame.q[1] == pytest.approx(float(run["roll"][k]), abs=1e-9)
    pose = record.pose(k)
    assert np.allclose(pose.contact_angle, run["contact_angle"][k], atol=1e-9)
    assert record.at(1e9).nearest == len(record.time) - 1
    rolled = record.wheel_turn[-1] * rover.wheel_radius
    assert np.allclose(rolled, 1.0, atol=0.1), "wheels roll about the length of the path"
    assert len(record.charts(1.0)) == 3
    with pytest.raises(rb.RockerbogieError, match="not a run"):
        Record.of(rover, terrain, run.drop_vars("roll"))


def test_the_difference_of_a_run_to_itself_is_zero() -> None:
    rover, terrain = rb.load_rover("osr"), rb.surfaces.sine(size=6.0)
    run = rb.drive(rover, terrain, rb.Path.straight((-1.0, 0.2), 0.3, 0.5), 0.05)
    apart = difference(rover, terrain, run)
    assert max(float(np.abs(v).max()) for v in apart.angles.values()) < 1e-9
    assert "RMS 0.000" in apart.chart(1.0)


def test_a_path_goes_through_clicked_points() -> None:
    path = path_through([(0, 0), (1, 0), (1, 1)], 5.0)
    assert 1.5 < path.length < 2.0
    assert path.length / step_of(path) <= 601
    with pytest.raises(rb.PathError, match="two points"):
        path_through([(0, 0)], 1.0)
    with pytest.raises(rb.PathError):
        path_through([(0, 0), (0, 0)], 1.0)
    with pytest.raises(rb.PathError, match="long"):
        path_through([(0, 0), (9000, 0)], 1.0)
