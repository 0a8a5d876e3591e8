"""A calibrated robot as the ``kinematics`` YAML of Universal Robots' ROS driver."""

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.export.calibrated_chain import CalibratedChain, moved, spread_poses
from taskcal.export.export import Export, Loss
from taskcal.export.urdf_form import roll_pitch_yaw
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
"""As the driver calls them, from the base."""


def export_ur_yaml(
    calibration: Calibration, q: Float[np.ndarray, "n joints"] | None = None, *, accept_loss: bool = False
) -> Export:
    """The calibrated robot as a place of each link in the one before it.

    The form ends at the last link, in whose frame the controller counts its tools: what stands behind it, which the calibration
    may have moved as well, is `Export.frames`' ``tool``, to be stated as the tool.

    Args:
        calibration: the robot.
        q: joint positions at which a loss is measured; all over the ranges by default.
        accept_loss: write it although it loses something.

    Raises:
        TaskcalError: the robot is not built like one of Universal Robots, or has parts that the form does not hold.
    """
    q = spread_poses(calibration) if q is None else q
    chain = CalibratedChain.of(calibration, q)
    robot = chain.robot
    alike = len(robot.joints) == len(LINKS) and not any(robot.prismatic) and not robot.driven
    if not alike or not np.array_equal(chain.matrix, np.eye(len(LINKS))):
        raise TaskcalError(
            f"{robot.name} is not built like a UR: the form has six joints that turn by the controller's angles; write a URDF "
            "(--form urdf)"
        )
    loss = Loss.of(calibration, q, chain.poses(q))
    if not accept_loss:
        loss.refuse("UR's YAML")
    origins, tool = _origins(chain)
    lines = ["kinematics:"]
    for link, T in zip(LINKS, origins, strict=True):
        lines.append(f"  {link}:")
        values = [*T[:3, 3], *roll_pitch_yaw(T[:3, :3])]
        lines += [
            f"    {key}: {float(v) + 0.0!r}"
            for key, v in zip(("x", "y", "z", "roll", "pitch", "yaw"), values, strict=True)
        ]
    lines.append(f"  hash: taskcal_{robot.digest}")
    return Export(text="\n".join(lines) + "\n", loss=loss, frames={"tool": tool})


def _origins(chain: CalibratedChain) -> tuple[list[Float[np.ndarray, "4 4"]], Float[np.ndarray, "4 4"]]:
    """Place of each link in the one before, and of the tool in the last; each link's frame where Universal Robots put it.

    A link's frame may slide along its axis: for a standard table its d, which follows the joint, is taken before it.
    """
    described = chain.robot.description["joint"]
    pending, out = np.eye(4), []
    for joint in chain.joints:
        slide = se3.translation(0.0, 0.0, described[joint.coordinate].get("dh", {}).get("d_mm", 0.0) * 1e-3)
        turned = moved("revolute", chain.offset[joint.coordinate : joint.coordinate + 1])[0]
        out.append(pending @ joint.before @ turned @ slide)
        pending = se3.inverse(slide)
    behind = pending @ chain.end
    # what turns about and slides along the last axis is the last link's own
    yaw = float(np.arctan2(behind[1, 0], behind[0, 0])) if np.hypot(behind[0, 0], behind[1, 0]) > 1e-9 else 0.0
    own = se3.translation(0.0, 0.0, float(behind[2, 3])) @ se3.rotation("z", yaw)
    out[-1] = out[-1] @ own
    return out, se3.inverse(own) @ behind
