"""Joints that stand in the measuring program itself, beside a file of points."""

from dataclasses import replace

import numpy as np
import pytest

from robot_programs import compose_program
from robot_programs.reading import motions_to_joints
from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from tests.diagnosis.virtual_campaigns import healthy

LANGUAGES = {
    ".mod": ("RAPID", "abb-irb120"),
    ".src": ("KRL", "kuka-kr16-2"),
    ".ls": ("TP", "fanuc-m20ia"),
    ".script": ("URScript", "ur5e"),
}


def _points(folder, points):
    path = folder / "points.csv"
    rows = [",".join([f"P{k}", *(f"{v * 1e3:.6f}" for v in row)]) for k, row in enumerate(points, start=1)]
    path.write_text("\n".join(["Point,X [mm],Y [mm],Z [mm]", *rows]) + "\n")
    return ReadOptions(points=path)


def _composed(path, robot, q):
    path.write_bytes(compose_program(path, robot, motions_to_joints(robot, q, path), q=q, wait_s=3.0).encode())
    return path


@pytest.mark.parametrize("suffix", LANGUAGES)
def test_joints_of_a_composed_program_are_read(tmp_path, suffix):
    """As the library of programs writes it, whose text is another than what reads it: to the digits that it writes."""
    language, name = LANGUAGES[suffix]
    robot, sound = load_robot(name), healthy(name, 1)
    path = _composed(tmp_path / f"measure{suffix}", robot, sound.q)
    campaign = read_campaign(path, robot, options=_points(tmp_path, sound.points[:, 0]))
    np.testing.assert_allclose(campaign.q, sound.q, atol=1e-4)
    np.testing.assert_allclose(campaign.points, sound.points[:, :1], atol=1e-8)
    said = f"the joints are those of the {len(sound)} motions to joint positions of a {language} program"
    assert any(note.startswith(said) for note in campaign.notes)


def _axes(q):
    return ",".join(f"A{k} {value:.6f}" for k, value in enumerate(np.degrees(q), start=1))


def test_named_joints_are_paired_by_their_names(tmp_path):
    """In whatever order the program goes to them; RAPID declares them, KRL in the list of the program's name beside it."""
    robot, sound = load_robot("kuka-kr16-2"), healthy("kuka-kr16-2", 1)
    order = np.random.default_rng(0).permutation(len(sound)) + 1
    (tmp_path / "m.src").write_text("DEF m( )\n" + "".join(f"PTP XP{k}\nWAIT SEC 3\n" for k in order) + "END\n")
    data = "".join(
        f"DECL E6AXIS XP{k}={{{_axes(q)},E1 0,E2 0,E3 0,E4 0,E5 0,E6 0}}\n" for k, q in enumerate(sound.q, start=1)
    )
    (tmp_path / "m.dat").write_text(f"DEFDAT m\n{data}ENDDAT\n")
    none = "[9E9,9E9,9E9,9E9,9E9,9E9]"
    robax = {k: ",".join(f"{v:.6f}" for v in np.degrees(q)) for k, q in enumerate(sound.q, start=1)}
    targets = "".join(f"CONST jointtarget j{k}:=[[{text}],{none}];\n" for k, text in robax.items())
    moves = "".join(f"MoveAbsJ j{k},v200,fine,tool0;\n" for k in order)
    (tmp_path / "m.mod").write_text(f"MODULE m\n{targets}PROC main()\n{moves}ENDPROC\nENDMODULE\n")
    options = _points(tmp_path, sound.points[:, 0])
    for suffix in (".src", ".mod"):
        campaign = read_campaign(tmp_path / f"m{suffix}", robot, options=options)
        np.testing.assert_allclose(campaign.q, sound.q[order - 1], atol=1e-7)
        np.testing.assert_allclose(campaign.points[:, 0], sound.points[order - 1, 0], atol=1e-8)


@pytest.mark.parametrize("suffix", LANGUAGES)
def test_programs_with_other_names_are_called_programs(tmp_path, suffix):
    language, name = LANGUAGES[suffix]
    robot, sound = load_robot(name), healthy(name, 1)
    path = _composed(tmp_path / f"measure{suffix}", robot, sound.q).rename(tmp_path / "measure.txt")
    why = rf"is a program in .*{language}.*, not a table; with a name that ends in .*\.\w+"
    with pytest.raises(FileError, match=why) as refused:
        read_campaign(path, robot, options=_points(tmp_path, sound.points[:, 0]))
    assert "fields" not in str(refused.value)


@pytest.mark.parametrize(
    ("moves", "why"),
    [
        (
            "MoveL [[500,0,700],[0,0,1,0],[0,0,0,0],NONE],v200,fine,tool0;",
            "is a RAPID program without motions to joint positions",
        ),
        (
            "MoveAbsJ jUnknown,v200,fine,tool0;",
            r"m\.mod:3: is a RAPID program, and its joints cannot be taken from it .*jUnknown",
        ),
        ("MoveAbsJ [[0,0,0,0,0,0],NONE],v200,fine,tMine;", r"m\.mod:3: is a RAPID program, and its joints .*tMine"),
    ],
)
def test_programs_whose_joints_are_not_known_are_refused(tmp_path, moves, why):
    path = tmp_path / "m.mod"
    none = "[9E9,9E9,9E9,9E9,9E9,9E9]"
    path.write_text(f"MODULE m\nPROC main()\n{moves.replace('NONE', none)}\nENDPROC\nENDMODULE\n")
    with pytest.raises(FileError, match=why):
        read_campaign(path, load_robot("abb-irb120"))


def test_a_program_of_another_robot_is_refused(tmp_path):
    q = healthy("abb-irb120", 1).q
    path = _composed(tmp_path / "m.mod", load_robot("abb-irb120"), q)
    with pytest.raises(FileError, match="moves 6 joints, where franka-panda has 7"):
        read_campaign(path, load_robot("franka-panda"))


def test_logs_with_times_are_called_so(tmp_path):
    """Joints and points each at a rate of its own: neither order nor geometry pairs them, and no time does."""
    robot, sound = load_robot("ur5e"), healthy("ur5e", 1)
    rng = np.random.default_rng(0)
    for clock in ("time_s", "timestamp"):
        joints, points = tmp_path / "joints.csv", tmp_path / "points.csv"
        lines = [f"{clock},{','.join(f'J{k}_deg' for k in range(1, 7))}"]
        lines += [",".join(map(str, (3 * k + i, *row))) for k, row in enumerate(np.degrees(sound.q)) for i in range(4)]
        joints.write_text("\n".join(lines) + "\n")
        seen = sound.points[:, 0] * 1e3
        lines = [f"{clock},x_mm,y_mm,z_mm"]
        lines += [
            ",".join(map(str, (3 * k + i, *(p + rng.normal(0, 0.02, 3))))) for k, p in enumerate(seen) for i in range(3)
        ]
        points.write_text("\n".join(lines) + "\n")
        with pytest.raises(
            FileError, match="both are logs with times, which do not pair them: keep one row of each pose at rest"
        ):
            read_campaign(joints, robot, options=replace(ReadOptions(), points=points))


def test_logs_of_as_many_rows_are_called_so_where_their_order_differs(tmp_path):
    """Rows of equal number are paired by their order; where the robot contradicts that, what they are is said."""
    robot, sound = load_robot("ur5e"), healthy("ur5e", 1)
    joints, points = tmp_path / "joints.csv", tmp_path / "points.csv"
    header = f"time_s,{','.join(f'J{k}_deg' for k in range(1, 7))}"
    rows = [",".join(map(str, (3 * k, *row))) for k, row in enumerate(np.degrees(sound.q))]
    joints.write_text("\n".join([header, *rows]) + "\n")
    seen = np.random.default_rng(0).permutation(sound.points[:, 0]) * 1e3
    rows = [",".join(map(str, (4 * k, *p))) for k, p in enumerate(seen)]
    points.write_text("\n".join(["time_s,x_mm,y_mm,z_mm", *rows]) + "\n")
    campaign = read_campaign(joints, robot, options=replace(ReadOptions(), points=points))
    assert any("if their order differs, both are logs with times" in note for note in campaign.notes)
