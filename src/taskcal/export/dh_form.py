"""A calibrated robot as a table of Denavit and Hartenberg, with the base and tool that the table cannot hold beside it."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from taskcal.errors import TaskcalError
from taskcal.export.calibrated_chain import CalibratedChain, moved, spread_poses
from taskcal.export.export import Export, Loss, placed
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration

PARALLEL = 1e-9
"""Sine of the angle between axes that are parallel to rounding."""

NEARLY_PARALLEL = 5e-3
"""Sine of an angle that only defects make: the common normal of such axes is far away."""

FARTHEST = 1e3
"""Metres to a common normal that still are a number in a table; beyond them axes are taken for parallel."""


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


def export_dh(
    calibration: Calibration,
    convention: Literal["dh", "mdh"],
    q: Float[np.ndarray, "n joints"] | None = None,
    *,
    accept_loss: bool = False,
) -> Export:
    """The calibrated robot as a table, which `taskcal.read_dh_table` reads.

    Any chain of turning joints has such a table, once its base and its tool may stand anywhere; where these are, stands in
    comments of the file and in `Export.frames`. The tracker's registration takes up the first, the tool's frame the second.

    Args:
        calibration: the robot.
        convention: ``dh`` (standard) or ``mdh`` (modified).
        q: joint positions at which a loss is measured; all over the ranges by default.
        accept_loss: write it although it loses something.

    Raises:
        TaskcalError: the robot has sliding or driven joints, or parts that no table holds; the message says what would be lost.
    """
    q = spread_poses(calibration) if q is None else q
    chain = CalibratedChain.of(calibration, q)
    robot = chain.robot
    if any(robot.prismatic) or robot.driven:
        what = "sliding" if any(robot.prismatic) else "driven"
        raise TaskcalError(f"{robot.name} has {what} joints, which its table could not say; write a URDF (--form urdf)")
    table, lacking = fit_table(chain, convention), list[str]()
    twist = np.abs(np.sin(table.rows[:, 0]))
    while np.abs(table.rows[:, 1:3]).max() > FARTHEST:
        smallest = float(twist[twist > PARALLEL].min())
        lacking.append(f"axes {np.degrees(smallest):.5f}° from parallel, whose common normal is beyond {FARTHEST:g} m")
        table = fit_table(chain, convention, parallel=1.001 * smallest)
        twist = np.where(twist <= smallest, 0.0, twist)
    loss = Loss.of(calibration, q, table.poses(q), tuple(lacking))
    if not accept_loss:
        loss.refuse("a table")
    near = np.flatnonzero((twist > PARALLEL) & (twist < NEARLY_PARALLEL))
    remarks = [
        f"alpha in row {i + 1} is {np.degrees(table.rows[i, 0]):.5f}°: axes so nearly parallel have their common normal far away, "
        "and a and d there are no lengths of the robot"
        for i in near
    ]
    frames = {"base": table.base, "tool": table.tool}
    return Export(text=_text(chain, table), loss=loss, frames=frames, remarks=tuple(remarks))


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
    lines = [f"# {chain.robot.name}, calibrated; {table.convention}, millimetres and degrees"]
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
