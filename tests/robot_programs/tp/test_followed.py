"""Registers, loops and calls: where motions lead that go to what a program computes, and what is written for them."""

import re

import numpy as np
import pytest
from hypothesis import given, settings

from robot_programs.core.program import Edit, Waypoint
from robot_programs.core.source import Source
from robot_programs.tp.read import TpProgram, read_tp
from taskcal.geometry import se3
from taskcal_groundwork.errors import InputError
from tests.laws.robots import generators
from tests.robot_programs.tp.generator import moved
from tests.robot_programs.tp.samples import R2000, backup, joints, listing, pose, read

SET = ("  UFRAME_NUM=1", "  UTOOL_NUM=1")
UP = tuple(f"  PR[9,{k}]={v}" for k, v in zip(range(1, 7), (100, 200, 350, 180, 0, 0), strict=True))


def heights(program: TpProgram) -> list[tuple[int, float]]:
    """Line and height of each motion, millimetres."""
    return [(move.place.line, round(float(move.end.T[2, 3]) * 1e3, 6)) for move in program.motions]


@pytest.mark.parametrize(
    ("lines", "wanted"),
    [
        (["  PR[9]=P[2]", "  PR[9,3]=PR[9,3]+50", "L PR[9] 9mm/sec FINE"], [350.0]),
        (["  FOR R[1]=2 TO 4", "L P[R[1]] 9mm/sec FINE", "  ENDFOR"], [300.0, 300.0, 300.0]),
        (["  PR[9]=P[2]", "  FOR R[1]=3 DOWNTO 1", "  PR[9,3]=R[1]*10", "L PR[9] 9mm/sec FINE", "  ENDFOR"], [30, 20, 10]),
        (["  R[1]=2", "  WHILE (R[1]>0)", "  PR[9]=P[2]", "  PR[9,3]=R[1]", "L PR[9] 9mm/sec FINE", "  R[1]=R[1]-1",
          "  ENDWHILE"], [2, 1]),
        (["  PR[2,3]=70", "L P[2] 9mm/sec FINE Offset,PR[2]"], [370.0]),
        (["  R[1]=7", "  PR[9]=P[2]", "  IF (R[1]=8 OR !(R[1]>2)) THEN", "  PR[9,3]=1", "  ELSE", "  PR[9,3]=2", "  ENDIF",
          "L PR[9] 9mm/sec FINE"], [2.0]),
        (["  R[2]=3", "  PR[R[2]+1]=P[2]", "  PR[R[2]+1,3]=11", "L PR[4] 9mm/sec FINE"], [11.0]),
        (["  PR[9]=P[2]", "  IF DI[1]=ON,CALL OTHER", "L P[2] 9mm/sec FINE"], [300.0]),
    ],
)  # fmt: skip
def test_what_a_program_computes_is_followed(lines: list[str], wanted: list[float]):
    program = read(*SET, *lines)
    assert [height for _, height in heights(program)] == wanted
    assert not any("None" in move.end.name for move in program.motions)
    assert not [one for one in program.diagnostics if one.unread]


@pytest.mark.parametrize(
    ("lines", "reason"),
    [
        (["  PR[9]=P[2]", "  PR[9,3]=R[7]", "L PR[9] 9mm/sec FINE"], r"PR\[9\] is set in the program"),
        (["  PR[9]=P[2]", "  IF DI[1]=ON,PR[9,3]=1", "L PR[9] 9mm/sec FINE"], r"PR\[9\] is set in one branch of the IF"),
        (["  PR[9]=P[2]", "  CALL OTHER", *SET, "L PR[9] 9mm/sec FINE"], r"PR\[9\] may be set by OTHER, which is called before"),
        (["  PR[9]=P[2]", "  PR[R[7],3]=1", "L PR[9] 9mm/sec FINE"], r"PR\[9\] is set in the program"),
        (["  PR[9]=P[2]", "  RUN OTHER", *SET, "L PR[9] 9mm/sec FINE"], r"PR\[9\] "),
        (["  PR[9]=P[2]", "  PR[9,3]=PR[9,3+", "L PR[9] 9mm/sec FINE"], r"PR\[9\] is set in the program"),
        (["  PR[9]=P[2]", "  UFRAME_NUM[GP1]=R[7]", "L PR[9] 9mm/sec FINE"], "counts from the active UFRAME"),
        ([*UP, "L PR[9] 9mm/sec FINE"], "whether of a pose or of joints is not known"),
        (["  IF PR[5,1]>0,JMP LBL[1]", "  PR[9]=P[2]", "  LBL[1]", "L PR[9] 9mm/sec FINE"], r"PR\[9\] is not known|is set"),
        (["  FOR R[1]=1 TO 2", "  ENDFOR", "L P[R[1]] 9mm/sec FINE"], "index is computed at run time"),
        (["  R[1]=PR[5,1]/60", "L P[R[1]] 9mm/sec FINE"], "index is computed at run time"),
        (["  PR[9]=5", "L PR[9] 9mm/sec FINE"], r"PR\[9\] is no position"),
    ],
)  # fmt: skip
def test_what_is_not_decided_stays_with_its_reason(lines: list[str], reason: str):
    program = read(*SET, *lines)
    assert program.motions == ()
    (text,) = [one.text for one in program.diagnostics if one.unread]
    assert re.search(reason, text), text


def test_a_register_of_the_backup_that_sets_a_frame_is_taken_as_it_states_it():
    program = read("  UFRAME[1]=PR[5]", "L P[2] 10mm/sec FINE")
    (move,) = program.motions
    R = se3.rotation("z", np.radians(15.0)) @ se3.rotation("x", np.pi)
    np.testing.assert_allclose(move.part.T, se3.translation(0.12, 0.03, 0.25 + 0.67) @ R, atol=1e-12)
    (said,) = program.diagnostics
    assert "posreg.va" in said.text


def files(**instructions: list[str]) -> TpProgram:
    positions = {str(k): pose(100.0 * k, 0.0, 300.0) for k in range(1, 5)}
    sources = [listing(lines, positions, name) for name, lines in instructions.items()]
    return read_tp([*sources, *backup()], robot=R2000)


@pytest.mark.parametrize(
    "between",
    [
        "  VISION GET_OFFSET 'PART' VR[1] JMP LBL[1]", "  WAIT DI[1]=ON TIMEOUT,LBL[1]", "  IF DI[1]=ON,JMP LBL[R[7]]",
        "  Search Start[1] PR[9]", "L P[3] 9mm/sec FINE Skip,LBL[1]", "L P[3] 9mm/sec FINE Skip,LBL[3],PR[9]=LPOS",
        "L P[3] 9mm/sec FINE INC Skip,LBL[3],PR[9]=LPOS", "  UFRAM_NUM=2", "  FOO[1]=2", "  PAUSE", "  $MNUFRAMENUM[1]=2",
        "  IF DI[1]=ON,UFRAME_NUM=2", "  PR[GP2:9]=LPOS", "  RUN SR[1]", "L PAL_1[A_1] 9mm/sec FINE",
        "  WHEN DI[1]=ON,CALL OTHER", "  CALL OTHER(", "  IF (DI[1]=ON) THEN", "  SELECT R[7]=1,JMP LBL[1]",
    ],
)  # fmt: skip
def test_what_may_change_a_register_or_a_frame_or_lead_elsewhere_counts(between: str):
    lines = [*SET, "  PR[9]=P[2]", "L P[2] 9mm/sec FINE", between, "  PR[9,3]=7", "  LBL[1]", "L PR[9] 9mm/sec FINE"]
    program = read(*lines)
    assert 13 not in {move.place.line for move in program.motions}
    assert 13 in {one.place.line for one in program.diagnostics if one.unread}


@pytest.mark.parametrize(
    "between",
    [
        "  SPOT[SD=1,P=2,t=2.0]", "  WAIT   .50(sec)", "  DO[1:it's]=ON", "  Arc Start[1,24.0Volts]", "  TIMER[1]=START",
        "  OVERRIDE=50%", "  LOCK PREG", "  F[1]=(ON)", "  OFFSET CONDITION PR[2]", "  MESSAGE[P[1]=CALL]",
        "  --eg:JMP LBL[1]", "  UFRAME_NUM[GP2]=3", "  GO[1]=R[7]", "  $WEAVE=1", "  PAYLOAD[R[7]]",
    ],
)  # fmt: skip
def test_what_changes_none_of_them_is_passed_over(between: str):
    program = read(*SET, "  PR[9]=P[2]", "L P[2] 9mm/sec FINE", between, "  PR[9,3]=7", "L PR[9] 9mm/sec FINE")
    assert [height for _, height in heights(program)] == [300.0, 7.0]
    assert [move.follows for move in program.motions] == [None, 0]


def test_every_line_of_a_motion_is_read_or_left_with_a_reason():
    """Even behind blocks that are opened or closed once too often, and labels that are there twice."""
    rng = np.random.default_rng(5)
    for _ in range(150):
        kinds = [
            "  IF (DI[1]) THEN", "  ELSE", "  ENDIF", "  FOR R[1]=1 TO 2", "  ENDFOR", "  WHILE (DI[2])", "  ENDWHILE",
            "  LBL[1]", "  LBL[2]", "  JMP LBL[1]", "  IF DI[1]=ON,JMP LBL[2]", "  END", "  SELECT R[1]=1,JMP LBL[1]",
            "  =2,JMP LBL[2]", "  ELSE,JMP LBL[3]", "  IF (", "  LBL[", "  CALL SR[1]", "  CALL MILL", "  ABORT",
        ]  # fmt: skip
        lines = [str(rng.choice(kinds)) if rng.random() < 0.6 else "L P[2] 9mm/sec FINE" for _ in range(14)]
        program = read(*SET, *lines)
        found = {move.place.line for move in program.motions}
        found |= {one.place.line for one in program.diagnostics if one.unread}
        assert found == {k + 8 for k, line in enumerate(lines) if line.startswith("L P")}, lines


# Writing.


def random_program(rng: np.random.Generator) -> list[Source]:
    """Positions that are shared by motions, loops and registers; and a program that is given the number of one of its own."""
    one = lambda *choices: choices[int(rng.integers(len(choices)))]  # noqa: E731
    P = lambda: int(rng.integers(1, 6))  # noqa: E731
    lines = [*SET]
    for _ in range(int(rng.integers(2, 7))):
        match one("plain", "offset", "register", "loop", "shifted", "called", "arc", "computed"):
            case "plain":
                lines.append(f"L P[{P()}] 9mm/sec FINE")
            case "offset":
                lines.append(f"L P[{P()}] 9mm/sec FINE {one('Offset', 'Tool_Offset')},PR[2]")
            case "register":
                lines += [f"  PR[9]=P[{P()}]", f"  PR[9,3]=PR[9,3]+{P()}", "L PR[9] 9mm/sec FINE"]
            case "loop":
                first = int(rng.integers(1, 4))
                lines += [
                    f"  FOR R[1]={first} TO {first + int(rng.integers(0, 3))}",
                    "L P[R[1]] 9mm/sec FINE",
                    "  ENDFOR",
                ]
            case "shifted":
                lines += [
                    "  PR[7]=PR[2]",
                    "  FOR R[1]=1 TO 2",
                    "  PR[7,1]=10*R[1]",
                    f"L P[{P()}] 9mm/sec FINE Offset,PR[7]",
                    "  ENDFOR",
                ]
            case "called":
                lines.append(f"  CALL SUB({P()})")
            case "arc":
                lines.append(f"C P[{P()}]\r\n    :  P[{P()}] 9mm/sec FINE")
            case _:
                lines.append("L P[R[50]] 9mm/sec FINE")
    positions = {str(k): pose(100.0 * k, float(rng.integers(-50, 50)), 300.0) for k in range(1, 6)}
    own = {str(k): pose(50.0 * k, 10.0, 200.0) for k in range(1, 6)}
    return [
        listing(lines, positions),
        listing(["L P[AR[1]] 9mm/sec FINE", "L P[1] 9mm/sec FINE"], own, "SUB"),
        *backup(),
    ]


@settings(max_examples=150)
@given(generators)
def test_what_is_written_leads_where_it_should_and_nothing_else_moves(rng: np.random.Generator):
    """Of motions that share text or positions, those that can be written get their own; all others stay where they were."""
    program = read_tp(random_program(rng), robot=R2000)
    alike = rng.random() < 0.5
    shift = rng.uniform(-1e-3, 1e-3, 3)
    waypoints = {
        number: (moved(move, shift if alike else rng.uniform(-1e-3, 1e-3, 3), np.zeros(3)),)
        for number, move in enumerate(program.motions)
        if rng.random() < 0.7
    }
    refused = dict[int, str]()
    while more := program.unwritable(R2000, waypoints, 1e-5):
        refused |= more
        waypoints = {number: path for number, path in waypoints.items() if number not in more}
    assert all("its text stands for" in why for why in refused.values())
    assert all(program.motions[number].texts_motions > 1 for number in refused)
    again = program.reread(program.rewrite(R2000, waypoints))
    assert len(again.motions) == len(program.motions)
    for number, (old, new) in enumerate(zip(program.motions, again.motions, strict=True)):
        wanted = waypoints.get(number, (moved(old, np.zeros(3), np.zeros(3)),))[0]
        np.testing.assert_allclose(new.end.T, wanted.T, atol=1e-6)
        if old.via is not None:
            np.testing.assert_allclose(new.via.T, wanted.via.T, atol=1e-6)
        assert (new.part.name, new.tool.name) == (old.part.name, old.tool.name)


def test_positions_of_a_loop_change_in_their_place():
    program = read(*SET, "  FOR R[1]=2 TO 4", "L P[R[1]] 9mm/sec FINE", "  ENDFOR")
    paths = {k: (moved(move, np.array([1e-3 * (k + 1), 0, 0]), np.zeros(3)),) for k, move in enumerate(program.motions)}
    assert not program.unwritable(R2000, paths, 1e-5)
    text = program.rewrite(R2000, paths)[0].text
    assert "L P[R[1]] 9mm/sec FINE" in text
    assert "P[6" not in text
    some = {0: paths[0]}
    assert not program.unwritable(R2000, some, 1e-5)  # of the others each has a position of its own


def test_a_position_of_a_loop_that_others_need_stays():
    program = read(
        *SET, "  FOR R[1]=2 TO 4", "L P[R[1]] 9mm/sec FINE", "  ENDFOR", "  PR[9]=P[3]", "L PR[9] 9mm/sec FINE"
    )
    paths = {k: (moved(move, np.array([1e-3, 0, 0]), np.zeros(3)),) for k, move in enumerate(program.motions[:3])}
    assert program.unwritable(R2000, paths, 1e-5) == {
        1: "its text stands for 3 motions, and the numbers in mill.ls:26 have to stay for mill.ls:11"
    }


def test_a_position_that_is_copied_to_a_register_keeps_its_numbers_for_it():
    program = read(*SET, "L P[2] 9mm/sec FINE", "  PR[9]=P[2]", "L PR[9] 9mm/sec FINE")
    again = program.with_edits([Edit(motion=0, T=program.motions[0].end.T @ se3.translation(1e-3))])
    assert "L P[6] 9mm/sec" in again.sources[0].text
    again = program.with_edits([Edit(motion=1, T=program.motions[1].end.T @ se3.translation(1e-3))])
    assert "L P[6] 9mm/sec" in again.sources[0].text
    np.testing.assert_allclose(again.motions[0].end.T, program.motions[0].end.T)


def test_the_speed_of_a_register_is_known_and_stays_there():
    program = read(*SET, "  R[3]=250", "L P[2] R[3:v]mm/sec FINE")
    assert program.motions[0].speed == pytest.approx(0.25)
    with pytest.raises(InputError, match="stated before it"):
        program.with_edits([Edit(motion=0, speed=0.1)])


def test_joints_in_registers_are_followed():
    program = read(*SET, "  PR[9]=P[1]", "J PR[9] 9% FINE", positions={"1": joints(0, 10, -20, 0, -60, 0)})
    (move,) = program.motions
    np.testing.assert_allclose(move.end.q, np.radians([0, 10, -20, 0, -60, 0]))
    path = Waypoint(kind="axes", q=move.end.q + 0.01, T=None)
    again = program.reread(program.rewrite(R2000, {0: (path,)}))
    np.testing.assert_allclose(again.motions[0].end.q, path.q, atol=1e-6)


def test_a_position_that_a_register_gets_by_a_computed_number_stays():
    """Whichever position it is: the motion to the register, which is left, goes where it did."""
    program = read(
        *SET, "L P[2] 9mm/sec FINE", "  FOR R[1]=2 TO 3", "  PR[9]=P[R[1]]", "L PR[9] 9mm/sec FINE", "  ENDFOR"
    )
    again = program.reread(
        program.rewrite(R2000, {0: (moved(program.motions[0], np.array([1e-3, 0, 0]), np.zeros(3)),)})
    )
    shifts = [1e3 * (new.end.T - old.end.T)[0, 3] for new, old in zip(again.motions, program.motions, strict=True)]
    assert shifts == pytest.approx([1.0, 0.0, 0.0])
