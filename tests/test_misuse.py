"""Wrong calls raise one sentence that states the fault and the remedy."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import rockerbogie as rb


@pytest.fixture(scope="module")
def rover():
    return rb.load_rover("curiosity")


@pytest.fixture(scope="module")
def poses(rover):
    return rb.settle(rover, rb.surfaces.plane(), [0.0, 1.0], 0.0, 0.0)


TWIST, RATES = np.zeros(6), np.zeros(6)


@pytest.mark.parametrize(
    "twist, rates, more, says",
    [
        (np.zeros(5), RATES, {}, r"twist has shape \(5,\); its last axis must be 6"),
        ("fast", RATES, {}, "twist must be numbers, not 'fast'"),
        (TWIST, np.zeros(4), {}, r"wheel_rates has shape \(4,\)"),
        (TWIST, 1.0, {}, r"wheel_rates has shape \(\)"),
        (np.zeros((3, 6)), RATES, {}, r"do not broadcast together: pose \(2,\), twist \(3,\)"),
        (TWIST, RATES, {"bogie_rates": np.zeros(3)}, r"bogie_rates has shape \(3,\); its last axis must be 2"),
        (TWIST, RATES, {"rocker_rate": np.zeros(3)}, r"pose \(2,\), rocker_rate \(3,\)"),
        (TWIST, RATES, {"steering_rates": 0.1}, r"steering_rates has shape \(\)"),
        (TWIST, [0, 0, np.inf, 0, 0, 0], {}, "wheel_rates holds 1 infinite values; mark a missing reading with nan"),
    ],
)
def test_wheel_slip_reports_what_does_not_fit(rover, poses, twist, rates, more, says):
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.wheel_slip(rover, poses, twist, rates, **more)


@pytest.mark.parametrize(
    "readings, says",
    [
        ({"wheel_rates": [np.inf, 1, 1, 1, 1, 1]}, "wheel_rates holds 1 infinite values; mark a missing reading with nan"),
        ({"gyro": [0, -np.inf, 0]}, "gyro holds 1 infinite values"),
        ({"rocker_rate": np.inf}, "rocker_rate holds 1 infinite values"),
        ({"gyro": ["a", 0, 0]}, "gyro must be numbers"),
        ({"wheel_rates": np.ones((3, 6))}, r"do not broadcast together: pose \(2,\), wheel_rates \(3,\)"),
        ({"expected_slip": np.zeros((5, 3))}, r"expected_slip has shape \(5, 3\); its last axes must be \(6, 3\)"),
    ],
)
def test_body_twist_reports_what_does_not_fit(rover, poses, readings, says):
    with pytest.raises(rb.RockerbogieError, match=says):
        rb.body_twist(rover, poses, **readings)


def test_nan_marks_a_missing_reading(rover, poses):
    five = rb.body_twist(rover, poses, wheel_rates=[np.nan, 1, 1, 1, 1, 1])
    assert np.isfinite(five.twist).all()
    assert np.isnan(five.residual[:, 0, 0]).all(), "the slip of a wheel without a reading is unknown"
    assert np.isfinite(five.residual[:, 1:]).all()


@pytest.mark.parametrize("name", [None, 5, ["curiosity"]])
def test_an_invalid_name_is_refused(name):
    with pytest.raises(rb.RoverError, match=r"names no rover: give a preset \(curiosity, .*\) or the path of a file"):
        rb.load_rover(name)


SIZES = {"wheel_radius": 0.1, "bogie_pivot": (-0.2, 0.3, 0.1), "hubs": [(0.5, 0.3, 0), (0, 0.3, 0), (-0.4, 0.3, 0)]}


@pytest.mark.parametrize(
    "change, says",
    [
        (
            {"rocker_pivot": (0, -0.3, 0.2)},
            "rocker_pivot has its left pivot at y = -0.3 m, right of its right one: give the left",
        ),
        ({"rocker_pivot": [(0, -0.3, 0.2), (0, 0.3, 0.2)]}, "rocker_pivot has its left pivot at y = -0.3 m"),
        ({"bogie_pivot": (-0.2, -0.3, 0.1)}, "bogie_pivot has its left pivot at y = -0.3 m"),
        ({"hubs": np.multiply(SIZES["hubs"], (1, -1, 1))}, "a left hub is not to the left .*: y points left"),
    ],
)
def test_exchanged_sides_are_refused(change, says):
    good = SIZES | {"rocker_pivot": (0, 0.3, 0.2)}
    assert rb.Rover.from_pivots(**good).hubs[0, 1] == 0.3
    with pytest.raises(rb.RoverError, match=says):
        rb.Rover.from_pivots(**(good | change))


def test_positions_that_do_not_broadcast_are_refused():
    ground = rb.surfaces.plane()
    for ask in (ground.height, ground.gradient, ground.normal):
        with pytest.raises(rb.RockerbogieError, match=r"x and y of shapes \(2,\) and \(3,\) must be numbers that broadcast"):
            ask([0, 1], [0, 1, 2])
        with pytest.raises(rb.RockerbogieError, match="must be numbers that broadcast together"):
            ask("east", 0)


@pytest.fixture
def raster(tmp_path):
    rasterio = pytest.importorskip("rasterio")

    def write(z, **more):
        file, z = tmp_path / "dem.tif", np.asarray(z)
        place = rasterio.Affine(1, 0, 500000, 0, -1, 10)
        size = {"height": z.shape[0], "width": z.shape[1], "count": 1, "dtype": z.dtype}
        with rasterio.open(file, "w", driver="GTiff", transform=place, crs="EPSG:32633", **size, **more) as out:
            out.write(z, 1)
        return file

    return write


@pytest.mark.parametrize(
    "more, says",
    [
        ({"band": "a"}, r"1 band\(s\), counted from 1; band 'a' is not one of them"),
        ({"band": 1.5}, r"band 1\.5 is not one of them"),
        ({"window": "a"}, "window 'a' is not"),
        ({"window": 5}, "window 5 is not"),
    ],
)
def test_unknown_bands_and_windows_are_refused(raster, more, says):
    with pytest.raises(rb.TerrainError, match=says):
        rb.Terrain.from_raster(raster(np.ones((10, 10), dtype=np.float32)), **more)


def test_a_mask_of_single_bits_is_no_raster_of_heights(raster):
    with pytest.raises(rb.TerrainError, match=r"band 1 of dem.tif holds single bits, a mask and not heights"):
        rb.Terrain.from_raster(raster(np.eye(10, dtype=np.uint8), nbits=1))


@pytest.mark.parametrize("value, kind", [(-32768, np.int16), (-9999, np.int32), (-9999, np.float32)])
def test_an_unmarked_no_data_value_gives_a_warning(raster, value, kind):
    z = np.arange(100).reshape(10, 10).astype(kind)
    z[2, 3] = value
    with pytest.warns(UserWarning, match=r"dem.tif stores -\d*, far from its other heights .* use gdal_edit.py -a_nodata"):
        rb.Terrain.from_raster(raster(z))
    with warnings.catch_warnings():
        warnings.simplefilter("error", UserWarning)
        assert np.isnan(rb.Terrain.from_raster(raster(z, nodata=float(z[2, 3]))).z).sum() == 1, "marked, it is missing data"
        z[2, 3] = -4
        rb.Terrain.from_raster(raster(z))


def test_a_simulation_that_does_not_move_exits_1(capsys):
    from rockerbogie.cli import main

    call = ["simulate", "--rover", "rocky7", "--terrain", "surface:plane", "--path", "0,0 0.6,0", "--speed", "0.2"]
    assert main([*call, "--friction", "0"]) == 1
    said = capsys.readouterr().err
    assert "short of the path's end, 0.60 m away: its wheels held their rates but slipped" in said
    assert main(call) == 0
    assert capsys.readouterr().err == ""
