"""Rows with too few or too many cells, in every reader of CSV columns."""

from __future__ import annotations

from pathlib import Path

import pytest

import rockerbogie as rb
from rockerbogie.cli import main
from rockerbogie.files.tables import read_columns
from rockerbogie.logs.attitude_log import read_places
from rockerbogie.logs.slip_log import read_slip_log
from rockerbogie.motion.path_files import read_route

ROVER = rb.load_rover("perseverance")
SHORT, LONG = "line 3 has 2 cells and the header", "line 3 has 9 cells and the header"


def joint_columns() -> str:
    """Return the header of a joint log."""
    return ",".join(["time [s]", *(f"wheel_angle_{wheel} [rad]" for wheel in ROVER.wheel_names)])


READERS = {
    "path": ("x [m],y [m],yaw [deg]", read_route),
    "joint log": (joint_columns(), lambda file: rb.read_log(file, ROVER, straight=True)),
    "attitude log": ("x [m],y [m],yaw [deg],pitch [deg],roll [deg]", lambda file: read_places(file, ROVER)),
    "slip log": ("time [s],slip [1],distance [m]", lambda file: read_slip_log(file, ROVER)),
}


def table(file: Path, header: str, cells: int) -> Path:
    """Write a table whose second of three rows has this number of cells."""
    count = header.count(",") + 1
    rows = [[f"{row + column / 10:g}" for column in range(cells if row == 2 else count)] for row in (1, 2, 3)]
    file.write_text("\n".join([header, *(",".join(row) for row in rows)]) + "\n")
    return file


@pytest.mark.parametrize(("cells", "text"), [(2, SHORT), (9, LONG)])
@pytest.mark.parametrize("kind", READERS)
def test_readers_refuse_rows_of_another_width(kind: str, cells: int, text: str, tmp_path: Path) -> None:
    header, read = READERS[kind]
    with pytest.raises(rb.RockerbogieError, match=text):
        read(table(tmp_path / "table.csv", header, cells))


def test_profile_of_an_obstacle_refuses_a_short_row(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = table(tmp_path / "profile.csv", "x [m],z [m]", 1)
    assert main(["climb", "perseverance", "--profile", str(file)]) == 2
    assert "line 3 has 1 cells and the header 2 columns" in " ".join(capsys.readouterr().err.split())


def test_empty_cells_are_missing_values(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    file.write_text("a [deg],b\n180,\n,2,,\n")  # the last line has two empty cells more
    columns = read_columns(file)
    assert columns["a"].tolist()[0] == pytest.approx(3.141592653589793, abs=1e-15)
    assert [value != value for value in (*columns["a"], *columns["b"])] == [False, True, True, False]


def test_last_line_is_left_out_only_where_a_log_may_be_cut_off(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    file.write_text("a,b\n1,2\n3,4\n5\n")
    with pytest.raises(rb.RockerbogieError, match=r"line 4 has 1 cells and the header 2 columns: complete the line"):
        read_columns(file)
    log = read_columns(file, cut_off=True)
    assert log["a"].tolist() == [1.0, 3.0]
    assert log.notes == ["the last line is cut off and was left out (line 4)"]
