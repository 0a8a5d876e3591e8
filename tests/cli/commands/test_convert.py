"""taskcal convert, and the same options on identify."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.measurement.reader import read_campaign
from taskcal.measurement.virtual_cell import simulate
from taskcal.measurement.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
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


def test_what_a_spreadsheet_saved_is_written_as_plain_csv_and_every_decision_said(
    run: Run, plain: Path, tmp_path: Path
) -> None:
    ended = run("convert", "-r", "ur5", german(plain, tmp_path / "g.csv"), "-o", tmp_path / "out.csv")
    assert ended.status == 0
    assert ended.err.splitlines() == [
        "numbers are read with decimal commas",
        "column left out: Bemerkung",
        "joints without a unit are read as degrees, by their size",
        "positions without a unit are read in mm, by how far ur5 moved",
        f"{tmp_path / 'out.csv'}: 40 poses with joints and tool",
    ]
    expected, campaign = read_campaign(plain, ROBOT), read_campaign(tmp_path / "out.csv", ROBOT)
    np.testing.assert_allclose(campaign.q, expected.q, atol=1e-9)
    np.testing.assert_allclose(campaign.points, expected.points, atol=1e-9)
    assert campaign.notes == ()


def test_points_alone_are_converted_and_refused_by_what_needs_joints(run: Run, plain: Path, tmp_path: Path) -> None:
    points = german(plain, tmp_path / "p.csv", slice(7, 10))
    assert run("convert", "-r", "ur5", points, "-o", tmp_path / "out.csv").status == 0
    assert (tmp_path / "out.csv").read_text().startswith("id,x_mm,y_mm,z_mm\n1,")
    ended = run("identify", "-r", "ur5", points, "-o", tmp_path / "cal.json")
    assert ended.status == 1
    assert "has no column for joint J1 of ur5" in ended.err
    assert not (tmp_path / "cal.json").exists()


def test_two_raw_files_are_identified_in_one_command(run: Run, plain: Path, tmp_path: Path) -> None:
    joints, points = german(plain, tmp_path / "j.csv", slice(1, 7)), german(plain, tmp_path / "p.csv", slice(7, 10))
    apart = run("identify", "-r", "ur5", joints, "--points", points, "-o", tmp_path / "a.json", "--json")
    assert "j.csv: rows of both files are paired by their order, 40 of each" in apart.err
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


def test_what_ends_in_parquet_is_written_as_such_and_read_back_the_same(run: Run, plain: Path, tmp_path: Path) -> None:
    packed, direct, again = (tmp_path / name for name in ("out.parquet", "direct.csv", "again.csv"))
    assert run("convert", "-r", "ur5", plain, "-o", direct).status == 0
    ended = run("convert", "-r", "ur5", plain, "-o", packed)
    assert ended.status == 0, ended.err
    assert packed.read_bytes().startswith(b"PAR1")
    assert run("convert", "-r", "ur5", packed, "-o", again).status == 0
    assert again.read_text() == direct.read_text()


def test_a_rigid_bodys_quaternion_is_written_beside_its_markers(run: Run, tmp_path: Path) -> None:
    names = [
        *(f"Tool_{part}" for part in ("qx", "qy", "qz", "qw", "x_mm", "y_mm", "z_mm")),
        *(f"M1_{a}_mm" for a in "xyz"),
    ]
    rows = [f"0,0,0.6,0.8,{k},2,3,{k},5,6" for k in range(3)]
    (tmp_path / "mocap.csv").write_text("\n".join([",".join(names), *rows]) + "\n")
    assert run("convert", "-r", "ur5", tmp_path / "mocap.csv", "-o", tmp_path / "out.csv").status == 0
    header, first, *_ = (tmp_path / "out.csv").read_text().splitlines()
    assert header.endswith("Tool_qx,Tool_qy,Tool_qz,Tool_qw")
    assert first.endswith("0.0000000000,0.0000000000,0.6000000000,0.8000000000")
