import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.program import rotation
from robot_programs.krl.points import StatusTurn
from robot_programs.krl.read import read_krl
from taskcal.errors import FileError
from tests.laws.robots import generators
from tests.robot_programs.krl.generator import generate
from tests.robot_programs.krl.samples import CONFIG_DAT, FRAMES, POSE, handling, milling, read, source, texts


def frame(x: float, y: float, z: float, A: float, B: float, C: float) -> np.ndarray:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = rotation(float(A), float(B), float(C)), np.array([x, y, z]) / 1e3
    return T


TOOL1, BASE2 = frame(12.5, -3.25, 180, 0, 0, 0), frame(400, 150, 300, 15, 0.5, -0.25)


def test_the_reorientation_speed_is_vel_ori1():
    lines = [
        "$VEL.ORI1=200", "$VEL.CP=0.1", f"LIN {POSE}", "$VEL={CP 0.2,ORI1 50.0,ORI2 50.0}", f"LIN {POSE}", f"PTP {POSE}",
        "$VEL.ORI1=speed_now", f"LIN {POSE}",
    ]  # fmt: skip
    program = read_krl([source("part.src", "DEF PART( )\n" + FRAMES + "\n".join(lines) + "\nEND\n")])
    assert [m.kind for m in program.motions] == ["linear", "linear", "joint", "linear"]
    expected = [200.0, 50.0, None, None]
    assert [m.turn_speed for m in program.motions] == [
        None if v is None else pytest.approx(np.radians(v)) for v in expected
    ]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_a_program_of_inline_forms(newline):
    program = read_krl(handling(newline))
    assert [(m.kind, m.end.name, m.end.place.line, m.stops, m.follows) for m in program.motions] == [
        ("axes", "XHOME", 11, True, None),
        ("joint", "XP1", 8, False, 0),
        ("linear", "XP2", 11, True, 1),
        ("linear", "XP2", 11, True, 2),
        ("circular", "XP4", 15, False, 3),
        ("linear", "XP5", 16, True, 4),
        ("linear", "XP1", 8, True, None),
        ("linear", "", 49, True, 6),
    ]
    assert [m.speed for m in program.motions] == [None, None, 0.5, 0.5, 0.2, 2.0, 0.2, 0.2]
    for move in program.motions[1:]:
        np.testing.assert_allclose(move.tool.T, TOOL1)
        np.testing.assert_allclose(move.part.T, BASE2)
        assert not move.part_in_hand
    assert (program.motions[1].tool.name, program.motions[1].part.name) == ("TOOL_DATA[1]", "BASE_DATA[2]")
    assert program.motions[1].end.posture == StatusTurn(S=2, T=3)
    assert program.motions[2].end.posture is None
    P2 = frame(812.512573, -120.25, 140, 178.5, 2.25, -179.125)
    np.testing.assert_allclose(program.motions[2].end.T, P2)
    np.testing.assert_allclose(program.motions[3].end.T, P2 @ frame(0, 0, 50, 0, 0, 0))
    assert program.motions[4].via is not None
    np.testing.assert_allclose(program.motions[4].via.T[:3, 3], [0.85, -0.06, 0.14])
    assert texts(program) == [
        "handling.src:47: GRIPPER_OPEN is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are",
    ]


def test_a_program_of_a_postprocessor():
    program = read_krl(milling())
    assert [m.kind for m in program.motions] == ["axes", "joint", "linear", "linear", "circular", "linear"]
    assert [m.end.place.line for m in program.motions] == [8, 9, 10, 11, 12, 16]
    first = program.motions[0].end
    assert first.q is not None
    np.testing.assert_allclose(np.degrees(first.q), [5, -80, 100, 0, 45, 0])
    assert program.motions[1].end.posture == StatusTurn(S=6, T=50)
    arc = program.motions[4]
    assert arc.via is not None
    np.testing.assert_allclose(arc.via.T, frame(175, -25, 100, 180, 0, 180), atol=1e-15)
    assert [m.follows for m in program.motions] == [None, 0, 1, 2, 3, None]
    assert texts(program) == [
        "MILLING.SRC:13: CIRC stays as it is: its points and its start are on no circle on which CA would count",
        "MILLING.SRC:14: LIN stays as it is: Y is not stated, and it counts from where the motion before ended, and that is not "
        "known",
    ]


def test_what_the_robot_holds_follows_from_tool_and_base():
    program = read(f"{FRAMES}LIN {POSE}")
    (move,) = program.motions
    assert move.end.T is not None
    np.testing.assert_allclose(move.flange(move.end.T)[:3, 3], [0.8, 0, 0.8], atol=1e-15)


@pytest.mark.parametrize(
    "body",
    [
        "FDAT_ACT=FP1\nBAS(#CP_PARAMS,0.1)",
        "FDAT_ACT={TOOL_NO 1,BASE_NO 2,IPO_FRAME #TCP}\nBAS(#FRAMES)",
        "$IPO_MODE=#TCP\n$TOOL=TOOL_DATA[1]\n$BASE=BASE_DATA[2]",
        "$TOOL=BASE_DATA[2]\n$BASE=TOOL_DATA[1]\n$IPO_MODE=#TCP",
    ],
)
def test_a_fixed_tool_is_a_base_and_the_part_in_hand_a_tool(body):
    program = read(f"{body}\nLIN {POSE}", dat="DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #TCP}")
    (move,) = program.motions
    assert move.part_in_hand
    np.testing.assert_allclose(move.part.T, TOOL1)
    np.testing.assert_allclose(move.tool.T, BASE2)
    assert move.end.T is not None
    # the tool's pose in the part is the pose that is stated
    flange = move.flange(move.end.T)
    np.testing.assert_allclose(np.linalg.inv(flange @ TOOL1) @ BASE2, move.end.T, atol=1e-12)


def test_a_fixed_tool_of_no_table_is_not_guessed():
    program = read(f"$IPO_MODE=#TCP\n{FRAMES}LIN {POSE}")
    assert not program.motions
    assert "$IPO_MODE is #TCP, and which frame is the part's" in texts(program)[0]


def test_the_robots_place_in_the_world_counts():
    machine = "DEFDAT $MACHINE\n$ROBROOT={X 100,Y 0,Z 50,A 90,B 0,C 0}\nENDDAT\n"
    body = f"DEF PART( )\n$TOOL=$NULLFRAME\n$BASE=BASE_DATA[1]\nLIN {POSE}\n$BASE=$ROBROOT\nLIN {POSE}\nEND\n"
    program = read_krl([source("part.src", body), source("$machine.dat", machine), source("$config.dat", CONFIG_DAT)])
    world, own = program.motions
    np.testing.assert_allclose(
        world.part.T, np.linalg.inv(frame(100, 0, 50, 90, 0, 0)) @ frame(900, 0, 400, 0, 0, 0), atol=1e-12
    )
    np.testing.assert_allclose(own.part.T, np.eye(4), atol=1e-12)


def test_joint_positions_need_no_frames():
    (move,) = read("PTP {A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}").motions
    assert move.kind == "axes"


def test_an_absolutely_accurate_controller_is_pointed_out():
    pose = POSE.replace("}", ",S 18,T 2}")
    program = read(f"{FRAMES}PTP {pose}\n$ABS_ACCUR=TRUE")
    assert [diagnostic.place.line for diagnostic in program.diagnostics] == [4, 5]
    assert all("correct twice" in str(diagnostic) for diagnostic in program.diagnostics)


def test_a_trigger_before_a_motion_is_pointed_out():
    program = read(f"{FRAMES}TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[1]=TRUE\nLIN {POSE}\nLIN {POSE}")
    assert len(program.motions) == 2
    (diagnostic,) = program.diagnostics
    assert (diagnostic.place.line, "TRIGGER" in diagnostic.text) == (5, True)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("part.src", "hello\n", r"part\.src: is not a KRL file: no DEF line"),
        ("part.dat", "DECL INT I\n", r"part\.dat: is not a KRL file: no DEFDAT line"),
        ("part.dat", "DEFDAT PART\nENDDAT\n", r"part\.dat: holds data only; pass the \.src"),
        ("part.src", "", "is not a KRL file"),
    ],
)
def test_files_that_are_no_program_are_refused(name, text, message):
    with pytest.raises(FileError, match=message):
        read_krl([source(name, text)])


@pytest.mark.parametrize(
    ("body", "line", "where"),
    [
        (f"{FRAMES}LIN {POSE}\nEND\nLIN {POSE}", 6, "outside of any routine"),
        (f"{FRAMES}SWITCH 1\nCASE1\nLIN {POSE}\nDEFAULT\nLIN {POSE}\nENDSWITCH", 6, "where no line is run"),
    ],
)
def test_a_motion_that_nothing_runs_is_named(body, line, where):
    program = read(body)
    assert len(program.motions) == 1
    (said,) = (diagnostic for diagnostic in program.diagnostics if diagnostic.unread)
    assert (said.place.line, where in said.text) == (line, True)


@given(generators)
def test_every_motion_of_a_program_is_resolved(rng):
    generated = generate(rng)
    program = read_krl(generated.sources)
    assert len(program.motions) == generated.motions
    assert not program.diagnostics
