"""Models of MuJoCo are read as MuJoCo places them."""

import numpy as np
import pytest

from taskcal.errors import FileError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

mujoco = pytest.importorskip("mujoco", reason="the package mujoco is not installed")

ARM = """<mujoco model="an arm">
  <compiler angle="degree" meshdir="assets" eulerseq="zyx"/>
  <default>
    <joint axis="0 1 0" range="-360 360"/>
    <default class="short"><joint range="-180 90"/></default>
  </default>
  <asset><mesh file="none.obj"/><texture file="none.png" type="2d"/></asset>
  <worldbody>
    <light pos="0 0 2"/>
    <body name="base" quat="1 0 0 1">
      <geom type="mesh" mesh="none"/>
      <body name="shoulder" pos="0 0 0.163">
        <joint name="pan" axis="0 0 1"/>
        <body name="upper" pos="0 0.138 0" euler="10 90 0">
          <joint name="lift" ref="20" pos="0 0.01 0.02"/>
          <frame pos="0.1 0 0" axisangle="1 1 0 30">
            <body name="fore" pos="0 -0.131 0.425">
              <joint name="elbow" class="short"/>
              <joint name="telescope" type="slide" axis="1 1 0" range="-1 1" ref="0.05"/>
              <body name="wrist" pos="0 0 0.392" xyaxes="0 1 0 0 0 1">
                <joint name="wrist" pos="0.02 0 0" limited="false"/>
                <site name="wrist" pos="0 0.1 0.2" zaxis="0 1 1"/>
              </body>
            </body>
          </frame>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="telescope" joint2="elbow" polycoef="0.1 0.2 0 0 0"/></equality>
  <actuator><position joint="elbow"/></actuator>
</mujoco>
"""


def test_an_mjcf_is_where_mujoco_has_it(tmp_path):
    """Defaults, degrees, orders of angles, references, several joints of a body, joints beside it, couplings; without its files."""
    path = tmp_path / "arm.xml"
    path.write_text(ARM, encoding="utf-8")
    robot = load_robot(path)
    assert robot.joint_names == ("pan", "lift", "elbow", "wrist")
    np.testing.assert_allclose(np.degrees(robot.limits[2]), [-180.0, 90.0])
    whole = ARM.replace('<geom type="mesh" mesh="none"/>', "").replace("<asset>", "<!--").replace("</asset>", "-->")
    referee = mujoco.MjModel.from_xml_string(whole.replace("<compiler", '<compiler boundmass="1" boundinertia="1"'))
    data = mujoco.MjData(referee)
    for q in np.random.default_rng(0).uniform(-1.5, 1.5, (20, 4)):
        for name, value in zip(robot.joint_names, q, strict=True):
            data.joint(name).qpos[0] = value
        data.joint("telescope").qpos[0] = 0.05 + 0.1 + 0.2 * q[2]
        mujoco.mj_kinematics(referee, data)
        T = ErrorModel(robot).poses(q[None])[0]
        np.testing.assert_allclose(T[:3, 3], data.site("wrist").xpos, atol=1e-12)
        np.testing.assert_allclose(T[:3, :3].ravel(), data.site("wrist").xmat, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<mujoco>\n<include file="a.xml"/></mujoco>', r":2: has <include>, which stands for what is not read"),
        ("<mujoco>\n<worldbody>\n<body>\n<joint/>\n<body pos='0 0'/></body></worldbody></mujoco>", r"'pos' .*line 5"),
        ("<mujoco><worldbody><body/></worldbody></mujoco>", "has no joints; is it a scene"),
        (ARM.replace('0.1 0.2 0 0 0"', '0 1 1 0 0"'), r":19: .*'telescope' follows 'elbow' by a polynomial"),
        (ARM.replace('name="pan"', 'name="pan" type="ball" limited="false" range="0 9"'), "joint 'pan' is floating"),
    ],
)
def test_an_mjcf_that_is_not_read_is_refused_at_its_line(text, message, tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(FileError, match=message):
        load_robot(path)
