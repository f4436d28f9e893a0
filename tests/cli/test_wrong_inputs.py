"""Wrong values and files for `predict` and `fit-soil`: one sentence, and no file replaced."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from rockerbogie.cli import main

Refused = Callable[..., str]
RAMP = ("predict", "-t", "surface:ramp", "-r", "osr", "-p", "-1,0 0,0")
ROUTE = "x [m],y [m]\n-1,0\n0,0\n"
LOG = "time [s],slip [1],distance [m],roll [deg],pitch [deg]\n" + "".join(
    f"{k},{0.1 + 0.01 * k:.2f},{0.4 * k:.1f},0,{-k}\n" for k in range(8)
)
STEPS = "sclk0_0,sclk1_0,fast_slip_frac\n"


@pytest.fixture
def refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Run a command in an empty folder, assert that it is refused, and return its sentence."""
    monkeypatch.chdir(tmp_path)

    def run(*argv: str) -> str:
        assert main(list(argv)) == 2
        said = capsys.readouterr().err.strip().splitlines()
        assert said[-1].startswith("rockerbogie: ")
        return said[-1]

    return run


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--friction", "high"], '"high"'),
        (["--friction", "nan"], "friction is not finite"),
        (["--friction", "0"], "friction is 0: give coefficients above 0"),
        (["--friction", "0.7", "--speed", "20"], "is a speed in mm/s"),
        (["--friction", "0.7", "--step", "50"], "step is 50 m; give at most the wheelbase, 0.588 m (is it in millimetres?)"),
        (["--friction", "0.7", "--step", "nan"], "step is nan m"),
        (["--friction", "0.7", "--tolerance", "inf"], "tolerance is inf; give a number above 0"),
        (["--friction", "0.7", "--torque", "nan"], "torque is nan"),
        (["--friction", "0.7", "--gravity", "9810"], "is it in mm/s²?"),
        (["--friction", "0.7", "--yaw", "inf"], "start is not finite"),
        (["--friction", "0.7", "--start", "0;0"], "give x,y in metres"),
        (["--soil", ""], "no soil named ''"),
        (["--soil", "none.toml"], "cannot read soil file 'none.toml'"),
        (["--soil", "sand", "--friction", "0.7"], "give either --friction"),
        (["--friction", "0.7", "--grousers", "0.01"], "--grousers acts in soil only"),
    ],
)
def test_wrong_values_of_predict_are_refused(options: list[str], says: str, refused: Refused) -> None:
    assert says in refused(*RAMP, *options)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["-t", "none.tif", "-r", "osr"], "no file 'none.tif'"),
        (["-t", "surface:rampp", "-r", "osr"], "did you mean 'ramp'?"),
        (["-t", "surface:ramp", "-r", ""], "no rover named ''"),
        (["-t", "surface:ramp", "-r", "osr", "-p", "none.csv"], "no path at 'none.csv'"),
    ],
)
def test_unknown_inputs_of_predict_are_refused(options: list[str], says: str, refused: Refused) -> None:
    assert says in refused("predict", "--friction", "0.7", *options)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"", "holds no rows of numbers"),
        (b"x [m],y [m]\n", "holds no rows of numbers below its header"),
        (b"x [m],y [m]\n0,0\n1,abc\n", "row 3, column 'y' holds 'abc', which is no number"),
        (b"x [m],y [m]\n0,0\n1,nan\n", "point 2 of the path is (1, nan)"),
        (b"x [m],x [m],y [m]\n0,0,0\n1,1,0\n", "2 columns named 'x'"),
        (b"x [m]|y [m]\n0|0\n1|0\n", "route.csv"),
        (b"x [m],y [m]\n0,0\n1\n", "line 3 has 1 cells and the header 2 columns"),
        (b"x [furlong],y [m]\n0,0\n1,0\n", "'furlong', which is not a known unit"),
        (b"x [m],y [m]\n0,0\n1,\xe9\n", "it is not UTF-8 text"),
        (b"x [km],y [km]\n-1,0\n0,0\n", "the drive does not start at (-1000, 0) m"),
        (None, "Is a directory"),
    ],
)
def test_wrong_routes_of_predict_are_refused(content: bytes | None, says: str, refused: Refused) -> None:
    file = Path("route.csv")
    file.mkdir() if content is None else file.write_bytes(content)
    assert says in refused(*RAMP[:-2], "-p", str(file), "--friction", "0.7")


def test_predict_replaces_no_file_of_a_user(refused: Refused) -> None:
    Path("route.csv").write_text(ROUTE, encoding="utf-8")
    Path("out").mkdir()
    Path("out/map.png").write_text("mine", encoding="utf-8")
    Path("page.html").write_text("mine", encoding="utf-8")
    call = [*RAMP[:-2], "-p", "route.csv", "--friction", "0.7"]
    assert "was not written by rockerbogie" in refused(*call, "-o", "out")
    assert "was not written by rockerbogie" in refused(*call, "--html", "page.html")
    assert "is not a folder" in refused(*call, "-o", "route.csv")
    assert "end it in .html" in refused(*call, "--html", "out")
    assert Path("route.csv").read_text(encoding="utf-8") == ROUTE
    assert {Path(name).read_text(encoding="utf-8") for name in ("out/map.png", "page.html")} == {"mine"}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        ("", "holds no rows of numbers"),
        (LOG.splitlines()[0], "holds no rows of numbers below its header"),
        (LOG.replace("2,0.12", "2,abc"), "row 4, column 'slip' holds 'abc', which is no number"),
        (LOG.replace("2,0.12", "nan,0.12"), "time is not finite or decreases in row 3"),
        (LOG.replace("2,0.12", "2,inf"), "slip is inf in row 3, beyond 1"),
        (LOG.replace("2,0.12", "2,12"), "slip is 12 in row 3, beyond 1: divide percent by 100"),
        (LOG.replace("2,0.12,0.8", "2,0.12,-0.8"), "distance is not finite or decreases in row 3"),
        (LOG.replace(",2.8,", ",2800,"), "the wheels travel 2800 m in 7 s"),
        ("time [s],slip [1],distance [m]\n0,0.1,0\n0,0.3,0.4\n", "the wheels travel 0.4 m in 0 s"),
        (LOG.replace("distance [m]", "slip [1]"), "2 columns named 'slip'"),
        (LOG.replace("slip [1]", "slip [%]"), "'%', which is not a known unit"),
        (LOG.replace("[deg]", "[rad]"), "pitch is beyond π/2: if it is in degrees"),
        (LOG.replace(",", "|"), "is no slip log: give columns time [s], slip [1] and distance [m]"),
        (LOG.replace("slip [1]", "slip [1] é").encode("latin-1"), "it is not UTF-8 text"),
        (STEPS, "has no row with a start, an end and a slip: there is nothing to fit"),
        (STEPS + "nan,2,0.1\n2,nan,0.1\n", "has no row with a start, an end and a slip: there is nothing to fit"),
        (STEPS + "1,2,abc\n", "could not convert string 'abc'"),
        (STEPS + "1,2\n2,3,0.1\n", "the number of columns changed from 2 to 3 at row 2"),
    ],
)
def test_wrong_logs_of_fit_soil_are_refused(content: str | bytes, says: str, refused: Refused) -> None:
    Path("log.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    said = refused("fit-soil", "log.csv")
    assert says in said
    assert "usecols" not in said


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--limit", "50"], "limit is 50.0; give a number between 0 and 1"),
        (["--threshold", "nan"], "threshold is nan; give a number between 0 and 1"),
        (["--terrain", "none.tif"], "no file 'none.tif'"),
        (["--terrain", "surface:plane"], "the log has no x: leave the terrain out"),
        (["-o", "log.csv"], "is not a folder"),
        (["-o", "out"], "was not written by rockerbogie"),
        (["-o", "."], "the output 'forecast.csv' is the input"),
        (["-o", ".", "--force"], "the output 'forecast.csv' is the input"),
    ],
)
def test_wrong_options_of_fit_soil_are_refused(options: list[str], says: str, refused: Refused) -> None:
    name = "forecast.csv" if options[1] == "." else "log.csv"
    Path(name).write_text(LOG, encoding="utf-8")
    Path("out").mkdir()
    Path("out/forecast.csv").write_text("mine", encoding="utf-8")
    assert says in refused("fit-soil", name, *options)
    assert Path(name).read_text(encoding="utf-8") == LOG
    assert Path("out/forecast.csv").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    "argv",
    [
        ["benchmark", "mars", "--draws", "20.5"],
        ["validate", "--log", "log.csv", "-t", "surface:plane", "--seed", "1.5"],
        ["map", "surface:plane", "-o", "map.tif", "--headings", "2.5"],
        ["map", "surface:plane", "-o", "map.tif", "--workers", "1.5"],
        ["settle", "-t", "surface:plane", "--band", "1.5"],
        ["bench", "--poses", "10.5"],
        ["lab", "--port", "8080.5"],
    ],
    ids=lambda argv: f"{argv[0]} {argv[-2]}",
)
def test_numbers_that_are_not_whole_are_not_rounded(argv: list[str], refused: Refused) -> None:
    assert f"{argv[-2]}: '{argv[-1]}' is not a whole number" in refused(*argv)
