"""Poses with their derivatives, and the one pose that several pictures of one posture of the robot have together.

A pose T has the derivatives of its origin, and of its turn, in the axes of the frame that it is given in. Each picture has the pose
of what moves in the frame of what stands, with the information of its corners. Where one posture has several pictures, of several
boards or cameras, their poses are put together by that; how they differ beside it tells of boards and cameras among each other.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.geometry import se3

ROUNDS, TOGETHER = 10, 1e-12
"""Of Gauss and Newton for the pose of several pictures at most, and the last step of it, metres and radians."""


class Posed(NamedTuple):
    """Poses, and their derivatives by some numbers."""

    T: Float[np.ndarray, "n 4 4"]
    by: Float[np.ndarray, "n 6 u"]
    """Of the origin, then of the turn."""

    @classmethod
    def of_numbers(cls, pose: Float[np.ndarray, "n 6"], first: Int[np.ndarray, " n"], count: int) -> "Posed":
        """Of places and rotation vectors, which are among `count` numbers from `first` on."""
        by = np.zeros((len(pose), 6, count))
        rows = np.arange(len(pose))[:, None]
        for k in range(3):
            by[rows[:, 0], k, first + k] = 1.0
        turning = np.stack([se3.left_jacobian(r) for r in pose[:, 3:]]) if len(pose) else np.zeros((0, 3, 3))
        by[rows, 3:, first[:, None] + np.arange(3, 6)] = np.swapaxes(turning, 1, 2)
        return cls(se3.pose(se3.exp(pose[:, 3:]), pose[:, :3]), by)

    def take(self, rows: Int[np.ndarray, " k"]) -> "Posed":
        """Some of them."""
        return Posed(self.T[rows], self.by[rows])

    @property
    def inverse(self) -> "Posed":
        """Of the frame that they are given in, in theirs."""
        back = np.swapaxes(self.T[:, :3, :3], 1, 2)
        moved = np.cross(self.by[:, 3:], self.T[:, :3, 3, None], axis=1) - self.by[:, :3]
        return Posed(se3.inverse(self.T), np.concatenate([back @ moved, -back @ self.by[:, 3:]], axis=1))

    def then(self, other: "Posed") -> "Posed":
        """The product, each with one of the other's."""
        R = self.T[:, :3, :3]
        arm = (R @ other.T[:, :3, 3, None])[..., 0]
        move = self.by[:, :3] + np.cross(self.by[:, 3:], arm[..., None], axis=1) + R @ other.by[:, :3]
        return Posed(self.T @ other.T, np.concatenate([move, self.by[:, 3:] + R @ other.by[:, 3:]], axis=1))


def apart(T: Float[np.ndarray, "n 4 4"], from_T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 6"]:
    """Move and turn from one pose to another."""
    turned = se3.log(T[:, :3, :3] @ np.swapaxes(from_T[:, :3, :3], 1, 2))
    return np.concatenate([T[:, :3, 3] - from_T[:, :3, 3], turned], axis=1)


class Views(NamedTuple):
    """What pictures say together of each posture in which some were taken."""

    moving: Posed
    """What moves in the frame of what stands, one for each posture."""
    place: Int[np.ndarray, " v"]
    """Number of what stands in whose frame each is: that of the picture with most corners."""
    information: Float[np.ndarray, "v 6 6"]
    """Of a move and a turn of what moves."""
    of: Int[np.ndarray, " d"]
    """Posture of each picture that is not the only one of its posture."""
    residual: Float[np.ndarray, "d 6"]
    """How far these are from the pose that they have together, over their noise."""
    by_unknown: Float[np.ndarray, "d 6 u"]
    """Derivative of the same."""

    @property
    def covariance(self) -> Float[np.ndarray, "v 6 6"]:
        """Of a move and a turn of what moves, by the noise of the corners."""
        return np.linalg.inv(self.information)


def join_views(
    pictured: Posed,
    information: Float[np.ndarray, "n 6 6"],
    view: Int[np.ndarray, " n"],
    first: Int[np.ndarray, " v"],
    place: Int[np.ndarray, " v"],
) -> Views:
    """Put pictures of one posture together.

    Args:
        pictured: what moves in the frame of what stands as each picture has it.
        information: of a move and a turn of that.
        view: posture of each picture.
        first: a picture of each posture, near which the pose is looked for.
        place: number of what stands, of each posture.
    """
    counts = np.bincount(view, minlength=len(first))
    T, by, whole = pictured.T[first], pictured.by[first], information[first]
    several = np.flatnonzero(counts[view] > 1)
    own, W, one = view[several], information[several], pictured.take(several)
    if not len(several):
        return Views(Posed(T, by), place, whole, own, np.zeros((0, 6)), np.zeros((0, 6, by.shape[2])))
    joined = np.unique(own)

    def total(values: np.ndarray) -> np.ndarray:
        out = np.zeros((len(first), *values.shape[1:]))
        np.add.at(out, own, values)
        return out[joined]

    whole[joined] = total(W)
    for _ in range(ROUNDS):
        step = np.linalg.solve(whole[joined], total(W @ apart(one.T, T[own])[:, :, None]))[..., 0]
        T[joined, :3, :3] = se3.exp(step[:, 3:]) @ T[joined, :3, :3]
        T[joined, :3, 3] += step[:, :3]
        if np.abs(step).max() < TOGETHER:
            break
    by[joined] = np.linalg.solve(whole[joined], total(W @ one.by))
    values, axes = np.linalg.eigh(W)
    root = np.sqrt(np.maximum(values, 0.0))[:, :, None] * np.swapaxes(axes, 1, 2)
    off = apart(one.T, T[own])[:, :, None]
    return Views(Posed(T, by), place, whole, own, (root @ off)[..., 0], root @ (one.by - by[own]))
