"""Pixels: corners of boards in a camera's pictures, the camera on the wrist or beside the robot that carries the board.

A row is a picture. What moves, camera or board, is the target; what stands is fixed in the robot's base. Of a camera θ, a picture
has the pose M(θ) of what moves in the frame of what stands, with the covariance that its corners leave it; what the corners say of
θ beside these poses is stated of it (`camera`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.geometry.point_registration import orientations
from taskcal.observations.base import (
    Differential,
    Measured,
    Observation,
    ObservedColumns,
    Read,
    Scene,
    Stated,
    TrackerNoise,
)
from taskcal.observations.camera import DISTORTION, KILO, Lens, Pictures, Settled
from taskcal.observations.pose import turn_by_rotation
from taskcal.observations.standalone import Search, Standalone
from taskcal.robot.parameter import ShownUnit

FEWEST = 3
"""Pictures, to find camera and board without a guess."""

COMPONENTS = ("tx", "ty", "tz", "rx", "ry", "rz")

CLEAR_TURN_RAD = np.radians(170.0)
"""Turn under which a rotation vector does not change its sign by errors."""

NO_INFORMATION = 1e-12
"""Eigenvalues of what the corners say of a camera, over the largest, under which they say nothing."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pixels(Standalone):
    """M(θ) = L⁻¹·X: what moves, X, in the frame L of what stands, as pictures of a camera θ have it."""

    key: ClassVar[str] = "pixels"
    width: ClassVar[int] = 6
    angles: ClassVar[int] = 3
    oriented: ClassVar[bool] = True
    turned: ClassVar[bool] = True
    pictured: ClassVar[bool] = True
    instrument: ClassVar[str] = "pixels"
    label: ClassVar[str] = "image"
    needed: ClassVar[tuple[str, ...]] = ("image",)
    columns: ClassVar[Mapping[str, tuple[str, ...]]] = MappingProxyType(
        {"image": ("image", "picture", "photo", "bild", "image file", "file", "filename")}
    )
    units: ClassVar[Mapping[str, ShownUnit]] = MappingProxyType(
        {
            **Observation.units,
            **dict.fromkeys(("fx", "fy", "cx", "cy"), ShownUnit("px", KILO)),
            **{name: ShownUnit("", 1.0) for names in DISTORTION.values() for name in names},
            "scale": ShownUnit("ppm", 1e6),
        }
    )
    things: ClassVar[str] = "images"
    images: tuple[str, ...] = ()
    """Names of the pictures that rows refer to."""
    boards: tuple[str, ...] = ()
    """Names of the boards; of none before the pictures are looked at."""
    u_scale: tuple[float, ...] = ()
    """Relative standard uncertainty of the size of each as it is stated; zero where that is taken for exact."""
    lens: Lens | None = None
    on_wrist: bool = True
    """Whether the camera moves, and the boards stand; else the one board moves."""
    pictures: Pictures | None = None
    """What the images show, in their order; None of a calibration, whose own rows are not kept."""

    @property
    def standing(self) -> tuple[str, ...]:
        """Names of what stands."""
        return tuple(f"board {name}" for name in self.boards) if self.on_wrist else ("camera",)

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Places of what stands, the camera, and the scales of the boards whose size is not exact."""
        poses = (f"{name}.{c}" for name in self.standing for c in COMPONENTS)
        camera = () if self.lens is None else (f"camera.{name}" for name in self.lens.unknowns)
        return (*poses, *camera, *(f"board {self.boards[b]}.scale" for b in self._scaled))

    @property
    def _scaled(self) -> list[int]:
        return [b for b, u in enumerate(self.u_scale) if u > 0.0]

    @property
    def _camera(self) -> slice:
        """Of the camera among the unknowns."""
        first = 6 * len(self.standing)
        return slice(first, first + (0 if self.lens is None else len(self.lens.unknowns)))

    @property
    def deviations(self) -> Float[np.ndarray, " u"]:
        """As good as unknown; of the scales `stated` says more."""
        camera = np.ones(0) if self.lens is None else self.lens.deviations
        return np.concatenate([np.ones(6 * len(self.standing)), camera, np.ones(len(self._scaled))])

    def _scales(self, unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, " boards"]:
        out = np.ones(max(len(self.boards), 1))
        out[self._scaled] += unknown[self._camera.stop :]
        return out

    def _pictured(self) -> Settled:
        """The pictures at the camera that they alone have."""
        if self.pictures is None:
            raise CampaignError(
                "these rows name images that were not looked at; give --images FOLDER and --board BOARD.toml"
            )
        return self.pictures.settle(self.pictures.camera)

    @property
    def board_of(self) -> Int[np.ndarray, " n"]:
        """Board of each row."""
        return np.zeros(len(self.numbers), dtype=int) if self.pictures is None else self.pictures.board[self.numbers]

    def measured(self, settled: Settled) -> Float[np.ndarray, "images 4 4"]:
        """What moves in the frame of what stands, of boards of their stated size."""
        T = settled.T_camera_board
        return se3.inverse(T) if self.on_wrist else T

    def _twist(self, T_camera_board: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "n 6 6"]:
        """Move and turn of M by those of the board in the camera's frame."""
        out = np.tile(np.eye(6), (len(T_camera_board), 1, 1))
        if self.on_wrist:
            back = -np.swapaxes(T_camera_board[:, :3, :3], 1, 2)
            out[:, :3, :3] = out[:, 3:, 3:] = back
            out[:, :3, 3:] = back @ np.cross(np.eye(3), T_camera_board[:, None, :3, 3])
        return out

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives, in the axes of what stands."""
        assert measured.rotations is not None
        n, board, own = len(target), self.board_of, self._camera
        place = board if self.on_wrist else np.zeros(n, dtype=int)
        poses, scale = unknown[: own.start].reshape(-1, 6), self._scales(unknown)
        M, by_camera = se3.pose(measured.rotations, measured.points), np.zeros((n, 6, own.stop - own.start))
        if self.pictures is not None and self.of is not None:
            settled = self.pictures.settle(unknown[own])
            pictured = np.flatnonzero(self.of >= 0)
            k = self.of[pictured]
            M[pictured] = self.measured(settled)[k]
            by_camera[pictured] = (self._twist(settled.T_camera_board) @ settled.by_camera)[k]
        M[:, :3, 3] *= scale[board, None]
        by_camera[:, :3] *= scale[board, None, None]
        R = np.swapaxes(se3.exp(poses[:, 3:]), 1, 2)[place]
        between = target[:, :3, 3] - poses[place, :3]
        seen, turned = measured.valid, np.zeros((n, 3))
        turned[seen] = se3.log(M[seen, :3, :3] @ np.swapaxes(R[seen] @ target[seen, :3, :3], 1, 2))
        by_turn = turn_by_rotation(turned)
        by_target, by_unknown = np.zeros((n, 6, 6)), np.zeros((n, 6, len(unknown)))
        by_target[:, :3, :3], by_target[:, 3:, 3:] = R, by_turn @ R
        jacobian = np.stack([se3.left_jacobian(r) for r in poses[:, 3:]])[place]
        for row, columns in enumerate(6 * place[:, None] + np.arange(6)):
            by_unknown[row, :3, columns[:3]] = -R[row].T
            by_unknown[row, :3, columns[3:]] = (R[row] @ np.cross(between[row], jacobian[row].T).T).T
            by_unknown[row, 3:, columns[3:]] = -(by_turn[row] @ R[row] @ jacobian[row]).T
        by_unknown[:, :3, own] = -by_camera[:, :3]
        by_unknown[:, 3:, own] = -np.swapaxes(by_turn, 1, 2) @ by_camera[:, 3:]
        for column, b in enumerate(self._scaled, start=own.stop):
            by_unknown[:, :3, column] = (board == b)[:, None] * M[:, :3, 3] / -scale[b]
        residual = np.concatenate([M[:, :3, 3] - (R @ between[:, :, None])[..., 0], turned], axis=1)
        return Differential(residual, by_target, by_unknown)

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of each row by the noise of its corners."""
        settled = self._pictured()
        twist = self._twist(settled.T_camera_board)
        return (twist @ settled.pose_covariance @ np.swapaxes(twist, 1, 2))[self.numbers]

    def stated(self, unknown: Float[np.ndarray, " u"]) -> Stated:
        """What the corners say of the camera, however the boards are placed, and how large these are."""
        own, scales = self._camera, np.array([self.u_scale[b] for b in self._scaled])
        by_unknown = np.eye(len(unknown))[own.stop :]
        sizes = Stated(-unknown[own.stop :], by_unknown, scales)
        if self.pictures is None or self.of is None:
            return sizes
        used = np.unique(self.of[self.of >= 0])
        information, gradient = (part[used].sum(axis=0) for part in self.pictures.settle(unknown[own]).of_camera)
        size = np.sqrt(np.maximum(np.diag(information), 1e-300))
        values, axes = np.linalg.eigh(information / np.outer(size, size))
        told = values > NO_INFORMATION * max(values.max(initial=0.0), 1e-300)
        root, axes = np.sqrt(values[told]), axes[:, told]
        by_camera = np.zeros((len(root), len(unknown)))
        by_camera[:, own] = root[:, None] * axes.T * size
        return Stated(
            np.concatenate([(axes.T @ (gradient / size)) / root, sizes.residual]),
            np.concatenate([by_camera, by_unknown]),
            np.concatenate([np.ones(len(root)), scales]),
        )

    def reproject(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, "c 2"] | None:
        """Pixels of all corners less those predicted for the target where the robot has it."""
        if self.pictures is None or self.of is None:
            return None
        rows = np.zeros(len(self.pictures), dtype=int)
        rows[self.of[self.of >= 0]] = np.flatnonzero(self.of >= 0)
        poses, own = unknown[: self._camera.start].reshape(-1, 6), self._camera
        place = self.pictures.board if self.on_wrist else np.zeros(len(rows), dtype=int)
        M = se3.inverse(se3.pose(se3.exp(poses[:, 3:]), poses[:, :3])[place]) @ target[rows]
        T = se3.inverse(M) if self.on_wrist else M
        # corners are at their stated places, so that a larger board is seen as one that is nearer
        T[:, :3, 3] /= self._scales(unknown)[self.pictures.board, None]
        return self.pictures.pixel - self.pictures.predicted(T, unknown[own])

    def two_steps(self, tool: Float[np.ndarray, "n 4 4"]) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, " u"]]:
        """The usual way: a camera from the pictures alone, then hand and eye from their poses and those of the nominal tool.

        Args:
            tool: its nominal poses at all rows.

        Returns:
            pose of what moves in the tool frame, and the unknowns.
        """
        assert self.of is not None
        rows = np.flatnonzero(self.of >= 0)
        here = replace(self, of=self.of[rows])
        T, M = here._of_one_board(tool[rows])
        R = hand_eye_rotation(T, M)
        X, unknown = se3.pose(R, hand_eye_place(T, M, R)), np.full(len(self.unknowns), np.nan)
        return X, here.settle(tool[rows] @ X, here.blank(len(rows)), unknown)

    def _of_one_board(self, tool: Float[np.ndarray, "n 4 4"]) -> tuple[np.ndarray, np.ndarray]:
        """Poses of the tool, and M as pictures alone have it, of the rows that show the board that most show."""
        M, board = self.measured(self._pictured())[self.numbers], self.board_of
        most = board == np.bincount(board).argmax() if self.on_wrist else np.ones(len(board), dtype=bool)
        return tool[most], M[most]

    def check(self, rows: Search) -> None:
        """Raise a `CampaignError` where the pictures are too few to find camera and board."""
        if len(rows.tool) < FEWEST:
            raise CampaignError(
                f"{len(rows.tool)} pictures with a board do not tell where camera and board are; take {FEWEST} or more, better 20"
            )

    def starts(self, rows: Search) -> Iterable[Float[np.ndarray, " x"]]:
        """The hand-eye of linear equations, and many orientations, with the places that fit best beside them."""
        here = replace(self, of=rows.kind.of)
        T, M = here._of_one_board(rows.tool)
        for R in (hand_eye_rotation(T, M), *orientations()):
            yield rows.about(se3.pose(R, hand_eye_place(T, M, R)))

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each thing that stands in the middle of what its rows say; the camera as it is known, or as its pictures have it."""
        assert measured.rotations is not None
        out, own, seen = known.copy(), self._camera, measured.valid
        camera = known[own]
        if self.pictures is not None and self.of is not None:
            camera = np.where(np.isnan(camera), self.pictures.camera, camera)
            M = self.measured(self.pictures.settle(camera))[self.numbers]
        else:
            M = se3.pose(measured.rotations, measured.points)
        out[own] = camera
        out[own.stop :] = np.nan_to_num(out[own.stop :])
        M[:, :3, 3] *= self._scales(out)[self.board_of, None]
        L = target[seen] @ se3.inverse(M[seen])
        place = self.board_of[seen] if self.on_wrist else np.zeros(len(L), dtype=int)
        for number in range(len(self.standing)):
            here = L[place == number]
            out[6 * number : 6 * number + 6] = np.nan if not len(here) else _middle(here)
        return out

    def take(self, rows: Int[np.ndarray, " k"]) -> "Pixels":
        """The observation of some rows, with their images."""
        if self.of is None:
            return self
        numbers, of = np.unique(self.of[rows][self.of[rows] >= 0], return_inverse=True)
        there = np.full(len(rows), -1)
        there[self.of[rows] >= 0] = of
        pictures = None if self.pictures is None else self.pictures.take(numbers)
        return replace(self, of=there, images=tuple(self.images[k] for k in numbers), pictures=pictures)

    @classmethod
    def stage(cls, tool: Float[np.ndarray, "n 4 4"], places: int | None, rng: np.random.Generator) -> Scene:
        """Refuse: images are simulated with a board and a camera (`take_shots`), and poses for them planned as for a board."""
        raise CampaignError(
            "poses for 'pixels' are planned as for a board: --observe board; images are simulated with --board BOARD.toml alone"
        )

    @classmethod
    def read(cls, columns: ObservedColumns) -> Read | None:
        """An image in every row that names one; what it shows is filled in by `with_pictures`.

        Raises:
            FileError: two rows name the same image.
        """
        if "image" not in columns:
            return None
        texts = columns.texts("image")
        for row, text in enumerate(texts):
            if text and text in texts[:row]:
                raise columns.error(f"image '{text}' is named in two rows; a picture is of one pose", row, "image")
        names = tuple(text for text in texts if text)
        of = np.cumsum([bool(text) for text in texts]) - 1
        there = np.array([bool(text) for text in texts])
        points = np.where(there[:, None], 0.0, np.nan) * np.ones(3)
        R = np.tile(np.eye(3), (len(texts), 1, 1))
        return Read("camera", cls(images=names, of=np.where(there, of, -1)), points, R) if names else None

    def cells(self, measured: Measured) -> dict[str, list[str]] | None:
        """The image of every row; what it shows is in a file of corners."""
        return {"image": self.labels(measured)}

    def describe(self) -> dict[str, Any]:
        """Camera and boards, without pictures."""
        lens = None if self.lens is None else {k: getattr(self.lens, k) for k in ("model", "width", "height")}
        return {"boards": list(self.boards), "u_scale": list(self.u_scale), "lens": lens, "on_wrist": self.on_wrist}

    @classmethod
    def of_description(cls, content: Mapping[str, Any]) -> "Pixels":
        """Make it from what `describe` gave."""
        lens = None if content["lens"] is None else Lens(**content["lens"])
        return cls(
            boards=tuple(content["boards"]),
            u_scale=tuple(map(float, content["u_scale"])),
            lens=lens,
            on_wrist=bool(content["on_wrist"]),
        )


def _middle(T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, " 6"]:
    """Place and rotation vector of a pose in the middle of some."""
    R = se3.nearest_rotation(np.median(T[:, :3, :3], axis=0))
    turn = se3.exp(np.median(se3.log(T[:, :3, :3] @ R.T), axis=0)) @ R
    return np.concatenate([np.median(T[:, :3, 3], axis=0), se3.log(turn)])


# The usual hand-eye of poses alone, as a start.


def hand_eye_rotation(T: Float[np.ndarray, "n 4 4"], M: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "3 3"]:
    """Rotation of X with T·X = L·M, by the turns between all pairs of rows (Park and Martin 1994)."""
    first, second = np.triu_indices(len(T), 1)
    of_t, of_m = (se3.log(np.swapaxes(P[first, :3, :3], 1, 2) @ P[second, :3, :3]) for P in (T, M))
    clear = (np.linalg.norm(of_t, axis=1) < CLEAR_TURN_RAD) & (np.linalg.norm(of_m, axis=1) < CLEAR_TURN_RAD)
    return se3.nearest_rotation(of_t[clear].T @ of_m[clear])


def hand_eye_place(
    T: Float[np.ndarray, "n 4 4"], M: Float[np.ndarray, "n 4 4"], R: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, " 3"]:
    """Place of X with T·X = L·M for its rotation; of L the rotation is in the middle of what the rows say."""
    turn = _middle(se3.pose(T[:, :3, :3] @ R @ np.swapaxes(M[:, :3, :3], 1, 2), np.zeros((len(T), 3))))[3:]
    rows = np.concatenate([T[:, :3, :3], np.tile(-np.eye(3), (len(T), 1, 1))], axis=2).reshape(-1, 6)
    right = (M[:, :3, 3] @ se3.exp(turn).T - T[:, :3, 3]).reshape(-1)
    return np.linalg.lstsq(rows, right, rcond=1e-9)[0][:3]
