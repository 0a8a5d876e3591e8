import copy

import numpy as np
import pytest
import tomli_w

from taskcal.errors import FileError, RobotError
from taskcal.geometry import se3
from taskcal.robot.catalogue import load_robot
from taskcal.robot.robot_file import read_robot, robot_from
from taskcal.robot.statics import Body

SOUND = {
    "name": "arm",
    "joint": [
        {"name": "J1", "steps": [{"tz_mm": 500.0}], "limits_deg": [-170.0, 170.0]},
        {"name": "J2", "mdh": {"alpha_deg": -90.0, "a_mm": 100.0}},
        {"name": "J3", "dh": {"a_mm": 400.0}, "angle": "J3 - J2"},
        {"name": "slide", "type": "prismatic", "steps": [{"rx_deg": 90.0}], "limits_mm": [0.0, 300.0]},
    ],
    "tool": [{"tx_mm": 100.0}],
    "four_bar": {
        "drives": "J3",
        "arm": "J2",
        "crank": "J3",
        "crank_mm": 400.0,
        "rod_mm": 600.0,
        "rocker_mm": 400.0,
        "arm_mm": 600.0,
    },
    "coupled_limit": [{"of": "J3 - J2", "range_deg": [-60.0, 60.0]}],
    "tolerance": {"translation_mm": 0.5},
}

SPRING = {
    "joint": "J2",
    "rate_n_mm": 60.0,
    "free_length_mm": 300.0,
    "crank_mm": 200.0,
    "anchor_mm": 500.0,
    "aligned_deg": 20.0,
}


def edited(*path, value):
    """The sound file with one entry changed."""
    data = copy.deepcopy(SOUND)
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return data


WRONG = {
    "unknown key": (edited("colour", value="red"), "'colour' is not a known key"),
    "unknown key of a joint": (edited("joint", 1, "limit_deg", value=[0.0, 1.0]), "is not a known key"),
    "name missing": ({k: v for k, v in SOUND.items() if k != "name"}, "name: is missing"),
    "no joint": (edited("joint", value=[]), "joint: has no entries; give 1 or more"),
    "joint without name": (edited("joint", 0, value={"steps": []}), "joint 1, name: is missing"),
    "text for a number": (
        edited("joint", 0, "steps", 0, "tz_mm", value="half a metre"),
        "joint 1, steps 1, tz_mm: .*half a metre",
    ),
    "infinite length": (
        edited("joint", 0, "steps", 0, "tz_mm", value=float("inf")),
        "joint 1, steps 1, tz_mm: .*finite",
    ),
    "empty step": (
        edited("joint", 0, "steps", 0, value={}),
        "joint 1, steps 1: a step is one of tx_mm .* this one has none",
    ),
    "two in a step": (
        edited("joint", 0, "steps", 0, "rx_deg", value=9.0),
        r"joint 1, steps 1: a step is one of .*\['tz_mm', 'rx_deg'\]",
    ),
    "symbol of an angle": (
        edited("tool", 0, value={"rx_deg": 90.0, "symbol": "beta"}),
        "tool 1: only a length can have a symbol",
    ),
    "duplicated joint": (edited("joint", 1, "name", value="J1"), "two joints are named 'J1'"),
    "reserved name": (edited("joint", 3, "name", value="tool"), "a joint cannot be named 'tool'"),
    "name with a space": (edited("joint", 3, "name", value="my slide"), "joint 4, name: .*my slide"),
    "unknown kind": (edited("joint", 3, "type", value="screw"), "joint 4, type: .*screw"),
    "steps and table": (edited("joint", 0, "dh", value={"a_mm": 1.0}), "joint 1: give the parts before the joint once"),
    "unknown joint in an expression": (
        edited("joint", 2, "angle", value="J3 - J9"),
        r"joint 3, angle: no joint 'J9'.*'J3 - J9'",
    ),
    "non-linear expression": (edited("joint", 2, "angle", value="J3*J2"), r"joint 3, angle: 'J3\*J2' is not linear"),
    "constant in an expression": (
        edited("joint", 2, "angle", value="J3 + 90"),
        "constant 90; put it into the joint's offset",
    ),
    "limits upside down": (
        edited("joint", 0, "limits_deg", value=[170.0, -170.0]),
        "joint 1: the lower limit 170 must be below",
    ),
    "limits too few": (edited("joint", 0, "limits_deg", value=[170.0]), "joint 1, limits_deg"),
    "limits too many": (edited("joint", 0, "limits_deg", value=[0.0, 1.0, 2.0]), "joint 1, limits_deg"),
    "limits in the other unit": (
        edited("joint", 0, "limits_mm", value=[0.0, 1.0]),
        "joint 1: a revolute joint has .* in degrees",
    ),
    "offset in the other unit": (
        edited("joint", 3, "offset_deg", value=90.0),
        "joint 4: a prismatic joint has .* in mm",
    ),
    "loop of an unknown joint": (edited("four_bar", "drives", value="J8"), "four_bar, drives: no joint 'J8'"),
    "loop without a rod": (edited("four_bar", "rod_mm", value=0.0), "four_bar, rod_mm: must be 1e-06 or more.*0.0"),
    "loop of a third assembly": (edited("four_bar", "assembly", value=2), "four_bar, assembly"),
    "coupled limit of an unknown joint": (
        edited("coupled_limit", 0, "of", value="J3 - A2"),
        "coupled_limit 1, of: no joint 'A2'",
    ),
    "negative mass": (
        edited("joint", 0, value={"name": "J1", "mass_kg": -5.0, "centre_mm": [0.0, 0.0, 0.0]}),
        "joint 1, mass_kg: must be 0 or more.*-5",
    ),
    "mass without a centre": (
        edited("joint", 0, value={"name": "J1", "mass_kg": 5.0}),
        "joint 1: state mass_kg and centre_mm together",
    ),
    "masses of some joints": (
        edited("joint", 0, value={"name": "J1", "mass_kg": 5.0, "centre_mm": [0.0, 0.0, 0.0]}),
        "joint 'J2' has no mass_kg, others have",
    ),
    "stiffness in the other unit": (
        edited("joint", 0, "stiffness_n_mm", value=100.0),
        "joint 1: a revolute joint has its stiffness in Nm/rad",
    ),
    "no stiffness": (
        edited("joint", 0, "stiffness_nm_rad", value=0.0),
        "joint 1, stiffness_nm_rad: must be 1e-06 or more",
    ),
    "gears of a sliding joint": (edited("joint", 3, "gear_ratio", value=10.0), "a prismatic joint has no gear_ratio"),
    "no gravity": (edited("gravity", value=[0.0, 0.0, 0.0]), "gravity: has no direction; give"),
    "flat gravity": (edited("gravity", value=[0.0, -1.0]), "gravity"),
    "payload without mass": (edited("payload", value={"centre_mm": [0.0, 0.0, 9.0]}), "payload, mass_kg: is missing"),
    "spring of a sliding joint": (
        edited("spring", value={**SPRING, "joint": "slide"}),
        "spring, joint: no turning joint 'slide'; known: J1, J2, J3",
    ),
    "spring without a length": (
        edited("spring", value={**SPRING, "crank_mm": 500.0}),
        "spring: crank_mm and anchor_mm are both 500",
    ),
    "negative tolerance": (
        edited("tolerance", "translation_mm", value=-1.0),
        "tolerance, translation_mm: must be 1e-06 or more",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_description_is_refused_with_place_and_value(case, tmp_path):
    data, message = WRONG[case]
    with pytest.raises(RobotError, match=message):
        robot_from(data)
    path = tmp_path / "arm.toml"
    path.write_text(tomli_w.dumps(data), encoding="utf-8")
    with pytest.raises(FileError, match=rf"arm\.toml: .*{message}"):
        read_robot(path)


def test_the_sound_description_is_sound():
    robot = robot_from(SOUND)
    assert robot.joint_names == ("J1", "J2", "J3", "slide")
    assert robot.title == "arm"


@pytest.mark.parametrize("assembly", [1, -1])
def test_a_loop_of_either_assembly_is_read(assembly):
    assert robot_from(edited("four_bar", "assembly", value=assembly)).four_bar.bar.assembly == assembly


def test_several_problems_are_counted():
    with pytest.raises(RobotError, match=r"'colour' is not a known key; .*; 'weight' is not a known key"):
        robot_from({**SOUND, "colour": "red", "weight": 3})


def test_coupled_limits_upside_down_are_refused():
    with pytest.raises(RobotError, match="coupled_limit 1: the lower limit 60 must be below the upper limit -60"):
        robot_from(edited("coupled_limit", 0, "range_deg", value=[60.0, -60.0]))


@pytest.mark.parametrize("content", [b"name = ", b"\xff\xfe\x00", b"joint = 3\n[joint]"])
def test_what_is_no_toml_is_refused(tmp_path, content):
    path = tmp_path / "arm.toml"
    path.write_bytes(content)
    with pytest.raises(FileError, match=r"arm\.toml.*is not TOML"):
        read_robot(path)


def test_a_tool_is_counted_from_the_controllers_flange(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(
        'name = "r"\n[[joint]]\nname = "J1"\nlimits_deg = [-90, 90]\nspeed_deg_s = 180.0\nacceleration_deg_s2 = 360.0\n'
        "[[flange]]\nrx_deg = 180.0\n[[flange]]\ntz_mm = -20.0\n[[tool]]\ntz_mm = 120.0\n"
    )
    robot = read_robot(path)
    np.testing.assert_allclose(robot.T_flange_tool, se3.rotation("x", np.pi) @ se3.translation(z=0.1), atol=1e-12)
    np.testing.assert_allclose(robot.speed_limits, [np.pi])
    np.testing.assert_allclose(robot.acceleration_limits, [2 * np.pi])
    assert load_robot("ur5").speed_limits.tolist() == [np.inf] * 6


def test_what_a_robot_weighs_is_read_in_si_units():
    joints = [
        {
            "name": "J1",
            "mass_kg": 80.0,
            "centre_mm": [10.0, -20.0, 30.0],
            "stiffness_nm_rad": 2e6,
            "gear_ratio": 100.5,
        },
        {"name": "z", "type": "prismatic", "mass_kg": 5.0, "centre_mm": [0.0, 0.0, 0.0], "stiffness_n_mm": 4e4},
    ]
    description = {
        "name": "arm",
        "joint": joints,
        "payload": {"mass_kg": 12.0, "centre_mm": [0.0, 0.0, 150.0]},
        "gravity": [0.0, 2.0, 0.0],
        "spring": {**SPRING, "joint": "J1"},
    }
    robot = robot_from(description)
    known = robot.statics
    assert known.links == (Body(mass=80.0, centre=(0.01, -0.02, 0.03)), Body(mass=5.0, centre=(0.0, 0.0, 0.0)))
    assert (known.payload, known.stiffness) == (Body(mass=12.0, centre=(0.0, 0.0, 0.15)), (2e6, 4e7))
    assert known.gravity.tolist() == [0.0, 1.0, 0.0]
    assert (known.spring.rate, known.spring.anchor, known.spring.joint) == (6e4, 0.5, 0)
    assert [joint.gear_ratio for joint in robot.joints] == [100.5, None]
    again = robot_from(robot.description)
    assert (again.description, again.digest) == (robot.description, robot.digest)
    plain = load_robot("ur5").statics
    assert (plain.links, plain.payload.mass, plain.spring, set(plain.stiffness)) == (None, 0.0, None, {None})
    assert plain.gravity.tolist() == [0.0, 0.0, -1.0]


@pytest.mark.parametrize("pattern", ["{", "t{x}", "{0.__class__}", "{:>999999999}"])
def test_a_pattern_of_symbols_knows_no_other_braces(pattern):
    assert robot_from(edited("symbols", value={"tx": pattern})).symbols["J1.tx"] == pattern


def test_endless_joint_name_gets_a_short_message():
    """An endless name of a joint is refused with a short message."""
    with pytest.raises(RobotError) as caught:
        robot_from(edited("joint", 0, "name", value="J" * 5000))
    assert "joint 1, name: is not a name" in str(caught.value)
    assert len(str(caught.value)) < 400
