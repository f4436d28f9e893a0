"""`rockerbogie rovers` and `rockerbogie export`, as a person would run them."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.rover import rotations
from rockerbogie.rover.formats import presets
from support import foreign
from support.patience import PATIENCE


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """The one sentence of a call that is refused."""
    assert main(words) == 2
    said = capsys.readouterr().err.strip()
    assert "\n" not in said
    assert "Traceback" not in said
    return said


def test_lists_the_presets(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rovers"]) == 0
    out = capsys.readouterr().out
    for name in presets():
        assert name in out
    assert "2.258 m" in out
    assert main(["rovers", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["rocky7"]["wheel_radius"] == [0.065] * 6
    assert record["elhami-dashti"]["rocker_limits"] == [None, None]


def test_shows_loads_tip_margin_and_climb_limits(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rovers", "osr", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert sum(record["load_share"]) == pytest.approx(1.0, abs=1e-9)
    rover = rb.load_rover("osr")
    assert record["tip_margin"] == pytest.approx(float(rb.stability(rb.settle(rover, rb.surfaces.plane(), 0.0, 0.0)).tip_margin))
    assert record["climb_limits"]["step_forward"] == pytest.approx(rb.limits_of(rover, friction=0.7).step_forward)
    assert main(["rovers", "osr"]) == 0
    assert "at friction 0.7: slopes up 35.0°" in capsys.readouterr().out


def test_shows_the_papers_table(capsys: pytest.CaptureFixture[str]) -> None:
    """The reference is the paper's Table I, corrected: θ, d, a, α of every frame."""
    assert main(["rovers", "elhami-dashti"]) == 0
    rows = {line.split()[0]: line.split()[1:] for line in capsys.readouterr().out.splitlines() if line.strip()}
    assert rows["B1"] == ["D", "30.7", "+", "ρ", "0.27", "0.2846", "0"]
    assert rows["B2"] == ["D", "30.7", "-", "ρ", "-0.27", "0.2846", "0"]
    assert rows["S2"] == ["D", "-ρ", "-0.27", "-0.29", "90"]
    assert rows["S3"] == ["B1", "-30.7", "+", "β1", "0", "-0.125", "90"]
    assert rows["S6"] == ["B2", "-30.7", "+", "β2", "0", "0.245", "90"]
    assert rows["A1"] == ["S1", "ψ1", "-0.29", "0", "0"]
    assert rows["A4"] == ["S4", "0", "-0.145", "0", "0"]


@pytest.mark.parametrize("name", sorted(presets()))
def test_draws(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rovers", name, "-o", str(tmp_path / "r.png")]) == 0
    assert (tmp_path / "r.png").stat().st_size > 20_000
    capsys.readouterr()


def test_a_new_rover(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = str(tmp_path / "my.toml")
    assert main(["rovers", "new", file, "--like", "osr"]) == 0
    assert np.array_equal(rb.load_rover(file).hubs, rb.load_rover("osr").hubs)
    assert "exists and may have been edited" in refused(capsys, "rovers", "new", file)
    assert "should end in .toml" in refused(capsys, "rovers", "new", "my.txt")
    assert main(["rovers", file]) == 0
    assert "started from the preset osr" in capsys.readouterr().out


def test_a_pipe_closed_within_a_table_is_no_error() -> None:
    read, write = os.pipe()
    os.close(read)
    for words in (["rovers"], ["rovers", "curiosity"]):
        code = f"import sys; from rockerbogie.cli import main; sys.exit(main({words!r}))"
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=write, stderr=subprocess.PIPE, text=True, timeout=PATIENCE, check=False
        )
        assert (done.returncode, done.stderr) == (0, ""), words
    os.close(write)


def test_an_import(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    truth = rb.load_rover("rocky7")
    file, out = tmp_path / "cad.urdf", tmp_path / "cad.toml"
    file.write_text(foreign.drawn_in_cad(truth))
    assert main(["rovers", "import", str(file)]) == 0
    assert "guessed: wheel_radius 0.05733 m" in capsys.readouterr().out
    words = [
        "rovers",
        "import",
        str(file),
        "-o",
        str(out),
        "--set",
        "wheels.radius_m=0.065",
        "--set",
        "stops.bogie_deg=[-20, 20]",
        "--forward",
        "y",
    ]
    assert main([*words, "--joint", "rockers=left_1_joint,right_1_joint"]) == 0
    said = capsys.readouterr().out
    assert "found: wheels left_0_wheel_joint" in said
    assert "repaired: nothing ties the two rockers" in said
    rover = rb.load_rover(out)
    np.testing.assert_allclose(rover.hubs, truth.hubs, atol=1e-9)
    np.testing.assert_allclose(np.degrees(rover.bogie_limits), [-20, 20])
    out.unlink()
    assert "no key in [wheels] named 'radius'" in refused(capsys, *words[:-4], "--set", "wheels.radius=1")
    assert "names no joints" in refused(capsys, *words, "--joint", "rockers")


def test_the_schema(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["rovers", "schema", str(tmp_path / "s.json")]) == 0
    assert json.loads((tmp_path / "s.json").read_text())["properties"]["wheels"]
    capsys.readouterr()


@pytest.mark.parametrize("ending", [".urdf", ".sdf", ".xml", ".toml"])
def test_exports(ending: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / f"rover{ending}"
    assert main(["export", "perseverance", "-o", str(file)]) == 0
    np.testing.assert_allclose(rb.load_rover(file).hubs, rb.load_rover("perseverance").hubs, rtol=0, atol=1e-12)
    capsys.readouterr()


def test_exports_ros2_control(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "rover.urdf"
    assert main(["export", "curiosity", "-o", str(file), "--ros2-control"]) == 0
    joints = {
        j.get("name"): [c.get("name") for c in j.findall("command_interface")]
        for j in ElementTree.parse(file).iter("joint")
        if j.find("state_interface") is not None
    }
    assert joints["steer_LF_joint"] == ["position"]
    assert joints["wheel_LM_joint"] == ["velocity"]
    assert joints["rocker_right_joint"] == []
    assert len(joints) == 4 + 4 + 6
    assert "bullet-featherstone" in capsys.readouterr().err, "programs that do not hold the differential"
    assert "applies to a URDF" in refused(capsys, "export", "curiosity", "-o", str(tmp_path / "x.sdf"), "--ros2-control")


def test_exports_the_differential_as_a_system(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, system = tmp_path / "rover.sdf", tmp_path / "rockerbogie_differential.py"
    assert main(["export", "osr", "-o", str(file), "--differential", "system"]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines() == [str(file), str(system)]
    assert "GZ_SIM_SYSTEM_PLUGIN_PATH" in captured.err
    assert system.read_text() == rb.differential_system()[1]
    assert ElementTree.parse(file).find(".//mimic") is None
    file.unlink()
    system.write_text("# edited")
    assert "exists" in refused(capsys, "export", "osr", "-o", str(file), "--differential", "system")
    assert system.read_text() == "# edited"
    assert not file.exists()
    assert "applies to an SDF" in refused(capsys, "export", "osr", "-o", str(tmp_path / "x.urdf"), "--differential", "system")


def test_exports_usd(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pxr", reason="usd-core is not installed")
    from pxr import Usd

    for name, more in (("a.usda", []), ("b.usd", []), ("c.txt", ["--format", "usd"])):
        assert main(["export", "osr", "-o", str(tmp_path / name), *more]) == 0
    assert Usd.Stage.Open(str(tmp_path / "b.usd")).GetDefaultPrim().GetName() == "osr"
    capsys.readouterr()
    assert "exists" in refused(capsys, "export", "osr", "-o", str(tmp_path / "a.usda"))


def test_exports_a_world(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The ground's mesh has the terrain's heights, and the rover stands where it settles."""
    z = np.add.outer(0.1 * np.arange(41) * 0.05, np.zeros(51))
    terrain = rb.Terrain.from_array(z, spacing=0.1, origin=(-2.0, -1.0))
    from rockerbogie.rover.formats.gazebo import write_world

    rover = rb.load_rover("sawppy")
    z[0, 0] = np.nan
    files = write_world(tmp_path, rover, terrain.origin, terrain.spacing, z, (0.5, 0.6, 0.3, 0.0, 0.1, 0.2))
    world = ElementTree.parse(files[0]).getroot().find("world")
    assert world is not None
    assert [m.get("name") for m in world.findall("model")] == ["ground", "sawppy"]
    assert world.findtext("model[@name='sawppy']/pose") == "0.5 0.6 0.3 0.0 0.1 0.2"
    lines = files[1].read_text().split("\n")
    corners = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=float)
    faces = np.array([line.split()[1:] for line in lines if line.startswith("f ")], dtype=int) - 1
    assert len(faces) == 2 * (40 * 50 - 1), "but for the cell with the nan corner"
    used = corners[np.unique(faces)]
    np.testing.assert_allclose(used[:, 2], terrain.height(used[:, 0], used[:, 1]), atol=1e-6)
    sides = corners[faces]
    assert (np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])[:, 2] > 0).all(), "seen from above"
    assert main(["export", "sawppy", "--to", "world", "-o", str(tmp_path / "w"), "-t", "surface:paper"]) == 0
    assert "GZ_SIM_SYSTEM_PLUGIN_PATH" in capsys.readouterr().err
    assert (tmp_path / "w" / "rockerbogie_differential.py").read_text() == rb.differential_system()[1]
    assert "needs terrain" in refused(capsys, "export", "sawppy", "--to", "world", "-o", str(tmp_path / "w"))


@pytest.mark.parametrize("at", ["4,2", "-3,5"])
def test_a_world_starts_outside_the_rocks(at: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the joints at 0, as Gazebo starts, no point of a wheel's rim is in the terrain."""
    assert main(["export", "curiosity", "--to", "world", "-o", str(tmp_path), "-t", "surface:mars", f"--at={at}"]) == 0
    capsys.readouterr()
    model = ElementTree.parse(tmp_path / "world.sdf").getroot().find("world/model[@name='curiosity']")
    assert model is not None
    x, y, z, roll, pitch, yaw = (float(v) for v in (model.findtext("pose") or "").split())
    rover, terrain = rb.load_rover("curiosity"), rb.surfaces.mars()
    T = rotations.body_transform(x, y, z, roll, pitch, yaw) @ rb.wheel_frames(rover, 0.0, (0.0, 0.0))
    turn, across = np.meshgrid(np.linspace(0, 2 * np.pi, 200), np.linspace(-0.5, 0.5, 41))
    rim = np.stack([0.25 * np.cos(turn), 0.4 * across, 0.25 * np.sin(turn), np.ones_like(turn)], axis=-1)
    points = np.einsum("wij,abj->wabi", T, rim)
    height = points[..., 2] - terrain.height(points[..., 0], points[..., 1])
    assert height.min() > 0, "outside the terrain"
    assert height.min() < 0.03, "just above it"


def test_bad_calls(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "did you mean 'curiosity'?" in refused(capsys, "rovers", "curiousity")
    assert "has no ending of a format" in refused(capsys, "export", "osr", "-o", str(tmp_path / "x.zip"))
    (tmp_path / "none").write_text("")
    assert "cannot write" in refused(capsys, "export", "osr", "-o", str(tmp_path / "none" / "x.urdf"))
    assert "should end in .png" in refused(capsys, "rovers", "osr", "-o", "x.bmp")
    assert "-o draws one rover" in refused(capsys, "rovers", "-o", "x.png")
