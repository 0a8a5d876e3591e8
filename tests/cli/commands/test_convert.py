"""taskcal convert, and the same options on identify."""

from pathlib import Path

import numpy as np
import pytest
from openpyxl import Workbook

from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import Run

ROBOT = load_robot("ur5")


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign as Taskcal writes it."""
    path = tmp_path_factory.mktemp("plain") / "plain.csv"
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (40, 6))
    campaign, _ = simulate(ErrorModel(ROBOT), q, rng=np.random.default_rng(1))
    write_campaign(path, campaign, ROBOT)
    return path


def german(plain: Path, path: Path, columns: slice = slice(1, 10)) -> Path:
    """The same as a German spreadsheet saves it, without ids and units."""
    rows = [line.split(",")[columns] for line in plain.read_text().splitlines()[1:]]
    names = ["A1", "A2", "A3", "A4", "A5", "A6", "X", "Y", "Z"]
    lines = [";".join([*names[slice(columns.start - 1, columns.stop - 1)], "Bemerkung"])]
    lines += [";".join([*(cell.replace(".", ",") for cell in row), "gut"]) for row in rows]
    path.write_bytes("\r\n".join(lines).encode("utf-16"))
    return path


def test_convert_writes_plain_csv_and_reports_every_inference(run: Run, plain: Path, tmp_path: Path) -> None:
    """A spreadsheet export is written as plain CSV, and every inference is reported."""
    ended = run("convert", "-r", "ur5", german(plain, tmp_path / "g.csv"), "-o", tmp_path / "out.csv")
    assert ended.status == 0
    assert ended.err.splitlines() == [
        "numbers are read with decimal commas",
        "column left out: Bemerkung",
        "joints without a unit are read as degrees, by their size",
        "positions without a unit are read in mm, by how far ur5 moved",
    ]
    assert f"wrote {tmp_path / 'out.csv'}: 40 poses with joints and tool" in " ".join(ended.out.split())
    expected, campaign = read_campaign(plain, ROBOT), read_campaign(tmp_path / "out.csv", ROBOT)
    np.testing.assert_allclose(campaign.q, expected.q, atol=1e-9)
    np.testing.assert_allclose(campaign.points, expected.points, atol=1e-9)
    assert campaign.notes == ()


def test_two_raw_files_are_identified_in_one_command(run: Run, plain: Path, tmp_path: Path) -> None:
    joints, points = german(plain, tmp_path / "j.csv", slice(1, 7)), german(plain, tmp_path / "p.csv", slice(7, 10))
    apart = run("identify", "-r", "ur5", joints, "--points", points, "-o", tmp_path / "a.json", "--json")
    assert "j.csv with p.csv: rows of both files are paired by their order, 40 of each" in apart.err
    together = run("identify", "-r", "ur5", plain, "-o", tmp_path / "b.json", "--json")
    assert apart.json["fitted"]["mean_mm"] == pytest.approx(together.json["fitted"]["mean_mm"], rel=1e-6)


def test_names_and_the_decimal_mark_can_be_stated(run: Run, plain: Path, tmp_path: Path) -> None:
    path = tmp_path / "bare.txt"
    path.write_text("\n".join(line.replace(",", " ") for line in plain.read_text().splitlines()[1:]))
    names = "id J1_deg J2_deg J3_deg J4_deg J5_deg J6_deg x_mm y_mm z_mm"
    ended = run("convert", "-r", "ur5", path, "--columns", names, "--decimal", "point", "-o", tmp_path / "out.csv")
    assert ended.status == 0
    np.testing.assert_allclose(
        read_campaign(tmp_path / "out.csv", ROBOT).points, read_campaign(plain, ROBOT).points, atol=1e-9
    )
    ended = run("convert", "-r", "ur5", path, "--columns", "id x_mm", "-o", tmp_path / "more.csv")
    assert ended.status == 1
    assert "has 10 columns, and 2 names were given for them" in ended.err


def test_rows_hidden_in_a_workbook_are_asked_about(run: Run, plain: Path, tmp_path: Path) -> None:
    path, book = tmp_path / "a.xlsx", Workbook()
    header, *rows = (line.split(",") for line in plain.read_text().splitlines())
    for row in (header, *((name, *map(float, cells)) for name, *cells in rows)):
        book.worksheets[0].append(row)
    book.worksheets[0].row_dimensions[7].hidden = True
    book.save(path)
    ended = run("convert", "-r", "ur5", path, "-o", tmp_path / "out.csv")
    assert ended.status == 1
    assert "--hidden-rows drop" in ended.err
    for what, rows in (("keep", 40), ("drop", 39)):
        ended = run("convert", "-r", "ur5", path, "--hidden-rows", what, "-o", tmp_path / f"{what}.csv")
        assert ended.status == 0, ended.err
        assert "hidden row 7" in ended.err
        assert len(read_campaign(tmp_path / f"{what}.csv", ROBOT)) == rows


def test_convert_to_parquet_round_trips(run: Run, plain: Path, tmp_path: Path) -> None:
    """A name that ends in .parquet is written as Parquet and is read back unchanged."""
    packed, direct, again = (tmp_path / name for name in ("out.parquet", "direct.csv", "again.csv"))
    assert run("convert", "-r", "ur5", plain, "-o", direct).status == 0
    ended = run("convert", "-r", "ur5", plain, "-o", packed)
    assert ended.status == 0, ended.err
    assert packed.read_bytes().startswith(b"PAR1")
    assert run("convert", "-r", "ur5", packed, "-o", again).status == 0
    assert again.read_text() == direct.read_text()


ANGLES = "Name,Angle 1,Angle 2,Angle 3\n" + "".join(f"p{k},{k}.5,{2 * k}.1,{k}\n" for k in range(8))
REPORT = "Feature;Axis;Nominal;Actual;Dev\n" + "".join(f"CIR{k};X;10.0;10.00{k};0.00{k}\n" for k in range(8))
LOST = "id,x_mm,y_mm,z_mm\n" + "".join(f"p{k},,,\n" for k in range(8))
TURNED = "id,qx,qy,qz,qw\n" + "".join(f"p{k},0,0,0,1\n" for k in range(8))


@pytest.mark.parametrize(
    "text", [ANGLES, REPORT, LOST, TURNED], ids=["angles", "CMM report", "lost beams", "rotations"]
)
def test_convert_refuses_a_file_without_a_measured_number(run: Run, text: str, tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_text(text)
    for command, out in (("convert", "out.csv"), ("identify", "cal.json")):
        ended = run(command, "-r", "ur5", path, "-o", tmp_path / out)
        assert ended.status == 1
        assert "file.csv:1: holds no measured number: none of its columns (" in ended.err
        assert "name them J1_deg … and x_mm y_mm z_mm" in ended.err
        assert not (tmp_path / out).exists()


def test_convert_takes_points_alone_and_identify_does_not(run: Run, plain: Path, tmp_path: Path) -> None:
    points = german(plain, tmp_path / "p.csv", slice(7, 10))
    assert run("convert", "-r", "ur5", points, "-o", tmp_path / "out.csv").status == 0
    assert (tmp_path / "out.csv").read_text().startswith("id,x_mm,y_mm,z_mm\n1,")
    ended = run("identify", "-r", "ur5", points, "-o", tmp_path / "cal.json")
    assert (ended.status, (tmp_path / "cal.json").exists()) == (1, False)
    assert "has no column for joint J1 of ur5" in ended.err


def test_convert_and_identify_read_groups_of_points(run: Run, plain: Path, tmp_path: Path) -> None:
    rows = [line.split(",") for line in plain.read_text().splitlines()[1:]]
    points, joints = tmp_path / "points.txt", tmp_path / "joints.csv"
    points.write_text("".join(f"Robot, P{row[0]}, {', '.join(row[7:10])}, 03/14/2024 10:22:01 AM\n" for row in rows))
    joints.write_text("\n".join(",".join(line.split(",")[:7]) for line in plain.read_text().splitlines()))
    assert run("convert", "-r", "ur5", points, "-o", tmp_path / "out.csv").status == 0
    assert (tmp_path / "out.csv").read_text().splitlines()[1] == ",".join([f"P{rows[0][0]}", *rows[0][7:10]])
    apart = run("identify", "-r", "ur5", joints, "--points", points, "-o", tmp_path / "a.json", "--json")
    together = run("identify", "-r", "ur5", plain, "-o", tmp_path / "b.json", "--json")
    assert apart.json["fitted"]["mean_mm"] == pytest.approx(together.json["fitted"]["mean_mm"], rel=1e-6)


def test_convert_writes_a_rigid_body_beside_its_markers(run: Run, tmp_path: Path) -> None:
    body = [f"Tool_{part}" for part in ("qx", "qy", "qz", "qw", "x_mm", "y_mm", "z_mm")]
    rows = [f"0,0,0.6,0.8,{k},2,3,{k},5,6" for k in range(3)]
    (tmp_path / "mocap.csv").write_text("\n".join([",".join([*body, "M1_x_mm", "M1_y_mm", "M1_z_mm"]), *rows]) + "\n")
    assert run("convert", "-r", "ur5", tmp_path / "mocap.csv", "-o", tmp_path / "out.csv").status == 0
    header, first, *_ = (tmp_path / "out.csv").read_text().splitlines()
    assert header.endswith("Tool_qx,Tool_qy,Tool_qz,Tool_qw")
    assert first.endswith("0.0000000000,0.0000000000,0.6000000000,0.8000000000")


def test_convert_refuses_a_controllers_positions_beside_lengths(run: Run, tmp_path: Path) -> None:
    q = np.random.default_rng(0).uniform(-2.0, 2.0, (20, 6))
    p = ErrorModel(ROBOT).poses(q)[:, :3, 3]
    cells = np.column_stack([np.degrees(q), p * 1e3, 1e3 * np.linalg.norm(p - [1.5, 0.2, 0.1], axis=1)])
    header = ",".join([*(f"J{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm", "L_mm"])
    np.savetxt(tmp_path / "wire.csv", cells, "%.2f", ",", header=header, comments="")
    ended = run("convert", "-r", "ur5", tmp_path / "wire.csv", "-o", tmp_path / "out.csv")
    assert (ended.status, (tmp_path / "out.csv").exists()) == (1, False)
    assert "'L_mm' may be what was measured" in ended.err
