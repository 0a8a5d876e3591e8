import time

import pytest

from taskcal.errors import FileError
from taskcal.robot import xacro
from taskcal.robot.catalogue import load_robot

MACRO = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
 <xacro:macro name="arm" params="prefix length">
  <link name="${prefix}base"/><link name="${prefix}tool0"/>
  <joint name="${prefix}j1" type="continuous">
   <origin xyz="0 0 ${2 * length}"/><parent link="${prefix}base"/><child link="${prefix}tool0"/><axis xyz="0 0 1"/>
  </joint>
 </xacro:macro>
</robot>
"""
CELL = """<robot name="cell" xmlns:xacro="http://www.ros.org/wiki/xacro">
 <xacro:include filename="$(find arm_support)/urdf/arm_macro.xacro"/>
 <xacro:arm prefix="left_" length="0.25"/>
</robot>
"""


@pytest.fixture
def packages(tmp_path):
    """Two ROS packages beside each other."""
    for name, file, text in (("arm_support", "arm_macro.xacro", MACRO), ("cell", "cell.urdf.xacro", CELL)):
        (tmp_path / name / "urdf").mkdir(parents=True)
        (tmp_path / name / "urdf" / file).write_text(text, encoding="utf-8")
        (tmp_path / name / "package.xml").write_text(f"<package><name>{name}</name></package>", encoding="utf-8")
    return tmp_path


def test_macros_and_packages_beside_are_carried_out(packages):
    robot = load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")
    assert robot.joint_names == ("left_j1",)
    assert robot.joints[0].before[0].transform[2, 3] == pytest.approx(0.5, abs=1e-15)


def test_without_the_package_it_says_how_to_get_it(packages, monkeypatch):
    monkeypatch.setattr(xacro, "find_spec", lambda name: None)
    with pytest.raises(FileError, match=r"takes the package xacrodoc: pip install 'taskcal\[urdf\]'"):
        load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")


def test_macros_that_fail_say_why(packages):
    (packages / "cell" / "urdf" / "cell.urdf.xacro").write_text(CELL.replace("0.25", "${nothing}"), encoding="utf-8")
    with pytest.raises(FileError, match=r"its macros fail: .*nothing"):
        load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")


def test_macros_without_end_are_given_up(packages, monkeypatch):
    monkeypatch.setattr(xacro, "SECONDS", 1.0)
    (packages / "cell" / "urdf" / "cell.urdf.xacro").write_text(CELL.replace("0.25", "${9**9**9}"), encoding="utf-8")
    began = time.monotonic()
    with pytest.raises(FileError, match=r"do not come to an end|its macros fail"):
        load_robot(packages / "cell" / "urdf" / "cell.urdf.xacro")
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize("name", ["arm.xacro", "../shared/arm.xacro", "$(cwd)/arm.xacro"])
def test_files_beside_are_found_from_anywhere(name, tmp_path):
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared" / "arm.xacro").write_text(MACRO, encoding="utf-8")
    path = tmp_path / "shared" / "main.xacro"
    path.write_text(CELL.replace("$(find arm_support)/urdf/arm_macro.xacro", name), encoding="utf-8")
    assert load_robot(path).joint_names == ("left_j1",)
