"""FANUC's world frame, and frames by number."""

import numpy as np
import pytest
from hypothesis import given

from robot_programs.core.program import Frame, Unresolved, missing_from
from robot_programs.core.values import Lost
from robot_programs.tp.listing import read_variables
from robot_programs.tp.lower import SET
from robot_programs.tp.meaning import GivenFrames, ProgramFrames, world_in_base
from robot_programs.tp.read import read_tp
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal_groundwork.errors import InputError
from tests.laws.robots import generators
from tests.robot_programs.tp.samples import R2000, backup, listing, pose


@pytest.mark.parametrize(
    ("name", "height_mm"),
    [("fanuc-r2000ic-165f", 670.0), ("abb-irb120", 290.0), ("fanuc-lrmate-200id", 0.0), ("fanuc-m20ia", 0.0)],
)
def test_the_world_lies_on_axis_1_at_the_height_of_axis_2(name, height_mm):
    np.testing.assert_allclose(world_in_base(load_robot(name)), se3.translation(z=height_mm * 1e-3), atol=1e-9)


def test_an_arm_of_parallel_axes_has_none():
    with pytest.raises(TaskcalError, match=r"has no two turning axes|are parallel"):
        world_in_base(load_robot("denso-hsr065a1"))


def frames(**given: Frame | None) -> ProgramFrames:
    return ProgramFrames(
        variables=read_variables(backup()),
        T_base_world=world_in_base(R2000),
        tools=GivenFrames(alone=given.get("tool")),
        parts=GivenFrames(alone=given.get("part")),
    )


def test_user_frames_are_counted_in_the_world():
    known = frames()
    np.testing.assert_allclose(known.user_frame(1).T[:3, 3], [1.5, -0.2, 0.07])
    np.testing.assert_allclose(known.user_frame(0).T, se3.translation(z=0.67), atol=1e-12)
    assert known.user_frame(1) is known.user_frame(1)
    table = frames(part=Frame(name="table", T=se3.translation(1.0))).user_frame(7)
    assert table.name == "table"
    np.testing.assert_allclose(table.T[:3, 3], [1.0, 0.0, 0.67])


def test_frames_that_are_not_known_say_what_would_work():
    with pytest.raises(Unresolved, match=r"UFRAME 7 is not known; pass the backup's sysframe.va .* \(--part\)"):
        frames().user_frame(7)
    with pytest.raises(Unresolved, match=r"UFRAME\[2\] is set in the program"):
        frames().user_frame(2, Lost(reason=SET))
    with pytest.raises(Unresolved, match=r"UTOOL\[1\] is set in the program"):
        frames().tool_frame(1, Lost(reason=SET))


SPELLED = ["{} {}", "{}_{}", "{}[{}]"]


@given(generators)
def test_a_given_frame_stands_for_one_number(rng: np.random.Generator):
    """A motion is read by the frames of its own numbers, or left with the names of those that are missing."""
    numbers = {kind: [int(n) for n in rng.integers(1, 5, 6)] for kind in ("UTOOL", "UFRAME")}
    at = lambda kind, n: se3.translation(0.01 * n, 0.1 * (kind == "UTOOL"))  # noqa: E731
    lines, positions = [], {}
    for k, (tool, frame) in enumerate(zip(numbers["UTOOL"], numbers["UFRAME"], strict=True), start=1):
        lines += [f"  UFRAME_NUM={frame}", f"  UTOOL_NUM={tool}", f"L P[{k}] 100mm/sec FINE"]
        positions[str(k)] = pose(100.0 + k, 200.0, 300.0, frames=f"UF : {frame}, UT : {tool}")
    named, alone, known = {}, {}, {}
    for kind, used in numbers.items():
        known[kind] = {n: f"{kind} {n}" for n in set(used) if rng.random() < 0.5}
        known[kind] = {n: str(rng.choice(SPELLED)).format(kind, n) for n in known[kind]}
        named[kind] = {name: Frame(name=name, T=at(kind, n)) for n, name in known[kind].items()}
        alone[kind] = Frame(name="any", T=np.eye(4)) if rng.random() < 0.7 else None
        rest = set(used) - set(known[kind])
        if alone[kind] is not None and len(rest) == 1:
            known[kind][rest.pop()] = "any"
    program = read_tp(
        [listing(lines, positions)], robot=R2000,
        tool=alone["UTOOL"], part=alone["UFRAME"], tools=named["UTOOL"], parts=named["UFRAME"],
    )  # fmt: skip
    pairs = list(zip(numbers["UTOOL"], numbers["UFRAME"], strict=True))
    wanted = [(known["UTOOL"][t], known["UFRAME"][f]) for t, f in pairs if t in known["UTOOL"] and f in known["UFRAME"]]
    assert [(move.tool.name, move.part.name) for move in program.motions] == wanted
    for move in program.motions:
        if move.tool.name != "any":
            np.testing.assert_allclose(move.tool.T, named["UTOOL"][move.tool.name].T)
        if move.part.name != "any":
            np.testing.assert_allclose(move.part.T, world_in_base(R2000) @ named["UFRAME"][move.part.name].T)
    missing = {one.name: (one.kind, one.count) for one in missing_from(program.diagnostics)}
    assert missing == {
        f"{kind} {n}": ({"UTOOL": "tool", "UFRAME": "part"}[kind], used.count(n))
        for kind, used in numbers.items()
        for n in set(used) - set(known[kind])
    }
    again = program.read(program.sources)
    assert [(move.tool.name, move.part.name) for move in again.motions] == wanted


def test_a_name_with_a_number_stands_for_that_one():
    positions = {str(n): pose(100.0, 200.0, 300.0, frames=f"UF : 1, UT : {n}") for n in (2, 3)}
    sources = [
        listing(
            ["  UFRAME_NUM=1", *(x for n in (2, 3) for x in (f"  UTOOL_NUM={n}", f"L P[{n}] 9mm/sec FINE"))], positions
        )
    ]
    program = read_tp([*sources, *backup()], robot=R2000, tool=Frame(name="UTOOL 3", T=np.eye(4)))
    assert [move.tool.name for move in program.motions] == ["UTOOL 3"]
    assert [one.name for one in missing_from(program.diagnostics)] == ["UTOOL 2"]


@pytest.mark.parametrize(
    ("tools", "message"),
    [
        (["UTOOL 1"], "the files have UTOOL 1 304"),
        (["UTOOL 0"], ""),
        (["UTOOL 2", "utool_2"], "UTOOL 2 is given twice"),
    ],
)
def test_a_frame_is_given_once(tools: list[str], message: str):
    named = {name: Frame(name=name, T=np.eye(4)) for name in tools}
    sources = [listing(["L P[1] 9mm/sec FINE"], {"1": pose(100.0, 200.0, 300.0)}), *backup()]
    if not message:
        assert read_tp(sources, robot=R2000, tools=named).motions
        return
    with pytest.raises(InputError, match=message):
        read_tp(sources, robot=R2000, tools=named)


def placed(values: list[float]) -> np.ndarray:
    """X Y Z W P R, millimetres and degrees."""
    x, y, z, w, p, r = values
    R = se3.rotation("z", np.radians(r)) @ se3.rotation("y", np.radians(p)) @ se3.rotation("x", np.radians(w))
    return se3.translation(x * 1e-3, y * 1e-3, z * 1e-3) @ R


VALUES = [10.5, -20.0, 30.0, 40.0, -50.0, 60.0]


def components(*which: int) -> list[str]:
    """What sets components of register 2 to numbers, in both ways of writing them."""
    return [
        f"  PR[2,{j}]={v}" if j % 2 else f"  PR[GP1:2:place,{j}]=({v})" for j, v in enumerate(VALUES, 1) if j in which
    ]


@pytest.mark.parametrize("kind", ["UFRAME", "UTOOL"])
@pytest.mark.parametrize(
    ("lines", "known"),
    [
        (components(*range(1, 7)), True),
        (components(1, 2, 3, 4, 5), False),
        ([*components(*range(1, 7)), "  PR[2]=LPOS"], False),
        (["  PR[2]=LPOS", *components(*range(1, 7))], True),
        ([*components(*range(1, 7)), "  IF R[1]=1,PR[2,2]=R[2]"], False),
        ([*components(1, 2, 3, 5, 6), "  IF R[1]=1,JMP LBL[1]", *components(4), "  LBL[1]"], False),
    ],
)
def test_frame_of_a_register_is_known_whose_components_all_are(kind: str, lines: list[str], known: bool):
    """Whatever registers and frames held before; on branches as `test_interpreters` has them."""
    other = "UTOOL" if kind == "UFRAME" else "UFRAME"
    whole = [line.replace("PR[2", "PR[3").replace("GP1:2", "GP1:3") for line in components(*range(1, 7))]
    sets = [*whole, f"  {other}[1]=PR[3]", *lines, f"  {kind}[1]=PR[2]"]
    program = read_tp(
        [listing([*sets, "  UFRAME_NUM=1", "  UTOOL_NUM=1", "L P[1] 9mm/sec FINE"], {"1": pose(1, 2, 3)})], robot=R2000
    )
    assert len(program.motions) == known
    for move in program.motions:
        np.testing.assert_allclose(move.part.T, world_in_base(R2000) @ placed(VALUES), atol=1e-12)
        np.testing.assert_allclose(move.tool.T, placed(VALUES), atol=1e-12)


@pytest.mark.parametrize("between", ["  CALL INSIDE", "  RUN INSIDE"])
def test_what_another_program_may_have_set_is_not_known(between: str):
    sets = [f"  PR[2,{j}]={j}.5" for j in range(1, 7)]
    lines = [
        *sets,
        "  UFRAME[1]=PR[2]",
        "  UTOOL[1]=PR[2]",
        "  UFRAME_NUM=1",
        "  UTOOL_NUM=1",
        "L P[1] 9mm/sec FINE",
        between,
        "L P[2] 9mm/sec FINE",
    ]
    positions = {str(k): pose(100.0, 200.0, 300.0) for k in (1, 2)}
    inside = listing(["  UFRAME[1]=PR[3]"], {}, "INSIDE")
    for sources, known in (([], 2 if "CALL" in between else 0), ([inside], 1 if "CALL" in between else 0)):
        program = read_tp([listing(lines, positions), *sources], robot=R2000)
        assert len(program.motions) == known
        assert all("is set in the program" in one.text for one in program.diagnostics if one.unread)
