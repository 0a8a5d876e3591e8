"""Bases that move, as KUKA's bas.src sets them: EX_BASE by EK, LK_BASE by LK, and FRAMES by what $config.dat says of a base."""

import numpy as np
import pytest

from tests.robot_programs.fuzz import nearby
from tests.robot_programs.krl.samples import CONFIG_DAT, POSE, ROBOT, read, texts

TOOL = "$TOOL=TOOL_DATA[1]\n"
ON_EXTERNAL = "MACHINE_DEF[2].ROOT,MACHINE_DEF[2].MECH_TYPE"
INLINE = f"FDAT_ACT={{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}}\nBAS(#CP_PARAMS,0.1)\nLIN {POSE}"


def config(kind: str, controller: int = 1, index: int = 2) -> str:
    lines = (
        f'MACHINE_FRAME_DAT[2]={{MACH_DEF_INDEX {index},PARENT[] "T",GEOMETRY[] " "}}\n'
        f'MACHINE_DEF[2]={{NAME[] "T",COOP_KRC_INDEX {controller},PARENT[] "WORLD",ROOT {{X 1200.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}},'
        f'MECH_TYPE {kind},GEOMETRY[] " "}}\n'
    )
    return CONFIG_DAT.replace("ENDDAT", f"{lines}ENDDAT")


@pytest.mark.parametrize(
    "line",
    [
        f"$BASE=EK({ON_EXTERNAL},BASE_DATA[2])\nLIN {POSE}",
        f"$base = ek( {ON_EXTERNAL} , base_data[2] )\nLIN {POSE}",
        f"LIN {POSE} WITH $BASE=EK({ON_EXTERNAL},BASE_DATA[2])",
    ],
)
def test_a_base_by_ek_is_in_what_the_external_axis_carries(line):
    """EX_BASE of bas.src is this assignment."""
    program = read(TOOL + line)
    (by_function,), (by_number,) = program.motions, read(f"{TOOL}BAS(#EX_BASE,2)\nLIN {POSE}").motions
    assert by_function.carrier == by_number.carrier == "an external kinematic system"
    assert (by_function.part.name, by_function.part.T.tobytes()) == (by_number.part.name, by_number.part.T.tobytes())
    assert program.rewrite(ROBOT, {})[0].text == program.sources[0].text
    waypoint = nearby(np.random.default_rng(1), by_function)
    (again,) = program.reread(program.rewrite(ROBOT, {0: (waypoint,)})).motions
    assert again.carrier
    np.testing.assert_allclose(again.end.T, waypoint.T, atol=2e-8)


def test_the_frame_of_ek_may_be_computed_or_left_out():
    (plain,) = read(f"{TOOL}$BASE=EK({ON_EXTERNAL})\nLIN {POSE}").motions
    assert plain.carrier
    np.testing.assert_array_equal(plain.part.T, np.eye(4))
    (moved,) = read(
        f"{TOOL}$BASE=EK({ON_EXTERNAL},{{X 5,Y 0,Z 0,A 0,B 0,C 0}}:{{X 1,Y 0,Z 0,A 0,B 0,C 0}})\nLIN {POSE}"
    ).motions
    np.testing.assert_allclose(moved.part.T[:3, 3], [0.006, 0, 0], atol=1e-15)
    behind = read(f"{TOOL}$BASE=EK({ON_EXTERNAL})\nLIN {POSE}\n$BASE=BASE_DATA[2]\nLIN {POSE}").motions
    assert [bool(move.carrier) for move in behind] == [True, False]


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("$BASE=LK(MACHINE_DEF[2].ROOT,$COOP_KRC[2].IP_ADDR[],BASE_DATA[2],#ROBOT)", "linked by LK to another robot"),
        (f"$BASE=EB({ON_EXTERNAL},BASE_DATA[2])", "linked by EB to a conveyor"),
        (f"$BASE=EK({ON_EXTERNAL},BASE_DATA[2]):{{X 1}}", "write EK(root, kinematic system, frame)"),
        ("$BASE=EK(BASE_DATA[2])", "write EK(root, kinematic system, frame)"),
        (f"$BASE=EK({ON_EXTERNAL},BASE_DATA[9])", "BASE_DATA[9] is not in the files given"),
    ],
)
def test_what_else_moves_a_base_is_named(line, reason):
    program = read(f"{TOOL}{line}\nLIN {POSE}")
    assert not program.motions
    assert reason in texts(program)[-1]
    assert program.rewrite(ROBOT, {})[0].text == program.sources[0].text


@pytest.mark.parametrize(
    ("kind", "controller", "index", "carried"),
    [("#EASYS", 1, 2, True), ("#EFSYS", 1, 2, True), ("#NONE", 0, 2, False), ("#ROBOT", 1, 2, False), ("#EASYS", 1, 0, False)],
)  # fmt: skip
def test_inline_form_base_is_on_its_mechanism(kind, controller, index, carried):
    """The base of an inline form is on what the controller says."""
    (move,) = read(INLINE, config=config(kind, controller, index)).motions
    assert bool(move.carrier) == carried
    assert move.part.name == "BASE_DATA[2]"


@pytest.mark.parametrize(
    ("kind", "controller", "index"), [("#ROBOT", 2, 2), ("#CONVEYOR", 1, 2), ("#EASYS", 2, 2), ("#EASYS", 1, 3)]
)
def test_base_on_an_unknown_carrier_is_not_fixed(kind, controller, index):
    """A base on what the program does not tell is not taken to stand still."""
    program = read(INLINE, config=config(kind, controller, index))
    assert not program.motions
    assert "BASE_DATA[2]" in texts(program)[-1]


def test_base_whose_carrier_is_not_stated_is_not_fixed():
    """It is on no mechanism in place of the one that is left out, though there is a first."""
    text = config("#EASYS").replace("MACH_DEF_INDEX 2,", "").replace("MACHINE_DEF[2]", "MACHINE_DEF[1]")
    program = read(INLINE, config=text)
    assert not program.motions
    assert "MACHINE_FRAME_DAT[2] has no MACH_DEF_INDEX" in texts(program)[-1]


def test_a_carried_base_of_an_inline_form_with_splines_is_left():
    line = f"SLIN {POSE} WITH $TOOL=STOOL2(FP1), $BASE=SBASE(FP1.BASE_NO)"
    dat = "DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE}"
    assert len(read(line, dat=dat).motions) == 1
    program = read(line, dat=dat, config=config("#EASYS"))
    assert "SBASE sets a base that is carried by an external kinematic system" in texts(program)[-1]
