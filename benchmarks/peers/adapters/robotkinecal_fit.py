"""robotkinecal: screw axes from the nominal URDF, points observed in the robot's base, its own iteration.

It has no frame of the instrument and no reflector among its unknowns: rows are given in the base frame, the reflector is the end
effector.
"""

import contextlib
import time

import numpy as np
import roboticstoolbox as rtb
from protocol import Fitted, main, start_frames
from robotkinecal import SerialRobotKineCal

SMR = """  <link name="smr"/>
  <joint name="smr_fixed" type="fixed">
    <parent link="{tip}"/>
    <child link="smr"/>
    <origin xyz="{x!r} {y!r} {z!r}" rpy="0 0 0"/>
  </joint>
</robot>"""


def calibrate(case, given: bool) -> Fitted:
    base, target = start_frames(case, given)
    robot = rtb.ERobot.URDF(str(with_reflector(case, target)))
    points = (case.points - base[:3, 3]) @ base[:3, :3]
    begin = time.process_time()
    with contextlib.redirect_stdout(None):
        calibration = SerialRobotKineCal(robot, ee_name="smr")
        calibration.set_observations(list(case.chain_q), list(points))
        calibration.solve()
    kernel = time.process_time() - begin

    def predict(held):
        count = calibration.N_JOINTS + 1
        local = np.array([calibration.forward_kinematics(count, q).t for q in held.chain_q_held])
        return local @ base[:3, :3].T + base[:3, 3]

    return Fitted(predict=predict, parameters=calibration.N_PARAMS, kernel_s=kernel)


def with_reflector(case, target):
    """The nominal robot's file with the reflector for an end."""
    text = (case.folder / "robot.urdf").read_text()
    tip = "tool" if '<link name="tool"/>' in text else "tool0"
    x, y, z = (float(value) for value in target)
    path = case.folder / "robot-smr.urdf"
    path.write_text(text.replace("</robot>", SMR.format(tip=tip, x=x, y=y, z=z)))
    return path.resolve()


if __name__ == "__main__":
    main(calibrate)
