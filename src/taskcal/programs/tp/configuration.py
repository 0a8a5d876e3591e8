"""The configuration of a position: which of the postures that reach its pose is meant.

``N U T, 0, 0, 0`` says: no flip of the wrist (F: flipped), elbow up (D: down), wrist in front of axis 1 (B: behind), and the
turns of three axes, 0 from −180° to 180°, 1 up to 540°, and so on.

A position that a controller printed both ways (axis 5 at −81.55°, N U T) shows that axis 5 is negative without flip. The last
number is that of axis 6; the first two are of axes 1 and 4 or of axes 4 and 5, as the controller is set up, so that they agree
here where either does. With the wrist behind axis 1 it is not known which elbow is called up: either counts.
"""

import re
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.programs.arm_bends import arm_bends
from taskcal.programs.unresolved import Unresolved
from taskcal.robot.robot import Robot

EDGE = np.radians(1e-6)
"""This near to the border between two values either is right, radians."""

SLACK = np.radians(1.0)
"""Postures of one pose differ by far more; its printed numbers are rounded, so that its joints are not exact, radians."""

_TEXT = re.compile(r"(?P<flip>[NF])\s*(?P<elbow>[UD])\s*(?P<front>[TB])\s*(?:,\s*(-?\d)\s*,\s*(-?\d)\s*,\s*(-?\d)\s*)?")


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """The configuration of a position."""

    flip: bool
    up: bool
    front: bool
    turns: tuple[int, int, int]

    def __str__(self) -> str:
        letters = f"{'F' if self.flip else 'N'} {'U' if self.up else 'D'} {'T' if self.front else 'B'}"
        return f"{letters}, {self.turns[0]}, {self.turns[1]}, {self.turns[2]}"

    @classmethod
    def parse(cls, text: str) -> "Configuration":
        """Read a configuration.

        Raises:
            Unresolved: it is of another form, such as that of an arm with another number of axes.
        """
        match = _TEXT.fullmatch(text.strip().upper())
        if match is None:
            raise Unresolved(f"its configuration '{text.strip()}' is not understood; known is N U T, 0, 0, 0")
        first, second, third = (int(turn or 0) for turn in match.groups()[3:])
        return cls(
            flip=match["flip"] == "F",
            up=match["elbow"] == "U",
            front=match["front"] == "T",
            turns=(first, second, third),
        )

    def agrees(self, robot: Robot, q: Float[np.ndarray, "n joints"]) -> Bool[np.ndarray, " n"]:
        """Whether each posture is the one meant; any is, of a robot without six turning joints."""
        right = np.ones(len(q), dtype=bool)
        if len(robot.joints) != 6 or any(robot.prismatic):
            return right
        right &= np.where(self.flip, q[:, 4] > -SLACK, q[:, 4] < SLACK)
        bends = arm_bends(robot, q)
        if bends is not None:
            right &= np.where(self.front, bends[:, 0] > -SLACK, bends[:, 0] < SLACK)
            if self.front:
                right &= np.where(self.up, bends[:, 1] > -SLACK, bends[:, 1] < SLACK)
        low, high = _turns(q - SLACK), _turns(q + SLACK)
        first, second, third = ((low <= turn) & (turn <= high) for turn in self.turns)
        return right & third[:, 5] & ((first[:, 0] & second[:, 3]) | (first[:, 3] & second[:, 4]))

    def of(self, robot: Robot, q: Float[np.ndarray, " joints"]) -> "Configuration":
        """The configuration of a posture.

        What the posture does not decide stays as it is here: on a border, and where the robot has no such arm. Turns are kept
        where they agree.

        Args:
            robot: the robot.
            q: joint positions, radians.
        """
        if len(robot.joints) != 6 or any(robot.prismatic):
            return self
        bends = arm_bends(robot, q[None])
        front, up = self.front, self.up
        if bends is not None:
            front = _decided(bends[0, 0], self.front)
            up = _decided(bends[0, 1], self.up) if front else self.up
        decided = Configuration(flip=_decided(q[4], self.flip), up=up, front=front, turns=self.turns)
        if decided.agrees(robot, q[None])[0]:
            return decided
        first, second, third = _turns(q[[0, 3, 5]]).tolist()
        return Configuration(flip=decided.flip, up=up, front=front, turns=(first, second, third))


def _decided(angle: float, otherwise: bool) -> bool:
    return otherwise if abs(angle) < EDGE else bool(angle > 0.0)


def _turns(q: Float[np.ndarray, "*n"]) -> Int[np.ndarray, "*n"]:
    """Whole turns of joints: 0 from −180° to 180°."""
    return np.sign(q).astype(np.int64) * np.floor((np.abs(q) + np.pi) / (2.0 * np.pi)).astype(np.int64)
