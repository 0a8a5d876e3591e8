"""The calibrated chain and what a form of it loses; UR's YAML, and tables of Denavit and Hartenberg."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from taskcal.arguments import checked, joints_checked
from taskcal.errors import TaskcalError, WrongValue, shown
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.uncertainty_budget import check_known
from taskcal.kernels.chain import ErrorFrame, Fixed, JointKind
from taskcal.kinematics.inverse import closes
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot import Robot
from taskcal.short_repr import short_repr

ROUNDING = 1e-8
"""Metres at the tool that the digits of a file may cost: 10 nm, far below any tracker's noise."""


@joints_checked
@dataclass(frozen=True, kw_only=True)
class Loss:
    """Distance of a form's TCP from the calibration's, metres."""

    rms: float
    maximum: float
    poses: int
    reasons: tuple[str, ...]
    """Properties that the form cannot hold."""

    @classmethod
    def of(
        cls,
        calibration: Calibration,
        q: Float[np.ndarray, "n joints"],
        predicted: Float[np.ndarray, "n 4 4"],
        lacking: tuple[str, ...] = (),
    ) -> "Loss":
        """Loss of a form with these poses at joint positions q; `lacking`: properties that it cannot hold of any calibration."""
        off = np.linalg.norm(predicted[:, :3, 3] - calibration.tool_in_base(q)[:, :3, 3], axis=1)
        model = calibration.model
        reasons = [*lacking, *(effect.name for effect in model.effects)]
        if model.robot.four_bar is not None:
            reasons.append("the four-bar of its drive, where it is no parallelogram")
        rms, maximum = float(np.sqrt(np.mean(off**2))), float(off.max())
        return cls(rms=rms, maximum=maximum, poses=len(q), reasons=tuple(reasons) if maximum > ROUNDING else ())

    def refuse(self, form: str) -> None:
        """Refuse a form that loses more than its digits.

        Raises:
            TaskcalError: it does; the message says what and how much.
        """
        if self.maximum <= ROUNDING:
            return
        raise TaskcalError(
            f"{form} cannot hold {', '.join(self.reasons) or 'this chain'}: {self.rms * 1e3:.4f} mm (rms) and "
            f"{self.maximum * 1e3:.4f} mm (largest) would be lost over {self.poses} poses; identify without them for this form, "
            "correct programs with the whole model (taskcal correct), or accept the loss (--accept-loss)"
        )

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "rms_mm": self.rms * 1e3,
            "max_mm": self.maximum * 1e3,
            "poses": self.poses,
            "not_held": list(self.reasons),
        }


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Export:
    """A file for another program."""

    text: str
    loss: Loss
    frames: Mapping[str, Float[np.ndarray, "4 4"]]
    """Poses that the file does not hold: of its base in the robot's, of the tool in its last frame."""
    remarks: tuple[str, ...] = ()
    files: Mapping[str, str] = field(default_factory=dict[str, str])
    """Texts by their names, of a form that is a folder."""

    def summary(self) -> dict[str, Any]:
        """Loss and frames, in millimetres and degrees."""
        return {"loss": self.loss.summary(), "frames": {name: placed(T) for name, T in self.frames.items()}}


def placed(T: Float[np.ndarray, "4 4"]) -> dict[str, Any]:
    """A pose in millimetres, as a quaternion and as angles about fixed x, y, z (``rpy_deg``)."""
    R = T[:3, :3]
    pitch = np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))
    rpy = [np.arctan2(R[2, 1], R[2, 2]), pitch, np.arctan2(R[1, 0], R[0, 0])]
    return {
        "position_mm": [float(value) * 1e3 for value in T[:3, 3]],
        "quaternion": se3.to_quaternion(R[None])[0].tolist(),
        "rpy_deg": np.degrees(rpy).tolist(),
    }


def describe_place(T: Float[np.ndarray, "4 4"]) -> str:
    """The same in words."""
    (x, y, z), (a, b, c) = placed(T)["position_mm"], placed(T)["rpy_deg"]
    return f"x {x:.4f} y {y:.4f} z {z:.4f} mm, rotated by {a:.5f}° {b:.5f}° {c:.5f}° about fixed x, y, z"


# The calibrated chain: what geometry alone holds of a calibration, its defects taken into the fixed parts.

SAMPLES = 400
"""Poses over the joints' ranges, without a task."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ChainJoint:
    """A joint with the fixed part before it."""

    name: str
    kind: JointKind
    coordinate: int
    """Which chain coordinate moves it."""
    before: Float[np.ndarray, "4 4"]
    """From the previous joint's frame, or the base."""


@dataclass(frozen=True, eq=False, kw_only=True)
class CalibratedChain:
    """Fixed parts, joints about or along their z axes, and what moves these."""

    robot: Robot
    joints: tuple[ChainJoint, ...]
    end: Float[np.ndarray, "4 4"]
    """From the last joint's frame to the tool."""
    matrix: Float[np.ndarray, "coordinates joints"]
    offset: Float[np.ndarray, " coordinates"]
    """Chain coordinates are matrix·q + offset, radians or metres."""
    warning: str = ""
    """What files say above the robot, such as that its calibration was edited; on one line."""

    @classmethod
    def of(cls, calibration: Calibration, q: Float[np.ndarray, "n joints"]) -> "CalibratedChain":
        """The chain of a calibration; of what effects and loops add at joint positions q, the mean goes into the joints' zeros."""
        return replace(cls.of_model(calibration.model, calibration.estimate, q), warning=calibration.edit_warning)

    @classmethod
    def of_model(
        cls, model: ErrorModel, x: Float[np.ndarray, " p"], q: Float[np.ndarray, "n joints"]
    ) -> "CalibratedChain":
        """Make the chain of a model with parameter values x."""
        robot = model.robot
        count = len(robot.joint_map.offset)
        frames = se3.error_transform(model.error_frames(x))
        names = [*robot.joint_names, *(joint.name for joint in robot.driven)]
        joints: list[ChainJoint] = []
        pending, met, counted = np.eye(4), 0, 0
        for step in model.steps:
            if isinstance(step, Fixed):
                pending = pending @ step.transform
            elif isinstance(step, ErrorFrame):
                pending = pending @ frames[met]
                met += 1
            else:
                k = counted if step.number is None else step.number
                counted += step.number is None
                if k < count:  # joints that effects add stand still
                    joints.append(ChainJoint(name=names[k], kind=step.kind, coordinate=k, before=pending))
                    pending = np.eye(4)
        added = model.walk(q, x).s[:, :count] - robot.joint_map(q)
        return cls(
            robot=robot,
            joints=tuple(joints),
            end=pending,
            matrix=robot.joint_map.matrix,
            offset=robot.joint_map.offset + added.mean(axis=0),
        )

    def poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the base."""
        s = q @ self.matrix.T + self.offset
        T = np.broadcast_to(np.eye(4), (len(q), 4, 4))
        for joint in self.joints:
            T = T @ joint.before @ moved(joint.kind, s[:, joint.coordinate])
        return T @ self.end


def moved(kind: JointKind, value: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n 4 4"]:
    """Motions of the joints at some values, radians or metres."""
    T = np.tile(np.eye(4), (len(value), 1, 1))
    if kind == "prismatic":
        T[:, 2, 3] = value
    else:
        T[:, 0, 0] = T[:, 1, 1] = np.cos(value)
        T[:, 1, 0] = np.sin(value)
        T[:, 0, 1] = -T[:, 1, 0]
    return T


def spread_poses(calibration: Calibration, count: int = SAMPLES) -> Float[np.ndarray, "n joints"]:
    """Joint positions all over the ranges at which loops close, radians or metres; the same ones at every call."""
    model = calibration.model
    limits = model.robot.bounded_limits()
    q = np.random.default_rng(0).uniform(limits[:, 0], limits[:, 1], (4 * count, len(limits)))
    q = q[model.robot.inside_limits(q)]
    return q[closes(model, q, None) & closes(model, q, calibration.estimate)][:count]


def poses_or_spread(calibration: Calibration, q: Float[np.ndarray, "n joints"] | None) -> Float[np.ndarray, "n joints"]:
    """Joint positions as given, or all over the ranges.

    Raises:
        WrongValue: none are given.
    """
    if q is not None and not len(q):
        raise WrongValue("q has no rows; give the poses of the task, or leave it out")
    return spread_poses(calibration) if q is None else q


# Writing a chain in a form, and what that loses.


@dataclass(frozen=True, eq=False, kw_only=True)
class WrittenChain:
    """A chain in some form, and the poses that it predicts."""

    text: str
    poses: Callable[[Float[np.ndarray, "n joints"]], Float[np.ndarray, "n 4 4"]]
    frames: Mapping[str, Float[np.ndarray, "4 4"]] = field(default_factory=dict[str, np.ndarray])
    remarks: tuple[str, ...] = ()
    lacking: tuple[str, ...] = ()
    """Properties that the form cannot hold of any calibration."""


def export_as(
    form: str,
    write: Callable[[CalibratedChain], WrittenChain],
    calibration: Calibration,
    q: Float[np.ndarray, "n joints"] | None,
    *,
    accept_loss: bool,
    accept_uncertain: bool,
) -> Export:
    """Write the chain of a calibration in a form, and measure the loss.

    Args:
        form: as messages call it.
        write: the form of a chain.
        calibration: the robot.
        q: joint positions at which a loss is measured; all over the ranges by default.
        accept_loss: write it although it loses something.
        accept_uncertain: write it although the calibration knows less there than the robot's tolerances do.

    Raises:
        TaskcalError: the form cannot hold the robot, or loses something that is not accepted; or the calibration knows next to
            nothing at these poses.
    """
    q = poses_or_spread(calibration, q)
    if not accept_uncertain:
        check_known(calibration, q, f"{form} for {len(q)} poses is not written")
    written = write(CalibratedChain.of(calibration, q))
    loss = Loss.of(calibration, q, written.poses(q), written.lacking)
    if not accept_loss:
        loss.refuse(form)
    return Export(text=written.text, loss=loss, frames=written.frames, remarks=written.remarks)


def roll_pitch_yaw(R: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, " 3"]:
    """Angles about fixed x, y, z, each from what the one before has left, so that they give the rotation to rounding."""
    yaw = float(np.arctan2(R[1, 0], R[0, 0])) if np.hypot(R[0, 0], R[1, 0]) > 1e-9 else 0.0
    c, s = np.cos(yaw), np.sin(yaw)
    pitch = np.arctan2(-R[2, 0], c * R[0, 0] + s * R[1, 0])
    roll = np.arctan2(s * R[0, 2] - c * R[1, 2], c * R[1, 1] - s * R[0, 1])
    return np.array([roll, pitch, yaw])


# A calibrated robot as the ``kinematics`` YAML of makers' ROS packages, each of which has a tool that writes such a file of the
# parameters in a controller: Universal Robots' ``ur_calibration``, UFACTORY's ``gen_kinematics_params.py`` (xArm), and Flexiv's
# ``SyncKinematicsYAML``.

LINKS = ("shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3")
"""As the driver calls them, from the base."""


@checked
def export_ur_yaml(
    calibration: Calibration,
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    accept_loss: bool = False,
    accept_uncertain: bool = False,
) -> Export:
    """Export the calibrated robot as the pose of each link in the one before it.

    The form ends at the last link, in whose frame the controller counts its tools. The tool in it, which the calibration may
    have moved as well, is `Export.frames`' ``tool``, to be set as the tool.

    Args:
        calibration: the robot.
        q: joint positions at which a loss is measured; all over the ranges by default.
        accept_loss: write it although it loses something.
        accept_uncertain: write it although the calibration knows less there than the robot's tolerances do.

    Raises:
        TaskcalError: the robot is not built like one of Universal Robots, or has parts that the form does not hold.
    """
    return export_as("UR's YAML", _ur_yaml, calibration, q, accept_loss=accept_loss, accept_uncertain=accept_uncertain)


def _comments(chain: CalibratedChain) -> list[str]:
    return [f"# {shown(chain.warning, 200)}"] if chain.warning else []


@checked
def export_xarm_yaml(
    calibration: Calibration,
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    accept_loss: bool = False,
    accept_uncertain: bool = False,
) -> Export:
    """Export the calibrated robot as the place of each joint in the one before it, as UFACTORY's ROS packages take it.

    The form ends at the last joint; arguments and `Export.frames` are as of `export_ur_yaml`.

    Raises:
        TaskcalError: the robot is not built like one of UFACTORY, or has parts that the form does not hold.
    """
    keys = {"accept_loss": accept_loss, "accept_uncertain": accept_uncertain}
    return export_as("xArm's YAML", _xarm_yaml, calibration, q, **keys)


@checked
def export_flexiv_yaml(
    calibration: Calibration,
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    accept_loss: bool = False,
    accept_uncertain: bool = False,
) -> Export:
    """Export the calibrated robot as the place of each joint in the one before it, as Flexiv's ``SyncKinematicsYAML`` writes it.

    The form holds the controller's flange; arguments and `Export.frames` are as of `export_ur_yaml`.

    Raises:
        TaskcalError: the robot is not built like a Rizon, or has parts that the form does not hold.
    """
    keys = {"accept_loss": accept_loss, "accept_uncertain": accept_uncertain}
    return export_as("Flexiv's YAML", _flexiv_yaml, calibration, q, **keys)


PARALLEL_AXES = (0.0, 1.0, 1.0, 0.0, 0.0)
"""Of Universal Robots' arms: cosines between the axes of neighbouring joints; shoulder lift, elbow and wrist 1 are parallel."""


def _ur_yaml(chain: CalibratedChain) -> WrittenChain:
    written = _kinematics(chain, LINKS, "a UR", (f"  hash: taskcal_{chain.robot.digest}",))
    R = ErrorModel(chain.robot).poses(np.vstack([np.zeros(len(LINKS)), 0.1 * np.eye(len(LINKS))]))[:, :3, :3]
    axis = se3.log(R[1:] @ R[0].T) / 0.1
    if not np.allclose(np.abs((axis[1:] * axis[:-1]).sum(axis=1)), PARALLEL_AXES, atol=1e-6):
        raise TaskcalError(
            f"{chain.robot.name} is not built like a UR, whose axes 2, 3 and 4 are parallel and the others at right angles: its "
            "drivers would take the file for another arm; write a URDF (--form urdf)"
        )
    return written


def _xarm_yaml(chain: CalibratedChain) -> WrittenChain:
    return _kinematics(chain, _numbered(chain, "an xArm", "UFACTORY"), "an xArm")


def _flexiv_yaml(chain: CalibratedChain) -> WrittenChain:
    axes = "zyzyzyz"
    if len(chain.robot.joints) != len(axes):
        raise TaskcalError(f"{chain.robot.name} is not built like a Rizon, which has {len(axes)} joints")
    return _kinematics(chain, _numbered(chain, "a Rizon", "Flexiv"), "a Rizon", axes=axes, flange="link7_to_flange")


def _numbered(chain: CalibratedChain, like: str, maker: str) -> tuple[str, ...]:
    """The robot's joints, which are numbered.

    Raises:
        TaskcalError: they are not.
    """
    names = tuple(f"joint{k + 1}" for k in range(len(chain.robot.joints)))
    if chain.robot.joint_names != names:
        raise TaskcalError(
            f"{chain.robot.name} has the joints {', '.join(chain.robot.joint_names)}, {like} joint1, joint2 and so on; import "
            f"the robot from {maker}'s URDF"
        )
    return names


_TURNS = {"z": np.eye(4), "y": se3.rotation("z", np.pi / 2) @ se3.rotation("y", np.pi / 2)}
"""Of a joint's frame, about whose z it turns, in its link's, as importing a URDF has it."""


def _kinematics(
    chain: CalibratedChain,
    links: tuple[str, ...],
    like: str,
    ending: tuple[str, ...] = (),
    axes: str = "",
    flange: str = "",
) -> WrittenChain:
    """Place of each link in the one before.

    Args:
        chain: the robot.
        links: what the file calls them.
        like: what the robot has to be built like.
        ending: lines behind them.
        axes: of its link, about which each joint turns; z by default.
        flange: what the file calls the controller's flange in the last link; where it has none, what turns about and slides along
            the last axis is the last link's own.
    """
    robot = chain.robot
    alike = len(robot.joints) == len(links) and not any(robot.prismatic) and not robot.driven
    if not alike or not np.array_equal(chain.matrix, np.eye(len(links))):
        raise TaskcalError(
            f"{robot.name} is not built like {like}: the form has {len(links)} revolute joints at the controller's angles; write a "
            "URDF (--form urdf)"
        )
    axes = axes or "z" * len(links)
    origins, behind = _origins(chain, axes)
    if flange:
        tool = robot.T_flange_tool
        links, origins, axes = (*links, flange), [*origins, behind @ se3.inverse(tool)], axes + "z"
    else:
        yaw = float(np.arctan2(behind[1, 0], behind[0, 0])) if np.hypot(behind[0, 0], behind[1, 0]) > 1e-9 else 0.0
        own = se3.translation(0.0, 0.0, float(behind[2, 3])) @ se3.rotation("z", yaw)
        origins[-1], tool = origins[-1] @ own, se3.inverse(own) @ behind
    lines = [*_comments(chain), "kinematics:"]
    for link, T, axis in zip(links, origins, axes, strict=True):
        values = [*T[:3, 3], *roll_pitch_yaw(T[:3, :3])]
        keys = ("x", "y", "z", "roll", "pitch", "yaw")
        lines += [f"  {link}:", *(f"    {key}: {float(v) + 0.0!r}" for key, v in zip(keys, values, strict=True))]
        lines += ["    axis: 0 1 0"] * (axis == "y")
    return WrittenChain(text="\n".join([*lines, *ending]) + "\n", poses=chain.poses, frames={"tool": tool})


def _origins(chain: CalibratedChain, axes: str) -> tuple[list[Float[np.ndarray, "4 4"]], Float[np.ndarray, "4 4"]]:
    """Place of each link in the one before, and of the tool in the last; each link's frame where its maker put it.

    A link's frame may slide along its axis: for a standard table its d, which follows the joint, is taken before it.
    """
    described = chain.robot.description["joint"]
    pending, out = np.eye(4), list[np.ndarray]()
    for joint, axis in zip(chain.joints, axes, strict=True):
        slide = se3.translation(0.0, 0.0, described[joint.coordinate].get("dh", {}).get("d_mm", 0.0) * 1e-3)
        turned = moved("revolute", chain.offset[joint.coordinate : joint.coordinate + 1])[0]
        out.append(pending @ joint.before @ turned @ slide @ se3.inverse(_TURNS[axis]))
        pending = _TURNS[axis] @ se3.inverse(slide)
    return out, pending @ chain.end


# A calibrated robot as a table of Denavit and Hartenberg, with the base and tool that the table cannot hold beside
# it.

PARALLEL = 1e-9
"""Sine of the angle between axes that are parallel to rounding."""

NEARLY_PARALLEL = 5e-3
"""Sine of an angle that only defects make: the common normal of such axes is far away."""

MAX_NORMAL_M = 1e3
"""Distance of a common normal that a table still states; beyond it axes are taken for parallel."""


@dataclass(frozen=True, eq=False, kw_only=True)
class DHForm:
    """Rows of a table, metres and radians, as `export_dh` and the exports write them."""

    convention: Literal["dh", "mdh"]
    rows: Float[np.ndarray, "joints 4"]
    """alpha, a, d, theta offset of each."""
    base: Float[np.ndarray, "4 4"]
    """Pose of the table's base in the robot's."""
    tool: Float[np.ndarray, "4 4"]
    """Pose of the tool in the table's last frame."""
    matrix: Float[np.ndarray, "joints joints"]
    """Angles of the table are matrix·q + theta offset."""

    def poses(self, q: Float[np.ndarray, "n joints"]) -> Float[np.ndarray, "n 4 4"]:
        """Poses of the tool in the robot's base."""
        theta = q @ self.matrix.T + self.rows[:, 3]
        T = np.broadcast_to(self.base, (len(q), 4, 4))
        for i, (alpha, a, d, _) in enumerate(self.rows):
            across = (
                se3.translation(a) @ se3.rotation("x", alpha)
                if self.convention == "dh"
                else se3.rotation("x", alpha) @ se3.translation(a)
            )
            along = moved("revolute", theta[:, i]) @ se3.translation(0.0, 0.0, d)
            T = T @ along @ across if self.convention == "dh" else T @ across @ along
        return T @ self.tool


@checked
def export_dh(
    calibration: Calibration,
    convention: Literal["dh", "mdh"],
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    accept_loss: bool = False,
    accept_uncertain: bool = False,
) -> Export:
    """Export the calibrated robot as a table, which `taskcal.read_dh_table` reads.

    Any chain of revolute joints has such a table, if its base and its tool may be anywhere; comments of the file and
    `Export.frames` state them. The tracker's registration takes up the first, the tool's frame the second.

    Args:
        calibration: the robot.
        convention: ``dh`` (standard) or ``mdh`` (modified).
        q: joint positions at which a loss is measured; all over the ranges by default.
        accept_loss: write it although it loses something.
        accept_uncertain: write it although the calibration knows less there than the robot's tolerances do.

    Raises:
        TaskcalError: the robot has prismatic or driven joints, or parts that no table holds; the message has the loss.
    """

    def write(chain: CalibratedChain) -> WrittenChain:
        return _dh_table(chain, convention)

    return export_as("a table", write, calibration, q, accept_loss=accept_loss, accept_uncertain=accept_uncertain)


def _dh_table(chain: CalibratedChain, convention: Literal["dh", "mdh"]) -> WrittenChain:
    robot = chain.robot
    if any(robot.prismatic) or robot.driven:
        kind = "prismatic" if any(robot.prismatic) else "driven"
        raise TaskcalError(f"{robot.name} has {kind} joints, which a table cannot hold; write a URDF (--form urdf)")
    table, lacking = fit_table(chain, convention), list[str]()
    twist = np.abs(np.sin(table.rows[:, 0]))
    while np.abs(table.rows[:, 1:3]).max() > MAX_NORMAL_M:
        smallest = float(twist[twist > PARALLEL].min())
        lacking.append(
            f"axes {np.degrees(smallest):.5f}° from parallel, whose common normal is beyond {MAX_NORMAL_M:g} m"
        )
        table = fit_table(chain, convention, parallel=1.001 * smallest)
        twist = np.where(twist <= smallest, 0.0, twist)
    remarks = tuple(
        f"alpha in row {i + 1} is {np.degrees(table.rows[i, 0]):.5f}°: axes so nearly parallel have their common normal far away, "
        "and a and d there are no lengths of the robot"
        for i in np.flatnonzero((twist > PARALLEL) & (twist < NEARLY_PARALLEL))
    )
    frames = {"base": table.base, "tool": table.tool}
    return WrittenChain(
        text=_text(chain, table), poses=table.poses, frames=frames, remarks=remarks, lacking=tuple(lacking)
    )


def fit_table(chain: CalibratedChain, convention: Literal["dh", "mdh"], parallel: float = PARALLEL) -> DHForm:
    """The table of a chain: its axes and their common normals, where the controller's joints are at zero.

    Args:
        chain: the chain.
        convention: ``dh`` (standard) or ``mdh`` (modified).
        parallel: sine of the angle below which axes are taken for parallel.
    """
    n = len(chain.joints)
    frames: list[np.ndarray] = []
    T = np.eye(4)
    for joint in chain.joints:
        T = T @ joint.before @ moved(joint.kind, chain.offset[joint.coordinate : joint.coordinate + 1])[0]
        frames.append(T)
    base = _first_frame(frames[0])
    x, foot = base[:3, 0], base[:3, 3]
    rows = np.zeros((n, 4))
    after = np.zeros((n, 2))  # alpha and a behind each axis
    for i in range(n - 1):
        z = frames[i][:3, 2]
        normal, here, there = _common_normal(frames[i], frames[i + 1], foot, parallel)
        across = np.cross(z, frames[i + 1][:3, 2])
        after[i] = np.arctan2(across @ normal, z @ frames[i + 1][:3, 2]), (there - here) @ normal
        rows[i, 2:] = (here - foot) @ z, np.arctan2(np.cross(x, normal) @ z, x @ normal)
        x, foot = normal, there
    z = frames[-1][:3, 2]
    last = se3.pose(np.stack([x, np.cross(z, x), z], axis=1), foot)
    end = se3.inverse(last) @ T @ chain.end
    flange = end @ se3.inverse(chain.robot.T_flange_tool)
    yaw = np.arctan2(flange[1, 0], flange[0, 0]) if np.hypot(flange[0, 0], flange[1, 0]) > 1e-9 else 0.0
    rows[-1, 2:] = flange[2, 3], yaw
    turned = se3.rotation("z", float(yaw)) @ se3.translation(0.0, 0.0, float(flange[2, 3]))
    rows[:, :2] = after if convention == "dh" else np.roll(after, 1, axis=0)
    return DHForm(convention=convention, rows=rows, base=base, tool=se3.inverse(turned) @ end, matrix=chain.matrix[:n])


def _first_frame(first: Float[np.ndarray, "4 4"]) -> Float[np.ndarray, "4 4"]:
    """On the first axis, as near to the robot's base as can be."""
    z, on = first[:3, 2], first[:3, 3]
    start = np.eye(3)[0] if abs(z[0]) < 0.9 else np.eye(3)[1]
    x = start - z * (start @ z)
    x /= np.linalg.norm(x)
    return se3.pose(np.stack([x, np.cross(z, x), z], axis=1), on - z * (on @ z))


def _common_normal(
    one: Float[np.ndarray, "4 4"], other: Float[np.ndarray, "4 4"], start: Float[np.ndarray, " 3"], parallel: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Direction of the common normal of two z axes, as near to the first frame's x as its sign allows, and its two feet."""
    z, w = one[:3, 2], other[:3, 2]
    across, between = np.cross(z, w), other[:3, 3] - one[:3, 3]
    square = float(across @ across)
    if square < parallel**2:
        here = start
        way = other[:3, 3] - here
        way = way - z * (way @ z)
        distance = float(np.linalg.norm(way))
        normal = way / distance if distance > 1e-9 else one[:3, 0]
        there = here + way
    else:
        normal = across / np.sqrt(square)
        here = one[:3, 3] + z * (np.cross(between, w) @ across / square)
        there = other[:3, 3] + w * (np.cross(between, z) @ across / square)
    return (normal if normal @ one[:3, 0] >= 0.0 else -normal), here, there


def _text(chain: CalibratedChain, table: DHForm) -> str:
    names = chain.robot.joint_names
    lines = [f"# {chain.robot.name}, calibrated; {table.convention}, millimetres and degrees", *_comments(chain)]
    for what, T in (("base of the table in the robot's base", table.base), ("tool in the last frame", table.tool)):
        place = placed(T)
        x, y, z = place["position_mm"]
        a, b, c, d = place["quaternion"]
        lines.append(f"# {what}: x {x:.6f} y {y:.6f} z {z:.6f} mm; qx {a:.12f} qy {b:.12f} qz {c:.12f} qw {d:.12f}")
    limits = np.degrees(chain.robot.limits)
    limited, coupled = bool(np.isfinite(limits).all()), not np.array_equal(table.matrix, np.eye(len(names)))
    header = ["joint", "alpha_deg", "a_mm", "d_mm", "theta_offset_deg"]
    lines.append(
        ",".join(
            [*header, *(["theta_from_controller"] if coupled else []), *(["lower_deg", "upper_deg"] if limited else [])]
        )
    )
    for i, (alpha, a, d, theta) in enumerate(table.rows):
        cells = [names[i], *(f"{v:.12f}" for v in (np.degrees(alpha), a * 1e3, d * 1e3, np.degrees(theta)))]
        if coupled:
            cells.append(" ".join(f"{v:+.12g}*{names[j]}" for j, v in enumerate(table.matrix[i]) if v))
        if limited:
            cells += [f"{v:.9g}" for v in limits[i]]
        lines.append(",".join(cells))
    return "\n".join(lines) + "\n"
