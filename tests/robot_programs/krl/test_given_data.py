"""Data that no file declares, stated beside the files: the same as in a data list, but never rewritten."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import missing_from
from robot_programs.core.robot import NO_ROBOT
from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl
from robot_programs.reading import parse_program
from taskcal_groundwork.errors import InputError

TEXT = """DEF PART( )
BAS(#INITMOV,0)
PTP XHOME
PDAT_ACT=PDEFAULT
FDAT_ACT=FP1
BAS(#PTP_PARAMS,100)
PTP XP1
LIN XP1:{X 0,Y 0,Z -30,A 0,B 10,C 0}
LIN SPOT[2]
LIN {X 400,Y 0,Z HIGH,A 0,B 90,C 0}
END
"""
DATA = {
    "XHOME": "{E6AXIS: A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}",
    "FP1": "{FDAT: TOOL_NO 2,BASE_NO 0,IPO_FRAME #BASE}",
    "XP1": "{E6POS: X 500,Y 10,Z 600,A 0,B 90,C 20,S 2,T 35}",
    "SPOT[2]": "{X 450,Y -10,Z 650,A 0,B 80,C 20}",
    "HIGH": "712.5",
    "TOOL_DATA[2]": "{X 1,Y 2,Z 150,A 0,B 0,C 30}",
}


def source(text: str, name: str = "part.src") -> Source:
    return Source.of(Path(name), text.encode())


def listed(names: list[str]) -> Source:
    lines = [f"DECL E6POS {name}={DATA[name]}" if "[" not in name else f"{name}={DATA[name]}" for name in names]
    return source("\n".join(["DEFDAT $CONFIG", *lines, "ENDDAT", ""]), "$config.dat")


def test_given_data_mean_what_a_data_list_would() -> None:
    """Whichever of them are given, the motions are those of all in the files."""
    wanted = read_krl([source(TEXT), listed(list(DATA))]).motions
    assert len(wanted) == 5
    for given in (["XHOME", "FP1"], ["XP1", "HIGH"], ["SPOT[2]", "XP1", "TOOL_DATA[2]"], list(DATA)):
        rest = listed([name for name in DATA if name not in given])
        program = read_krl([source(TEXT), rest], data={name: DATA[name] for name in given})
        assert len(program.sources) == 2
        for own, other in zip(program.motions, wanted, strict=True):
            assert own.end.posture == other.end.posture
            np.testing.assert_array_equal(own.tool.T, other.tool.T)
            np.testing.assert_array_equal(
                own.end.q if own.end.T is None else own.end.T, other.end.q if other.end.T is None else other.end.T
            )


def test_motion_to_given_point_states_its_new_one() -> None:
    """The point itself stays, since its file is not there; and nothing changes where no motion does."""
    program = read_krl([source(TEXT)], data=DATA)
    assert program.rewrite(NO_ROBOT, {})[0].text == TEXT
    shift = np.eye(4)
    shift[:3, 3] = 1e-3, -2e-3, 3e-3
    waypoints = {
        i: (replace(one, T=shift @ one.T, q=np.zeros(6)),)
        for i, one in enumerate(motion.own_waypoint() for motion in program.motions)
        if one.T is not None
    }
    again = program.reread(program.rewrite(NO_ROBOT, waypoints))
    assert len(again.sources) == 1
    for i, (waypoint,) in waypoints.items():
        np.testing.assert_allclose(again.motions[i].end.T, waypoint.T, atol=1e-8)


def test_all_that_is_missing_is_said_at_once() -> None:
    """Of each motion point, parameter set and tool, so that few rounds are needed."""
    missing = missing_from(read_krl([source(TEXT)]).diagnostics)
    assert {one.name for one in missing} == {"XHOME", "FP1", "XP1", "SPOT[2]", "HIGH"}
    assert {one.kind for one in missing} == {"data"}
    given = {name: text for name, text in DATA.items() if name != "TOOL_DATA[2]"}
    (tool,) = missing_from(read_krl([source(TEXT)], data=given).diagnostics)
    assert (tool.name, tool.kind, tool.count) == ("TOOL_DATA[2]", "tool", 4)


def test_declared_without_value_is_not_missing() -> None:
    """A variable of a data list that states none has its value from the program alone."""
    program = read_krl(
        [source(TEXT), source("DEFDAT PART PUBLIC\nDECL E6POS XP1\nDECL FRAME SPOT[4]\nENDDAT\n", "part.dat")]
    )
    assert {one.name for one in missing_from(program.diagnostics)} == {"XHOME", "FP1", "HIGH"}


@pytest.mark.parametrize(
    ("data", "says"),
    [
        ({"XP1": "{X 1,"}, "is no value for XP1"),
        ({"XP1": "{X 1}\nHALT"}, "is no value for XP1"),
        ({"X P": "3"}, "is no value for X P"),
        ({"XP1": "OTHER"}, "is no value for XP1"),
        ({"PDEFAULT": "{VEL 100}"}, r"PDEFAULT is stated in \$config.dat:2; leave it out"),
    ],
)
def test_what_is_no_value_is_refused(data: dict[str, str], says: str) -> None:
    config = source("DEFDAT $CONFIG\nDECL PDAT PDEFAULT={VEL 50}\nENDDAT\n", "$config.dat")
    with pytest.raises(InputError, match=says):
        read_krl([source(TEXT), config], data=data)


def test_one_value_for_several_programs_is_said() -> None:
    two = [source(TEXT), source(TEXT.replace("DEF PART", "DEF OTHER"), "other.src")]
    said = [d.text for d in read_krl(two, data=DATA).diagnostics if "beside the files" in d.text]
    assert any(text.startswith("XP1 is stated once") and "OTHER, PART" in text for text in said)


def test_data_for_a_language_that_takes_none_are_refused() -> None:
    with pytest.raises(InputError, match=r"a\.mod is RAPID, for which no data can be given"):
        parse_program((source("MODULE a\nENDMODULE\n", "a.mod"),), data={"p10": "[]"})
