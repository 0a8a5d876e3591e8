import keyword
import re
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from taskcal.errors import FileError, TaskcalError, UnknownName
from taskcal.robot.catalogue import load_robot, robot_toml
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.urdf import UrdfJoint, UrdfTree, choose_tip, describe_tree, describe_urdf
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import generators
from tests.laws.urdfs import Referee, random_urdf
from tests.robot_programs.fuzz import mutated

ARM = """<robot name="arm">
 <link name="base"/><link name="upper"/><link name="fore"/><link name="hand"/>
 <joint name="shoulder" type="revolute">
  <origin xyz="0 0 0.4"/><parent link="base"/><child link="upper"/><axis xyz="0 0 1"/>
  <limit lower="-1.5" upper="2" velocity="1" effort="0"/>
 </joint>
 <joint name="elbow" type="revolute">
  <origin xyz="0.3 0 0"/><parent link="upper"/><child link="fore"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" velocity="0" effort="0"/>
 </joint>
 <joint name="mount" type="fixed"><origin xyz="0.2 0 0"/><parent link="fore"/><child link="hand"/></joint>
</robot>
"""


def write(folder, text, name="arm.urdf"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def assert_agrees(referee, tip, rng, count=2):
    """With Pinocchio, at some poses of a tip, and pytransform3d."""
    robot = robot_from(describe_tree(referee.tree, tip=tip))
    link = tip or choose_tip(referee.tree)
    model = ErrorModel(robot)
    for _ in range(count):
        values = dict(zip(referee.motors, rng.uniform(-1.5, 1.5, len(referee.motors)), strict=True))
        q = np.array([[values[name] for name in robot.joint_names]])
        np.testing.assert_allclose(model.poses(q)[0], referee.pose(values, link), rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(model.poses(q)[0], referee.pose_by_pytransform3d(values, link), rtol=0.0, atol=1e-12)
        by_joint = referee.jacobian(values, link, robot.joint_names)
        np.testing.assert_allclose(model.joint_jacobian(q)[0], by_joint, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("joints", [3, 7])
def test_random_chains_stand_where_pinocchio_puts_them(joints, tmp_path_factory):
    @settings(max_examples=25)
    @given(generators)
    def law(rng):
        path = write(tmp_path_factory.mktemp("urdf"), random_urdf(rng, joints))
        referee = Referee(path)
        tip = referee.tree.leaves[0]
        if any(joint.moves for joint in referee.tree.path_to(tip)):
            assert_agrees(referee, tip, rng)

    law()


@pytest.mark.slow
@pytest.mark.realdata
def test_published_links_agree_with_pinocchio(data_folder):
    """Every link of every published description stands where Pinocchio puts it."""
    paths = sorted((data_folder / "urdf").glob("*.urdf"))
    assert len(paths) >= 18
    for path in paths:
        rng, referee = np.random.default_rng(0), Referee(path)
        assert_agrees(referee, None, rng)
        for link in referee.tree.links:
            if any(joint.moves for joint in referee.tree.path_to(link)):
                assert_agrees(referee, link, rng, count=1)


def test_a_written_robot_file_is_the_same_robot(tmp_path):
    path = write(tmp_path, random_urdf(np.random.default_rng(4), 6))
    described = describe_urdf(path, tip="l6")
    again = load_robot(write(tmp_path, robot_toml(described), "arm.toml"))
    assert again.description == load_robot(path, tip="l6").description
    q = np.random.default_rng(0).normal(size=(4, len(again.joints)))
    np.testing.assert_array_equal(ErrorModel(again).poses(q), ErrorModel(load_robot(path, tip="l6")).poses(q))


def test_names_limits_and_speeds_are_kept(tmp_path):
    robot = load_robot(write(tmp_path, ARM))
    assert (robot.name, robot.joint_names) == ("arm", ("shoulder", "elbow"))
    np.testing.assert_allclose(robot.limits, [[-1.5, 2.0], [-1.0, 1.0]], rtol=1e-12)
    np.testing.assert_allclose(robot.speed_limits, [1.0, np.inf])
    assert robot.source == ("imported from arm.urdf: base base, tip hand",)
    np.testing.assert_allclose(ErrorModel(robot).poses(np.zeros((1, 2)))[0, :3, 3], [0.5, 0.0, 0.4], atol=1e-15)


def test_limits_that_are_no_range_are_taken_for_none_and_said(tmp_path):
    robot = load_robot(write(tmp_path, ARM.replace('lower="-1" upper="1"', 'lower="0" upper="0"')))
    assert not np.isfinite(robot.limits[1]).any()
    assert robot.source[1:] == ("limits of elbow are not a range, and taken for none",)


@pytest.mark.parametrize(("kind", "unit", "other"), [("revolute", "rad", "degrees"), ("prismatic", "m", "millimetres")])
def test_limits_in_another_unit_are_taken_for_none_and_said(tmp_path, kind, unit, other):
    """Those of arms in degrees, of slides in millimetres."""
    arm = ARM.replace('name="elbow" type="revolute"', f'name="elbow" type="{kind}"')
    robot = load_robot(write(tmp_path, arm.replace('lower="-1" upper="1"', 'lower="-170" upper="1700"')))
    assert robot.prismatic[1] == (kind == "prismatic")
    np.testing.assert_array_equal(robot.limits[1], [-np.inf, np.inf])
    assert f"limits of elbow, -170 to 1700 {unit}, are taken for none; are they {other}?" in robot.source


def test_a_tip_that_follows_a_joint_before_it_is_one(tmp_path):
    follows = '<limit lower="-1" upper="1" velocity="1" effort="0"/><mimic joint="elbow" multiplier="-1"/>'
    text = ARM.replace('name="mount" type="fixed">', 'name="mount" type="revolute"><axis xyz="0 1 0"/>' + follows)
    assert_agrees(Referee(write(tmp_path, text)), None, np.random.default_rng(0))


@example(names=["", "if"])
@given(
    st.lists(st.text(st.sampled_from("aé-._ 1J") | st.characters(codec="utf-8"), max_size=85), min_size=2, max_size=6)
)
def test_joints_of_any_names_have_plain_ones_all_different(names):
    """Names that differ stay so, in a robot file and in columns; plain ones stay as they are."""
    names = list(dict.fromkeys([*names, "tool", "base", "x" * 90, "x" * 90 + "y"]))
    links = [f"l{k}" for k in range(len(names) + 1)]
    turning = {"kind": "revolute", "limits": None, "speed": None, "mimic": None, "remark": "", "line": 0}
    joints = [
        UrdfJoint(name=name, parent=links[k], child=links[k + 1], origin=np.eye(4), axis=np.eye(3)[k % 3], **turning)
        for k, name in enumerate(names)
    ]
    tree = UrdfTree(
        path=Path("arm.urdf"), name="arm", links=tuple(links), above={joint.child: joint for joint in joints}
    )
    robot = robot_from(describe_tree(tree))
    assert len(set(robot.joint_names)) == len(names)
    for name, plain in zip(names, robot.joint_names, strict=True):
        taken = keyword.iskeyword(name) or name in ("tool", "base", "loop")
        if re.fullmatch(r"[A-Za-z_]\w{0,60}", name, re.ASCII) and not taken:
            assert plain == name


def test_an_axis_that_points_backwards_turns_backwards(tmp_path):
    forward = ErrorModel(load_robot(write(tmp_path, ARM)))
    backward = ErrorModel(load_robot(write(tmp_path, ARM.replace("0 1 0", "0 -1 0"))))
    q = np.array([[0.3, 0.4]])
    np.testing.assert_allclose(backward.poses(q * [1, -1]), forward.poses(q), atol=1e-15)


def test_mimic_joint_is_driven_by_its_leader(tmp_path):
    """A joint that mimics another of the chain is driven by it."""
    level = '<joint name="level" type="revolute"><parent link="fore"/><child link="flat"/><axis xyz="0 1 0"/>'
    text = ARM.replace("</robot>", f'{level}<mimic joint="elbow" multiplier="-1"/></joint><link name="flat"/></robot>')
    robot = load_robot(write(tmp_path, text), tip="flat")
    assert robot.joint_names == ("shoulder", "elbow")
    assert [joint.name for joint in robot.driven] == ["level"]
    model = ErrorModel(robot)
    assert "level.rz" in model.names
    q = np.random.default_rng(0).uniform(-1, 1, (5, 2))
    np.testing.assert_allclose(model.poses(q)[:, 2, :3], np.tile([0.0, 0.0, 1.0], (5, 1)), atol=1e-15)  # it stays level
    J, step = model.joint_jacobian(q), 1e-6
    for j in range(2):
        ahead, behind = (model.poses(q + sign * step * np.eye(2)[j])[:, :3, 3] for sign in (1, -1))
        np.testing.assert_allclose(J[:, :3, j], (ahead - behind) / (2 * step), atol=1e-9)
    with pytest.raises(TaskcalError, match=r"how effects pass through their linkage is not modelled"):
        model + Harmonics()


def test_of_several_tips_the_one_to_name_is_asked_for(tmp_path):
    second = '<link name="left"/><joint name="m" type="fixed"><parent link="fore"/><child link="left"/></joint></robot>'
    path = write(tmp_path, ARM.replace("</robot>", second))
    with pytest.raises(
        FileError,
        match=r"may be the tip: hand, left; name one, as in arm\.urdf#hand, or .* --tip hand",
    ):
        load_robot(path)
    assert load_robot(path, tip="left").source[0].endswith("tip left")
    assert load_robot(f"{path}#left").description == load_robot(path, tip="left").description
    flange = write(tmp_path, path.read_text(encoding="utf-8").replace("left", "tool0"), "two.urdf")
    assert load_robot(flange).source[0].endswith("tip tool0")
    with pytest.raises(UnknownName, match=r"no link 'lft' in .*, for its tip; did you mean 'left'"):
        load_robot(path, tip="lft")


def test_a_base_may_be_any_link_that_stands_still(tmp_path):
    foot = '<link name="foot"/><joint name="f" type="fixed"><origin xyz="0 0 -0.1" rpy="0 0 1.5"/><parent link="base"/>'
    path = write(tmp_path, ARM.replace("</robot>", foot + '<child link="foot"/></joint></robot>'))
    referee, q = Referee(path), np.array([[0.2, -0.3]])
    values = {"shoulder": 0.2, "elbow": -0.3}
    expected = np.linalg.inv(referee.pose(values, "foot")) @ referee.pose(values, "hand")
    np.testing.assert_allclose(ErrorModel(load_robot(path, base="foot")).poses(q)[0], expected, atol=1e-15)
    with pytest.raises(FileError, match=r"base 'fore' moves by joint 'shoulder'"):
        load_robot(path, base="fore", tip="foot")


WRONG = {
    "no XML": ("solid cube\nfacet", r"arm\.urdf:1: is not well-formed XML"),
    "cut off": (ARM[:-10], r"is not well-formed XML: no element found"),
    "another root": ("<sdf/>", r"its root is <sdf>, not <robot>"),
    "entities": ('<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>', r"arm\.urdf:1: declares a document type"),
    "deep": ("<robot>" * 200, r"nests more than 100 elements"),
    "macros": (ARM.replace("<link", '<xacro:m/><link', 1), r"is not well-formed|is a xacro file"),
    "no joints": ('<robot name="r"><link name="a"/></robot>', r"has no joints"),
    "no type": (ARM.replace(' type="revolute"', "", 1), r"arm\.urdf:3: <joint> has no type"),
    "wrong type": (ARM.replace("revolute", "revolut", 1), r"no type 'revolut' of joint 'shoulder'; did you mean 'revolute'"),
    "no link": (ARM.replace('<link name="hand"/>', ""), r"hangs on link 'hand', which the file does not have"),
    "two links": (ARM.replace('name="hand"/>', 'name="fore"/>', 1), r"two links are named 'fore'"),
    "comma": (ARM.replace("0 0 0.4", "0 0 0,4"), r'arm\.urdf:4: .*\'0,4\' is not a number'),
    **{
        f"number {odd}": (ARM.replace("0 0 0.4", f"0 0 {odd}"), r"arm\.urdf:4: xyz of <origin>: '.+' is not a number")
        for odd in ("0_4", "٤", "nan", "-inf")
    },
    "two numbers": (ARM.replace("0 0 0.4", "0 0.4"), r'xyz="0 0\.4" of <origin> is not three numbers'),
    "millimetres": (ARM.replace("0 0 0.4", "0 0 4000"), r"'4000' is not a number of metres or radians"),
    "no axis": (ARM.replace("0 0 1", "0 0 0"), r"the axis of joint 'shoulder' has no direction"),
    "limits": (ARM.replace('lower="-1"', 'lower="3"'), r"the lower limit 3 rad above the upper 1 rad"),
    "closed": (ARM.replace('child link="hand"', 'child link="upper"'), r"'upper' hangs on two joints, 'shoulder' and 'mount'"),
    "round": (ARM.replace('parent link="base"', 'parent link="hand"'), r"round in a circle|exactly one root link"),
    "unknown mimic": (ARM.replace('<limit lower="-1"', '<mimic joint="x"/><limit lower="-1"'), r"mimics 'x', which is no"),
    "mimic of itself": (ARM.replace('<limit lower="-1"', '<mimic joint="elbow"/><limit lower="-1"'), r"mimics itself"),
    "floating": (ARM.replace("revolute", "floating", 1), r"joint 'shoulder' is floating"),
    "still": (ARM.replace("revolute", "fixed"), r"has no chain of joints"),
    "loop": (ARM.replace("</robot>", '<loop_joint name="x"/></robot>'), r"closes a loop by <loop_joint>.*\[four_bar\]"),
    "rpy in degrees": (
        ARM.replace('xyz="0.3 0 0"', 'xyz="0.3 0 0" rpy="0 90 0"'),
        r"rpy of <origin> of joint 'elbow' has 90, 14 turns; .* 1\.5708 for 90°",
    ),
    "a small one in millimetres": (ARM.replace('"0.3 0 0"', '"300 0 0"'), r"301 m apart; .* are these millimetres\?"),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG)
def test_a_wrong_file_is_refused_with_its_reason(kind, tmp_path):
    text, message = WRONG[kind]
    with pytest.raises(FileError, match=message):
        load_robot(write(tmp_path, text))


@given(generators)
def test_damaged_bytes_are_read_or_refused(tmp_path_factory, rng):
    path = tmp_path_factory.mktemp("urdf") / "arm.urdf"
    path.write_bytes(mutated(rng, ARM.encode(), marks=b"<>/=\"' !&;[]\xff\x00-eE.09"))
    try:
        joints = len(load_robot(path).joints)
    except TaskcalError:
        return
    assert joints


@pytest.mark.parametrize(
    "text", ["<a/>", '<joint name="j" type="fixed"/>', "<link/>", "a<b>", "<!-- -->", '<link name="']
)
def test_rejects_1mb_garbage_within_2_s(text, tmp_path):
    """A megabyte of invalid content is rejected within 2 s of processor time."""
    path = write(tmp_path, "<robot>" + text * (1_000_000 // len(text)) + "</robot>")
    began = time.process_time()
    with pytest.raises(FileError):
        load_robot(path)
    assert time.process_time() - began < 2.0


@given(st.binary(max_size=200))
def test_any_bytes_are_refused(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("urdf") / "arm.urdf"
    path.write_bytes(data)
    with pytest.raises(FileError):
        load_robot(path)
