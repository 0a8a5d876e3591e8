import csv
import io
from pathlib import Path

import numpy as np
import pytest

from taskcal.cli.commands.poses import MAX_SHOWN_ROWS
from taskcal.geometry.euler import to_angles
from taskcal.robot.catalogue import load_robot, robot_toml
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.cli.conftest import Run
from tests.laws.calibrations import calibrated

Q = np.radians([[10.0, -70.0, 80.0, -60.0, -70.0, 15.0], [20.0, -65.0, 75.0, -55.0, -75.0, 25.0]])


@pytest.fixture
def joints(tmp_path):
    path = tmp_path / "joints.csv"
    lines = [f"p{i}," + ",".join(repr(v) for v in np.degrees(row).tolist()) for i, row in enumerate(Q)]
    path.write_text("\n".join(["id,J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg", *lines]) + "\n", encoding="utf-8")
    return path


def test_poses_of_the_nominal_robot(run: Run, joints) -> None:
    ended = run("poses", "--robot", "ur5", joints, "--json")
    assert ended.status == 0
    expected = ErrorModel(load_robot("ur5")).poses(Q)
    for row, T in zip(ended.json["rows"], expected, strict=True):
        np.testing.assert_allclose([row["x_mm"], row["y_mm"], row["z_mm"]], T[:3, 3] * 1e3, atol=1e-9)


def test_only_columns_that_are_not_used_are_said_to_be_ignored(run: Run, joints, tmp_path) -> None:
    assert "ignored" not in run("poses", "--robot", "ur5", joints).err
    header, *rows = joints.read_text(encoding="utf-8").splitlines()
    more = tmp_path / "more.csv"
    more.write_text("\n".join([f"{header},x_mm", *(f"{row},1" for row in rows)]) + "\n", encoding="utf-8")
    assert "ignored columns: x_mm\n" in run("poses", "--robot", "ur5", more).err


def test_poses_come_back_as_joints_in_every_form(run: Run, joints, tmp_path) -> None:
    for angles in ("quaternion", "rpy", "abc", "WPR"):
        path = tmp_path / f"{angles}.csv"
        assert run("poses", "--robot", "ur5", joints, "--angles", angles, "-o", path).status == 0
        ended = run("poses", "--robot", "ur5", path)
        assert ended.status == 0
        back = run("poses", "--robot", "ur5", path, "-o", tmp_path / "back.csv", "--force")
        assert back.status == 0
        rows = list(csv.DictReader(io.StringIO((tmp_path / "back.csv").read_text(encoding="utf-8"))))
        q = np.radians([[float(row[f"J{j}_deg"]) for j in range(1, 7)] for row in rows])
        model = ErrorModel(load_robot("ur5"))
        np.testing.assert_allclose(model.poses(q), model.poses(Q), atol=1e-7)


def test_a_calibration_says_how_far_off_the_nominal_robot_is(run: Run, joints, tmp_path) -> None:
    calibration = calibrated("ur5")
    calibration.save(tmp_path / "cal.json")
    ended = run("poses", "--calibration", tmp_path / "cal.json", joints, "--json")
    assert ended.status == 0
    row = ended.json["rows"][0]
    moved = [row[f"{axis}_mm"] - row[f"nominal_{axis}_mm"] for axis in "xyz"]
    np.testing.assert_allclose([row["dx_mm"], row["dy_mm"], row["dz_mm"]], moved, atol=1e-9)
    assert row["distance_mm"] == pytest.approx(np.linalg.norm(moved))
    assert row["u_mm"] > 0.0
    shown = run("poses", "--calibration", tmp_path / "cal.json", joints)
    assert "distance_mm" in shown.out
    assert "nominal_x_mm" not in shown.out
    assert "--output" in shown.out


def test_poses_out_of_reach_are_said(run: Run, tmp_path) -> None:
    path = tmp_path / "far.csv"
    path.write_text("x_mm,y_mm,z_mm,qx,qy,qz,qw\n9000,0,0,0,0,0,1\n", encoding="utf-8")
    ended = run("poses", "--robot", "ur5", path)
    assert (ended.status, ended.out) == (1, "")
    assert "reaches none of the 1 poses" in ended.err


def test_a_table_of_neither_says_what_it_needs(run: Run, tmp_path) -> None:
    path = tmp_path / "neither.csv"
    path.write_text("id,foo\n1,2\n", encoding="utf-8")
    ended = run("poses", "--robot", "ur5", path)
    assert (ended.status, ended.out) == (1, "")
    assert "no column for joint J1" in ended.err


@pytest.mark.parametrize("count", [MAX_SHOWN_ROWS, MAX_SHOWN_ROWS + 1])
def test_as_many_rows_are_shown_as_there_is_room_for(run: Run, tmp_path, count) -> None:
    """What is left of them is said; the JSON has every one."""
    path = tmp_path / "many.csv"
    rows = [f"pose{k}," + ",".join(map(str, np.degrees(Q[k % 2]))) for k in range(count)]
    path.write_text("\n".join(["id," + ",".join(f"J{j}_deg" for j in range(1, 7)), *rows]) + "\n", encoding="utf-8")
    ended = run("poses", "--robot", "ur5", path)
    assert sum(line.strip().startswith("pose") for line in ended.out.splitlines()) == MAX_SHOWN_ROWS
    assert ("more rows" in ended.out) == (count > MAX_SHOWN_ROWS)
    assert len(run("poses", "--robot", "ur5", path, "--json").json["rows"]) == count


def test_an_axis_that_slides_is_in_millimetres(run: Run, tmp_path) -> None:
    """A SCARA's joints come back from the poses that they give."""
    robot = load_robot("denso-hsr065a1")
    low, high = np.clip(robot.limits, -2.0, 2.0).T
    q = low + np.array([[0.6], [0.7]]) * (high - low)
    units = [("mm", 1e3) if slides else ("deg", 180.0 / np.pi) for slides in robot.prismatic]
    names = [f"{name}_{unit}" for name, (unit, _) in zip(robot.joint_names, units, strict=True)]
    rows = q * [scale for _, scale in units]
    (tmp_path / "joints.csv").write_text(
        "\n".join([",".join(names), *(",".join(map(repr, row.tolist())) for row in rows)]) + "\n"
    )
    assert run("poses", "--robot", robot.name, tmp_path / "joints.csv", "-o", tmp_path / "poses.csv").status == 0
    found = run("poses", "--robot", robot.name, tmp_path / "poses.csv", "--json").json["rows"]
    np.testing.assert_allclose([[row[name] for name in names] for row in found], rows, atol=1e-4)


def test_poses_are_no_joints_of_a_robot_that_calls_them_xyz(run: Run, tmp_path) -> None:
    """Beside an orientation; its own joints are written by number. A tool turned beyond rounding is said."""
    joint = [
        {"name": name, "type": "prismatic", "steps": [step]}
        for name, step in (("X", {"ry_deg": 90.0}), ("Y", {"rx_deg": -90.0}), ("Z", {"ry_deg": -90.0}))
    ]
    robot, path = robot_from({"name": "gantry", "joint": joint}), tmp_path / "gantry.toml"
    path.write_text(robot_toml(robot.description), encoding="utf-8")
    q, calibration = np.array([[0.3, 0.2, 0.1], [0.5, 0.4, 0.3]]), calibrated(robot)
    calibration.save(tmp_path / "cal.json")
    lines = [f"{x * 1e3!r},{y * 1e3!r},{z * 1e3!r}" for x, y, z in q.tolist()]
    (tmp_path / "joints.csv").write_text("\n".join(["q1_mm,q2_mm,q3_mm", *lines]) + "\n", encoding="utf-8")
    for of in (("--robot", path), ("--calibration", tmp_path / "cal.json")):
        assert run("poses", *of, tmp_path / "joints.csv", "-o", tmp_path / "poses.csv", "--force").status == 0
        ended = run("poses", *of, tmp_path / "poses.csv", "--json")
        assert ended.status == 0
        at = np.array([[row[f"q{k}_mm"] for k in (1, 2, 3)] for row in ended.json["rows"]])
        np.testing.assert_allclose(at, q * 1e3, atol=1e-6)
        assert "stays turned" not in ended.err
    x, y, z = calibration.tool_in_base(q[:1])[0, :3, 3] * 1e3
    nominal = to_angles("abc", ErrorModel(robot).poses(q[:1])[:, :3, :3])[0]
    a, b, c = np.degrees(nominal)
    tilt = f"x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n{x},{y},{z},{a + 1.0},{b},{c}\n"
    (tmp_path / "tilt.csv").write_text(tilt, encoding="utf-8")
    assert run("poses", "--robot", path, tmp_path / "tilt.csv").status == 1
    assert "3 of six directions" in run("poses", "--calibration", tmp_path / "cal.json", tmp_path / "tilt.csv").err


def test_every_row_that_is_not_reached_is_counted(run: Run, tmp_path: Path) -> None:
    """Of few rows all are named, of many the first and how many there are."""
    reached = "400,0,400,0,1,0,0"
    for missed in ([1], [1, 3, 4], list(range(1, 16))):
        lines = [f"{9999 if k in missed else 400},{reached.partition(',')[2]}" for k in range(max(missed) + 2)]
        (tmp_path / "t.csv").write_text("\n".join(["x_mm,y_mm,z_mm,qx,qy,qz,qw", *lines]) + "\n")
        ended = run("poses", tmp_path / "t.csv", "-r", "abb-irb120", "--json")
        assert ended.status == 0, ended.err
        named = ", ".join(map(str, missed[:10])) + (" and 5 more" if len(missed) > 10 else "")
        assert f"{named}: " in ended.err
