"""Drives that yield under weights that nobody knows: one parameter for each lever of each motor."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from taskcal.geometry.chain import Chain, Joint
from taskcal.robot.effects.linear_term import LinearTerm
from taskcal.robot.effects.load_path import LoadPath, at_motors, sample_poses
from taskcal.robot.robot import Robot

OWN_SHARE = 1e-6
"""Share of a column under which what is left of it is nothing of its own."""


def yield_under_lumped_weights(robot: Robot, motors: Sequence[int], tolerance: float) -> LinearTerm:
    """Parameters ``J2.sag_J4`` (weight at the origin of joint 4) … ``J2.sag_tool``, radians per metre of lever.

    Columns that a motor's others already span are left out.

    Args:
        robot: the robot.
        motors: those that yield.
        tolerance: of each parameter.
    """
    steps = robot.steps()
    ends = [k for k, step in enumerate(steps) if isinstance(step, Joint)] + [len(steps)]
    chains = [Chain.of(steps[:k]) for k in ends]
    sample = _levers(robot, chains, LoadPath.at(robot, sample_poses(robot)))
    kept: list[tuple[int, int]] = []
    for motor in motors:
        own: list[np.ndarray] = []
        for point in range(len(chains)):
            column = sample[:, point, motor]
            if _is_new(column, own):
                own.append(column)
                kept.append((motor, point))
    labels = [*robot.joint_names, "tool"]
    point = np.array([p for _, p in kept], dtype=np.int64)
    motor = np.array([m for m, _ in kept], dtype=np.int64)
    return at_motors(
        robot,
        [f"{robot.joint_names[m]}.sag_{labels[p]}" for m, p in kept],
        [m for m, _ in kept],
        [tolerance] * len(kept),
        lambda path: _levers(robot, chains, path)[:, point, motor],
        lambda path: np.stack([path.torque_by_joint(chain, robot.statics.gravity) for chain in chains], axis=1)[
            :, point, motor
        ],
        per="m",
    )


def _levers(robot: Robot, chains: Sequence[Chain], path: LoadPath) -> Float[np.ndarray, "n points motors"]:
    """How far the end of each chain goes down for a turn of each motor, metres per radian."""
    return np.stack([path.torque(chain, robot.statics.gravity) for chain in chains], axis=1)


def _is_new(column: Float[np.ndarray, " n"], others: list[Float[np.ndarray, " n"]]) -> bool:
    """Whether a column says something that a combination of the others does not."""
    size = float(np.linalg.norm(column))
    if size < OWN_SHARE * np.sqrt(len(column)):
        return False
    if not others:
        return True
    basis = np.stack(others, axis=1)
    rest = column - basis @ np.linalg.lstsq(basis, column, rcond=None)[0]
    return float(np.linalg.norm(rest)) > OWN_SHARE * size
