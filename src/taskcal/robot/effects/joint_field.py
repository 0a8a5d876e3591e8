"""What each joint does that goes smoothly with all of them, of no form that is known beforehand."""

from dataclasses import dataclass

import numpy as np

from taskcal.robot.effects.base import Effect, LinearTerm, at_joints
from taskcal.robot.robot import Robot


@dataclass(frozen=True, kw_only=True)
class JointField(Effect):
    """A smooth random function of all joints that turns each joint: loads, cables and friction that no other effect has.

    Each is a Gaussian process with the squared exponential as its correlation, in random Fourier features (Rahimi and Recht
    2008, Advances in Neural Information Processing Systems 20): cosines and sines of random directions in joint space.
    """

    key = "field"
    label = "smooth field"
    summary = "each joint turns by a smooth function of all joints, of no form that is known beforehand"

    tolerance: float = 3e-5
    """Standard deviation expected of each function, radians (metres where the joint slides)."""
    length: float = 1.5
    """Change of the joints at which it becomes another, radians; lengths in metres count alike."""
    features: int = 20
    """Cosines, and as many sines, of each joint."""
    seed: int = 0
    """Of the directions."""

    def term(self, robot: Robot) -> LinearTerm:
        """Parameters ``J2.field_cos1``, ``J2.field_sin1`` …, radians."""
        joints = self.chosen(robot)
        rng = np.random.default_rng(self.seed)
        direction = rng.standard_normal((self.features, len(robot.joints))) / self.length
        shapes = [(j, k, part) for j in joints for k in range(self.features) for part in ("cos", "sin")]
        feature = np.array([k for _, k, _ in shapes], dtype=np.int64)
        phase = np.array([0.0 if part == "cos" else 0.5 * np.pi for _, _, part in shapes])

        def basis(q: np.ndarray) -> np.ndarray:
            return np.cos((q @ direction.T)[:, feature] - phase)

        def by_joint(q: np.ndarray) -> np.ndarray:
            return -np.sin((q @ direction.T)[:, feature] - phase)[:, :, None] * direction[feature]

        return at_joints(
            [f"{robot.joint_names[j]}.field_{part}{k + 1}" for j, k, part in shapes],
            robot,
            np.array([j for j, _, _ in shapes], dtype=np.int64),
            [self.tolerance / np.sqrt(self.features)] * len(shapes),
            basis,
            by_joint=by_joint,
        )
