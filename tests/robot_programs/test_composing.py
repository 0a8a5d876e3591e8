"""Fresh programs in every language, read back."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame, Motion, Target
from robot_programs.core.source import Place
from robot_programs.languages import COMPOSED
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Confdata
from robot_programs.rapid.rewrite import MAX_LINE_LENGTH
from robot_programs.reading import compose_program, motions_to_joints, parse_program, read_program
from taskcal.errors import FileError, TaskcalError
from taskcal.geometry import se3
from taskcal.io.files import write_whole
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.chains import rigid
from tests.laws.robots import generators

ROBOT = load_robot("abb-irb6660-205-1.9")
HALF = np.radians([170, 40, 50, 290, 110, 350])
NOWHERE = Place(path=Path("given"), line=1)
NULL = Frame(name="", T=np.eye(4))


def motion(
    kind, T=None, q=None, via=None, tool=NULL, part=NULL, speed=None, stops=True, in_hand=False, posture=None
) -> Motion:
    def target(T, q=None) -> Target:
        return Target(name="", T=T, q=q, posture=posture, place=NOWHERE)

    return Motion(
        kind=kind, end=target(T, q), via=None if via is None else target(via), tool=tool, part=part, part_in_hand=in_hand,
        speed=speed, stops=stops, follows=None, routine="", place=NOWHERE,
    )  # fmt: skip


@pytest.mark.parametrize("suffix", COMPOSED)
@given(rng=generators)
@settings(max_examples=5)
def test_motions_to_joint_positions_come_back_in_their_order(tmp_path_factory, rng, suffix):
    path = tmp_path_factory.mktemp("composed") / f"Measure{suffix}"
    q = rng.uniform(-HALF, HALF, (int(rng.integers(1, 12)), 6))
    notes = [f"pose {k}" for k in range(len(q))]
    lines = [f"{note}\nnext" for note in notes]
    source = compose_program(path, ROBOT, motions_to_joints(ROBOT, q, path), notes=lines, wait_s=2.5)
    write_whole(source.path, source.encode())
    program = read_program(path, robot=ROBOT)
    assert not program.diagnostics
    assert [(move.kind, move.stops) for move in program.motions] == [("axes", True)] * len(q)
    np.testing.assert_allclose([move.end.q for move in program.motions], q, atol=2e-7)
    positions = [source.text.index(note) for note in notes]
    assert positions == sorted(positions)
    if suffix != ".csv":
        assert source.text.count("2.5") >= len(q)
    if suffix == ".ls":
        assert f"LINE_COUNT\t= {3 * len(q)};" in source.text
    if suffix in (".mod", ".src", ".ls"):
        assert source.text.count("\n") == source.text.count("\r\n")


@pytest.mark.parametrize(
    ("suffix", "name", "turn"),
    [(".mod", "abb-irb120", 3e-7), (".src", "kuka-kr16-2", 5e-8), (".script", "ur5", 2e-7)],
)
@given(rng=generators)
def test_motions_to_poses_come_back(suffix, name, turn, rng):
    """With their frames, of one name or another, speeds and postures."""
    robot = load_robot(name)
    tools = [Frame(name="tGun", T=rigid(rng)), Frame(name="my tool", T=rigid(rng)), NULL]
    parts = [Frame(name="tGun", T=rigid(rng)), NULL]
    q = rng.uniform(-1.5, 1.5, (5, 6))
    motions = [motion("axes", q=row, stops=bool(k % 2), speed=None) for k, row in enumerate(q[:2])]
    T = ErrorModel(robot).poses(q) @ se3.inverse(robot.T_flange_tool)
    for k, kind in enumerate(("joint", "linear", "circular"), 2):
        tool, part = (some[int(rng.integers(len(some)))] for some in (tools, parts))
        end, via = (se3.inverse(part.T) @ T[i] @ tool.T for i in (k, 0))
        speed = None if kind == "joint" else float(rng.choice([0.1, 0.0333, 2.5]))
        arc = via if kind == "circular" else None
        motions.append(motion(kind, end, via=arc, tool=tool, part=part, speed=speed, stops=False))
    if suffix == ".mod":
        stated = Confdata(cf1=-1, cf4=0, cf6=2, cfx=1)
        motions.append(
            motion("linear", rigid(rng), tool=tools[0], part=parts[0], speed=0.1, in_hand=True, posture=stated)
        )
        (alone,) = read_rapid([compose_program("Job.mod", robot, motions[-1:])]).motions
        assert alone.end.posture == stated
    at = np.concatenate([q, q])[: len(motions)]
    source = compose_program(f"Job{suffix}", robot, motions, q=at)
    assert suffix != ".mod" or max(map(len, source.text.splitlines())) <= MAX_LINE_LENGTH
    program = parse_program((source,), robot=robot)
    assert not program.diagnostics
    for found, move, row in zip(program.motions, motions, at, strict=True):
        assert (found.kind, found.stops, found.part_in_hand) == (move.kind, move.stops, move.part_in_hand)
        if move.end.T is None:
            np.testing.assert_allclose(found.end.q, move.end.q, atol=2e-7)
            continue
        assert move.speed is None or found.speed == pytest.approx(move.speed)
        np.testing.assert_allclose(found.tool.T, move.tool.T, atol=turn)
        for one, other in ((found.end, move.end), (found.via, move.via)):
            if other is not None:
                np.testing.assert_allclose(found.part.T @ one.T, move.part.T @ other.T, atol=5 * turn)
        if move.kind == "joint" or suffix == ".mod":
            assert found.end.posture.agrees(robot, row[None])[0]


def test_a_measuring_program_in_rapid():
    q = np.radians([[0, -10, 20, 30.5, 40, -50], [10, -10, 20, 30, 40, -50]])
    notes = ["pose 1", "word " * 80 + "\nend"]
    source = compose_program("MEASURE.mod", ROBOT, [motion("axes", q=row) for row in q], notes=notes, wait_s=3.0)
    assert max(map(len, source.text.splitlines())) <= MAX_LINE_LENGTH
    assert not read_rapid([source]).diagnostics
    lines = source.text.split("\r\n")
    assert [line for line in lines if "word" not in line and "! end" not in line] == [
        "MODULE MEASURE",
        "  CONST jointtarget j10:=[[0,-10,20,30.5,40,-50],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];",
        "  CONST speeddata vTool:=[250,500,5000,1000];",
        "  CONST jointtarget j20:=[[10,-10,20,30,40,-50],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];",
        "",
        "  PROC MEASURE_run()",
        *("    ! pose 1", "    MoveAbsJ j10,vTool,fine,tool0;", "    WaitTime 3;"),
        *("    MoveAbsJ j20,vTool,fine,tool0;", "    WaitTime 3;"),
        *("  ENDPROC", "ENDMODULE", ""),
    ]


def test_poses_in_csv_come_back_with_arcs_and_speeds():
    rng = np.random.default_rng(0)
    T = se3.pose(Rotation.random(4, rng=rng).as_matrix(), rng.uniform(-1, 1, (4, 3)))
    motions = [
        motion("joint", T[0]), motion("linear", T[1], speed=0.25, stops=False),
        motion("circular", T[3], via=T[2], speed=0.25, stops=False),
    ]  # fmt: skip
    named = [replace(move, end=replace(move.end, name=f"p{k}")) for k, move in enumerate(motions)]
    again = parse_program((compose_program("path.csv", ROBOT, named),), robot=ROBOT).motions
    for old, new in zip(named, again, strict=True):
        assert (new.kind, new.speed, new.stops, new.end.name) == (old.kind, old.speed, old.stops, old.end.name)
        np.testing.assert_allclose(new.end.T, old.end.T, atol=1e-9)
    np.testing.assert_allclose(again[2].via.T, T[2], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "written", "full"),
    [("p.src", r"#VEL_PTP,(\S+) ", 100.0), ("p.ls", r"J P\[1\] (\S+)%", 100.0), ("p.script", r"v=([\d.]+)", np.radians(120.0))],
)  # fmt: skip
def test_speed_of_the_joints_is_a_share_of_their_largest(name, written, full):
    """In the language's own unit; of the robots that take URScript the slowest joints turn by 120°/s."""
    for share in (0.1, 0.25):
        source = compose_program(name, ROBOT, [motion("axes", q=np.zeros(6))], joint_speed_percent=100.0 * share)
        (stated,) = {float(one) for one in re.findall(written, source.text)}
        assert stated == pytest.approx(share * full, rel=1e-3)


POSE = motion("linear", np.eye(4), part=Frame(name="UFRAME 1", T=np.eye(4)))


@pytest.mark.parametrize(
    ("name", "motions", "says"),
    [
        *((f"{name}.mod", [], "is not a name of a RAPID module") for name in ("3d", "my program", "x" * 29, "module", "größe")),
        ("3d.src", [], "'3d' is not a name of a KRL program"),
        ("a_name_of_more_than_24_letters.src", [], "at most 24"),
        ("1st.ls", [motion("axes", q=np.zeros(6))], "'1st' is not a name of a TP program"),
        ("p.src", [motion("joint", np.eye(4))], "motion 0 drives all joints to a pose and does not say in which posture"),
        ("p.src", [motion("linear", np.eye(4), in_hand=True)], "motion 0 has its part in the robot's hand"),
        ("p.ls", [POSE], "motion 0 goes to a pose in 'UFRAME 1'; a TP program does not state its frames"),
        ("p.csv", [motion("linear", np.eye(4)), POSE, replace(POSE, tool=Frame(name="", T=se3.translation(1e-3)))],
         "has another tool or frame than the first"),
    ],
)  # fmt: skip
def test_what_a_language_cannot_say_is_refused(name, motions, says):
    with pytest.raises(TaskcalError, match=says):
        compose_program(name, ROBOT, motions)


@pytest.mark.parametrize("name", ["a.mod", "a.src"])
def test_a_robot_of_seven_joints_is_refused(name):
    with pytest.raises(TaskcalError, match="six turning axes"):
        compose_program(name, load_robot("barrett-wam"), [])


@pytest.mark.parametrize("name", ["a.apt", "a.dat", "a.sys"])
def test_only_some_languages_are_composed(name):
    with pytest.raises(
        FileError,
        match=r"cannot be composed; programs are written as \.mod, \.prg, \.modx, \.src, \.ls, \.script, \.csv",
    ):
        compose_program(name, ROBOT, ())
