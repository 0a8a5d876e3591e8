"""taskcal robots."""

from pathlib import Path

import numpy as np
import pytest

from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.default_task import default_task
from taskcal.task.task import load_task
from tests.cli.conftest import IRB6660, Run

TABLE = """joint,alpha_deg,a_mm,d_mm,theta_offset_deg,theta_from_controller
1,0,0,670,0,J1
2,-90,312,0,-90,J2
3,0,1075,0,0,-(J2+J3)
4,-90,225,1280,0,-J4
5,90,0,0,0,-J5
6,-90,0,215,0,-J6
"""


def test_the_catalogue_lists_every_robot(run: Run) -> None:
    ended = run("robots")
    assert ended.status == 0
    assert all(name in ended.out for name in catalogue_names())
    assert [robot["name"] for robot in run("robots", "--json").json["robots"]] == list(catalogue_names())


@pytest.mark.parametrize("name", catalogue_names())
def test_every_robot_can_be_shown(run: Run, name: str) -> None:
    assert name in run("robots", name).out
    sheet = run("robots", name, "--json").json
    assert sheet["name"] == name
    assert sheet["parameter_count"] == len(sheet["parameters"])
    assert len(sheet["joint_table"]) == sheet["joints"]


def test_the_words_show_and_list_and_the_place_of_json_do_not_matter(run: Run) -> None:
    assert run("robots", "list").out == run("robots").out
    assert run("robots", "--json", "list").json == run("robots", "list", "--json").json == run("robots", "--json").json
    assert run("robots", "show", "ur5").out == run("robots", "ur5").out
    assert run("robots", "--json", "ur5").json == run("robots", "ur5", "--json").json


def test_the_reference_robot_says_why_defects_are_left_out(run: Run) -> None:
    sheet = run("robots", IRB6660, "--json").json
    assert sheet["parameter_count"] == 45
    assert (sheet["mechanism"]["mobility"], sheet["mechanism"]["overconstraint"]) == (6, 3)
    assert sheet["four_bar"] == {"crank_mm": 500.0, "rod_mm": 700.0, "rocker_mm": 500.0, "arm_mm": 700.0}
    assert {p["name"]: p["symbol"] for p in sheet["parameters"]}["J5.ry"] == "psi5"
    text = " ".join(run("robots", IRB6660).out.split())
    assert "these defects are not modelled" in text
    assert "psi5" in text


def test_a_table_becomes_a_robot(run: Run, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TABLE)
    robot = tmp_path / "robot.toml"
    ended = run("robots", "import", tmp_path / "table.csv", "--convention", "mdh", "-o", robot, "--name", "mine")
    assert ended.status == 0
    assert f"--robot {robot}" in " ".join(ended.out.split())
    assert load_robot(robot).name == "mine"
    assert run("robots", robot, "--json").json["notes"] == ["coupled axes"]


def test_an_unknown_robot_brings_a_suggestion(run: Run) -> None:
    ended = run("robots", "abb-irb6660-205-1.8")
    assert (ended.status, ended.out) == (1, "")
    assert ended.err.startswith(
        "error: no robot 'abb-irb6660-205-1.8' in the catalogue, nor a robot file (.toml, .urdf, .xacro, .xml, .yaml); "
        "did you mean 'abb-irb6660-205-1.9'"
    )


def test_a_table_given_as_a_robot_says_how_to_import_it(run: Run, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TABLE)
    ended = run("robots", tmp_path / "table.csv")
    assert ended.status == 1
    assert "taskcal robots import" in ended.err


def test_a_robot_file_must_end_in_toml(run: Run, tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(TABLE)
    ended = run("robots", "import", tmp_path / "table.csv", "--convention", "mdh", "-o", tmp_path / "robot.json")
    assert ended.status == 2
    assert not (tmp_path / "robot.json").exists()


def test_a_task_to_begin_with_is_one_that_the_library_makes(run: Run, tmp_path: Path) -> None:
    ended = run("robots", "task", "kuka-kr6-r900-sixx", "-o", tmp_path / "task.toml", "--json")
    space = default_task(ErrorModel(load_robot("kuka-kr6-r900-sixx"))).workspace
    read = load_task(tmp_path / "task.toml").workspace
    assert space is not None
    assert read is not None
    assert ended.json["size_mm"] == [edge * 1e3 for edge in space.size]
    np.testing.assert_allclose(read.sample(20), space.sample(20), atol=1e-7)


def test_stated_weights_and_drives_are_shown(run: Run, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(
        "name = 'x'\ngravity = [0, 3.0, 0]\n[payload]\nmass_kg = 12.5\ncentre_mm = [0, 0, 150]\n"
        "[[joint]]\nname = 'J1'\nmass_kg = 80\ncentre_mm = [10, 0, -20]\nstiffness_nm_rad = 1.2e6\ngear_ratio = 121\n"
        "[spring]\njoint = 'J1'\nrate_n_mm = 60\nfree_length_mm = 0\ncrank_mm = 200\nanchor_mm = 500\naligned_deg = 0\n"
    )
    statics = run("robots", tmp_path / "robot.toml", "--json").json["statics"]
    (drive,) = statics.pop("drives")
    assert statics == {
        "gravity": [0.0, 1.0, 0.0],
        "payload_kg": 12.5,
        "payload_centre_mm": [0.0, 0.0, 150.0],
        "spring_on": "J1",
    }
    assert (drive["mass_kg"], drive["centre_mm"], drive["stiffness"]) == (80.0, [10.0, 0.0, -20.0], 1.2e6)
    text = " ".join(run("robots", tmp_path / "robot.toml").out.split())
    for words in ("gravity along 0 1 0 of the base", "payload 12.5 kg", "spring on J1", "1.2e+06 Nm/rad 121"):
        assert words in text
    assert "Weights and drives" not in run("robots", "ur5").out


def test_a_tables_units_are_told_and_said(run: Run, tmp_path) -> None:
    table = tmp_path / "arm.csv"
    table.write_text("alpha,a,d,theta\n-1.5708,0.15,0.45,0\n0,0.6,0,-1.5708\n1.5708,0,0.64,0\n", encoding="utf-8")
    ended = run("robots", "import", table, "--convention", "MDH", "-o", tmp_path / "arm.toml")
    assert ended.status == 0
    assert "a, d taken for m, by size" in ended.err
    assert "alpha, theta taken for rad, by size" in ended.err


def test_a_urdf_is_imported_with_its_tip(run: Run, tmp_path) -> None:
    path = tmp_path / "two.urdf"
    tips = "".join(
        f'<link name="{tip}"/><joint name="f{tip}" type="fixed"><parent link="arm"/><child link="{tip}"/></joint>'
        for tip in ("left", "right")
    )
    joint = '<joint name="j1" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>'
    path.write_text(f'<robot name="two"><link name="base"/><link name="arm"/>{joint}{tips}</robot>', encoding="utf-8")
    refused = run("robots", "import", path, "-o", tmp_path / "two.toml")
    assert refused.status == 1
    assert "several links that may be the tip: left, right" in refused.err
    ended = run("robots", "import", path, "--tip", "right", "-o", tmp_path / "two.toml", "--json")
    assert ended.status == 0
    assert ended.json["joints"] == ["j1"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("a_mm,", "b_mm,", "table.csv:1: "),
        ("2,-90,312", "2,-90,3l2", "table.csv:3: column 'a_mm': '3l2' is not a number"),
        ("-(J2+J3)", "J2*J3", "'J2*J3' is not linear"),
        ("-(J2+J3)", "-(J2+J9)", "no joint 'J9'"),
    ],
)
def test_robots_import_refuses_a_wrong_table(run: Run, tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "table.csv").write_text(TABLE.replace(old, new))
    ended = run("robots", "import", tmp_path / "table.csv", "--convention", "mdh", "-o", tmp_path / "robot.toml")
    assert (ended.status, ended.out) == (1, "")
    assert message in ended.err
    assert not (tmp_path / "robot.toml").exists()


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        ("[[joint]\n", "is not TOML"),
        ("", "joint: is missing"),
        ("[[joint]]\nname = 'J1'\nlimits_deg = [10, -10]\n", "the lower limit 10 must be below the upper limit -10"),
    ],
)
def test_robots_refuses_a_wrong_file(run: Run, tmp_path: Path, joint: str, message: str) -> None:
    (tmp_path / "robot.toml").write_text(f"name = 'x'\n{joint}")
    ended = run("robots", tmp_path / "robot.toml")
    assert (ended.status, ended.out) == (1, "")
    assert f"{tmp_path / 'robot.toml'}:" in ended.err
    assert message in ended.err


def test_unstated_limits_are_null(run: Run, tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text("name = 'x'\n[[joint]]\nname = 'J1'\n")
    alone = run("robots", tmp_path / "robot.toml", "--json")
    assert (alone.err, alone.json["joint_table"][0]["limits_deg"]) == ("", [None, None])
    assert "none stated" in run("robots", tmp_path / "robot.toml").out
