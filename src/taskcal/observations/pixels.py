"""Pixels: corners of boards in a camera's pictures, the camera on the wrist or beside the robot that carries the board.

A row is a picture. What moves, camera or board, is the target; what stands is fixed in the robot's base. Of a camera θ, a picture
has the pose M(θ) of what moves in the frame of what stands, with the covariance that its corners leave it; what the corners say of
θ beside these poses is stated of it (`camera`).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.geometry.point_registration import orientations
from taskcal.kernels.projection import project
from taskcal.kinematics.clearance import Links
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
from taskcal.observations.calibration_board import Board, read_boards
from taskcal.observations.camera import DISTORTION, EXACT, FEWEST_CORNERS, KILO, LENSES, Lens, Pictures, Settled
from taskcal.observations.camera_file import StatedCamera, read_camera
from taskcal.observations.instrument import Fixtures, Instrument, Setting, far_apart, on_the_floor
from taskcal.observations.landmark import STANDING
from taskcal.observations.pose import turn_by_rotation
from taskcal.observations.standalone import Search, Standalone
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr
from taskcal.task.orientation import towards
from taskcal.task.task import Task
from taskcal.task.workspace import Orientation

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
    standing_words: ClassVar[tuple[str, ...]] = ("board", "camera", "landmark")
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
    good_m: ClassVar[float] = 1e-2
    images: tuple[str, ...] = ()
    """Names of the pictures that rows refer to."""
    boards: tuple[str, ...] = ()
    """Names of the boards; of none before the pictures are looked at."""
    u_scale: tuple[float, ...] = ()
    """Relative standard uncertainty of the size of each as it is stated; zero where that is taken for exact."""
    lens: Lens | None = None
    on_wrist: bool = True
    """Whether the camera moves, and the boards stand; else the one board moves."""
    given: StatedCamera | None = None
    """What is known of the camera beforehand; None for nothing, and of a calibration, whose covariance has it."""
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
        by_pose = np.zeros((n, 6, 6))
        by_pose[:, :3, :3] = -R
        by_pose[:, :3, 3:] = R @ np.swapaxes(np.cross(between[:, None], np.swapaxes(jacobian, 1, 2)), 1, 2)
        by_pose[:, 3:, 3:] = -by_turn @ R @ jacobian
        by_unknown[np.arange(n)[:, None], :, 6 * place[:, None] + np.arange(6)] = np.swapaxes(by_pose, 1, 2)
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
        """What the corners say of the camera, however the boards are placed; what is known of it; and how large the boards are."""
        own, scales = self._camera, np.array([self.u_scale[b] for b in self._scaled])
        by_unknown = np.eye(len(unknown))
        parts = [Stated(-unknown[own.stop :], by_unknown[own.stop :], scales)]
        if self.given is not None and self.given.uncertainty is not None:
            u = np.maximum(self.given.uncertainty, EXACT)
            parts.append(Stated(self.given.numbers - unknown[own], by_unknown[own], u))
        if self.pictures is not None and self.of is not None:
            used = np.unique(self.of[self.of >= 0])
            information, gradient = (part[used].sum(axis=0) for part in self.pictures.settle(unknown[own]).of_camera)
            root, back = _roots(information[None])
            by_camera = np.zeros((len(gradient), len(unknown)))
            by_camera[:, own] = root[0]
            parts.append(Stated(back[0] @ gradient, by_camera, np.ones(len(gradient))))
        return Stated(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def told_of_unknowns(self, unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, "n k u"]:
        """What the corners of each row's image say of the camera, wherever its board is."""
        own = self._camera
        out = np.zeros((len(self.numbers), own.stop - own.start, len(unknown)))
        if self.pictures is not None:
            out[:, :, own] = _roots(self.pictures.settle(unknown[own]).of_camera[0])[0][self.numbers]
        return out

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
        """Refuse: images are of a board and a camera that are stated (`take_shots`, `PixelInstrument`)."""
        raise CampaignError(
            "images are of a board: simulate them with --observe pixels --board BOARD.toml, and plan poses with --camera beside it"
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


def _roots(
    information: Float[np.ndarray, "n k k"],
) -> tuple[Float[np.ndarray, "n k k"], Float[np.ndarray, "n k k"]]:
    """Rows J with JᵀJ = S of each information, zero where it says nothing, and B with Bᵀ·J = 1 in what it says."""
    size = np.sqrt(np.maximum(np.diagonal(information, axis1=1, axis2=2), 1e-300))
    values, axes = np.linalg.eigh(information / size[:, :, None] / size[:, None, :])
    told = values > NO_INFORMATION * np.maximum(values.max(axis=1, keepdims=True), 1e-300)
    root = np.sqrt(np.where(told, values, 0.0))
    inverse = np.where(told, 1.0 / np.where(told, root, 1.0), 0.0)
    turned = np.swapaxes(axes, 1, 2)
    return root[:, :, None] * turned * size[:, None], inverse[:, :, None] * turned / size[:, None]


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


class Apart(NamedTuple):
    """How far what stands is from being in one place, as the nominal robot and the pictures have it."""

    turn: float
    """Median, radians."""
    place: Float[np.ndarray, "n 3"]
    """In the base, metres."""
    scale: float
    """Size of the robot's motion over that of the pictures."""
    scale_error: float
    """Standard error of it."""

    @classmethod
    def of(
        cls,
        T: Float[np.ndarray, "n 4 4"],
        M: Float[np.ndarray, "n 4 4"],
        fitted: slice | Bool[np.ndarray, " n"] = slice(None),
    ) -> "Apart":
        """Of poses of the tool and of what moves in the frame of what stands; the hand-eye from some of the rows."""
        R = hand_eye_rotation(T[fitted], M[fitted])
        L = T @ se3.pose(R, hand_eye_place(T[fitted], M[fitted], R)) @ se3.inverse(M)
        middle = se3.nearest_rotation(np.median(L[fitted, :3, :3], axis=0))
        turned = np.linalg.norm(se3.log(L[:, :3, :3] @ middle.T), axis=1)
        ahead = (M[:, :3, 3] @ middle.T)[:, :, None]
        rows = np.concatenate([T[:, :3, :3], np.tile(-np.eye(3), (len(T), 1, 1)), -ahead], axis=2).reshape(-1, 7)
        found, *_ = np.linalg.lstsq(rows, -T[:, :3, 3].reshape(-1), rcond=1e-9)
        off = rows @ found + T[:, :3, 3].reshape(-1)
        variance = float(off @ off) / max(len(off) - 7, 1) * float(np.linalg.pinv(rows.T @ rows)[6, 6])
        return cls(float(np.median(turned)), L[:, :3, 3], float(found[6]), float(np.sqrt(variance)))


# A camera and boards that are stated: postures in which enough of a board is in the picture, sharp and not too flat.

TILT = np.radians(60.0)
"""Largest angle between a board's normal and the line of sight by default. Of rendered boards (1200 × 900 pixels, half a
metre before the lens) all corners are found up to 65° on ChArUco and 60° on checkerboards, half of them at 75° and none at 70°."""

SHARE_SEEN = 0.6
"""Of the corners of a board with markers that are in the picture, by default; a board without is found as a whole."""

CORNER_NOISE_PX = 0.15
"""Standard deviation of a corner in each direction, by default: those of detected corners are 0.05 to 0.3 pixels."""

EDGE_PX = 8.0
"""From the edge of an image, within which corners are not found."""

FILLED = 0.25, 1.0
"""Shares of the image's width that a board fills in the farthest and the nearest view, where the focus is not stated."""

PLACE_M, PLACE_RAD = 0.01, np.radians(3.0)
"""Standard uncertainties of the stated places of camera and boards, and of their directions, by default: of a tape and by eye."""

SPINS = np.radians([45.0, 90.0, 135.0])
"""Turns of a board about its normal, which nobody states, with which it must be in the picture, too."""

CHUNK_CORNERS = 200_000
"""Corners that are projected at once: 60 MB."""

SHARP_M = 1e-6
"""By which a corner may be out of focus: rounding."""

FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
"""From a frame whose z axis points out of a board's face to one whose z axis points into the board."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PixelInstrument(Instrument):
    """A camera on the tool and boards that stand, or a board on the tool and a camera that stands.

    The frame in the middle of a board has its axes; a camera looks along z, with x to the right in the picture.
    """

    kind: ClassVar[type[Observation]] = Pixels
    shares: ClassVar[tuple[str, ...]] = ("board", "camera")
    settings: ClassVar[tuple[Setting, ...]] = (
        STANDING,
        Setting(
            "--cone-deg",
            "DEG",
            "of images between a board's normal and the line of sight (60)",
            ("tilt",),
            float(np.radians(1.0)),
            90.0,
        ),
        Setting(
            "--range-mm",
            "LOW,HIGH",
            "of images the depths at which it is in focus (as the camera's file states)",
            ("nearest", "farthest"),
            1e-3,
        ),
        Setting(
            "--in-view",
            "SHARE",
            "Share of a board's corners that must be in the image (0.6; without markers 1).",
            ("in_view",),
            1.0,
            1.0 + 1e-9,
        ),
        Setting("--noise-px", "PX", "Noise of a corner in each direction, 1σ (0.15).", ("noise_px",)),
        Setting(
            "--place-mm",
            "MM",
            "Standard uncertainty of stated places of boards and camera (10).",
            ("place_m",),
            1e-3,
        ),
        Setting(
            "--place-deg",
            "DEG",
            "Standard uncertainty of their stated directions (3).",
            ("place_rad",),
            float(np.radians(1.0)),
            30.0,
        ),
        Setting(
            "--roll-deg",
            "DEG",
            "Turn of the camera about its line of sight (0).",
            ("roll",),
            float(np.radians(1.0)),
            360.0,
        ),
    )
    board: tuple[Board, ...]
    """Those that stand, as the fixtures name them; or the one on the tool."""
    camera: StatedCamera
    on_wrist: bool = True
    """Whether the camera is on the tool."""
    nearest: float
    farthest: float
    """Depths of corners that are in focus, metres."""
    tilt: float = TILT
    """Largest angle between a board's normal and the line of sight, radians."""
    in_view: float
    """Share of a board's corners that must be in the picture."""
    noise_px: float = CORNER_NOISE_PX
    place_m: float = PLACE_M
    """Standard uncertainty of stated places per axis, metres."""
    place_rad: float = PLACE_RAD
    """Of stated directions, radians."""
    roll: float = 0.0
    """Turn of the camera about its line of sight, radians."""

    @classmethod
    def set_up(
        cls,
        model: ErrorModel,
        task: Task,
        T_tool_tip: Float[np.ndarray, "4 4"],
        fixtures: Fixtures | None = None,
        *,
        board: Path | tuple[Board, ...] = (),
        camera: Path | StatedCamera | None = None,
        **stated: Any,
    ) -> "Instrument":
        """The same; boards and camera, or their files, must be given.

        Raises:
            CampaignError: boards or camera are not given, or the fixtures name others.
        """
        boards = read_boards(board) if isinstance(board, Path) else board
        seen = read_camera(camera) if isinstance(camera, Path) else camera
        if not boards or seen is None:
            raise CampaignError("poses for images are planned for a board and a camera: give --board and --camera")
        on_wrist = fixtures is None or fixtures.names != ("camera",)
        if fixtures is not None and on_wrist:
            by_name = {one.name: one for one in boards}
            for name in fixtures.names:
                if name not in by_name:
                    raise CampaignError(
                        f"'{name}' stands, and is none of the boards {', '.join(by_name)}; name those, or camera for a camera that "
                        "stands and sees the board on the tool"
                    )
            boards = tuple(by_name[name] for name in fixtures.names)
        elif not on_wrist and len(boards) > 1:
            raise CampaignError(
                f"a plan is for one board on the tool, and the file has {len(boards)}; leave the others out"
            )
        long = max(float(np.ptp(one.corners(), axis=0).max()) for one in boards)
        across = float(seen.numbers[0]) * KILO / seen.lens.width * long
        low, high = seen.focus or (across / FILLED[1], across / FILLED[0])
        whole = any(not one.markers for one in boards)
        stated = {"nearest": low, "farthest": high, "in_view": 1.0 if whole else SHARE_SEEN, **stated}
        return super().set_up(model, task, T_tool_tip, fixtures, board=boards, camera=seen, on_wrist=on_wrist, **stated)

    @classmethod
    def arrange(
        cls, p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], reach: float, stated: Mapping[str, Any]
    ) -> Fixtures:
        """Boards before the tool, as far from one another as the task has room, all facing it."""
        names = tuple(board.name for board in stated["board"])
        position = far_apart(p, len(names)) if len(names) > 1 else p.mean(axis=0)[None]
        position = on_the_floor(position + 0.5 * (stated["nearest"] + stated["farthest"]) * pointing)
        return Fixtures(names=names, position=position, direction=np.tile(-pointing, (len(names), 1)))

    @property
    def label(self) -> str:
        """What stands."""
        return "board" if self.on_wrist else "camera"

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        return (
            "take an image in each pose, in the order of the rows, and name them so that they sort in it; identify then reads the "
            "plan's file with --images FOLDER --board BOARD.toml"
        )

    @property
    def _rolled(self) -> Float[np.ndarray, "4 4"]:
        return se3.pose(se3.exp(np.array([0.0, 0.0, self.roll])), np.zeros(3))

    def _centre(self, board: int) -> Float[np.ndarray, "4 4"]:
        """The middle of a board's corners in its frame."""
        return se3.translation(*self.board[board].corners().mean(axis=0))

    @property
    def _moving(self) -> Float[np.ndarray, "4 4"]:
        """The camera, or the middle of the board, in the tool frame."""
        return self.T_tool_tip @ (self._rolled if self.on_wrist else FLIP)

    @property
    def _standing(self) -> Float[np.ndarray, "fixtures 4 4"]:
        """The middle of each board, or the camera, in the base."""
        z = -self.fixtures.direction if self.on_wrist else self.fixtures.direction
        T = se3.pose(np.stack([towards(one) for one in z]), self.fixtures.position)
        return T if self.on_wrist else T @ self._rolled

    @property
    def T_tool_targets(self) -> Float[np.ndarray, "targets 4 4"]:
        """The camera, or the board, in the tool frame."""
        return (self._moving if self.on_wrist else self._moving @ se3.inverse(self._centre(0)))[None]

    @property
    def unknown(self) -> Float[np.ndarray, " u"]:
        """Boards or camera where they stand, the camera's numbers, and boards of the stated size."""
        T = self._standing
        if self.on_wrist:
            T = T @ se3.inverse(np.stack([self._centre(k) for k in range(len(self.board))]))
        poses = np.concatenate([T[:, :3, 3], se3.log(T[:, :3, :3])], axis=1).reshape(-1)
        return np.concatenate([poses, self.camera.numbers, np.zeros(sum(one.u_scale > 0.0 for one in self.board))])

    def _relative(self, moving: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 4 4"]:
        """The middle of the board in the camera's frame, by the pose of what moves, camera or middle of the board."""
        standing = self._standing[of]
        return se3.inverse(moving) @ standing if self.on_wrist else se3.inverse(standing) @ moving

    def goals(
        self, model: ErrorModel, task: Task, fixture: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The middle of the board anywhere in the picture and in focus, tilted to all sides and turned at will."""
        lens, (fx, fy, cx, cy) = self.camera.lens, self.camera.numbers[:4] * KILO
        depth = self.nearest + (self.farthest - self.nearest) * u[:, 5]
        x, y = (u[:, 3] * lens.width - cx) / fx, (u[:, 4] * lens.height - cy) / fy
        ray = np.stack([x, y, np.ones(len(u))], axis=1)
        aim = np.stack([towards(one) for one in ray])
        turned = Orientation(rotation=np.eye(3), cone=self.tilt, spin=np.pi).sample(u[:, :3])
        T = se3.pose(aim @ turned, depth[:, None] * ray)
        standing = self._standing[fixture]
        moving = standing @ se3.inverse(T) if self.on_wrist else standing @ T
        return moving @ se3.inverse(self._moving)

    def _seen(
        self, T: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> tuple[Bool[np.ndarray, "n m"], Float[np.ndarray, "n m 2"]]:
        """Which corners are in the picture and in focus, and where; none beyond a board's own number."""
        boards = [board.corners() - board.corners().mean(axis=0) for board in self.board]
        most = max(map(len, boards))
        seen, pixel = np.zeros((len(T), most), dtype=bool), np.full((len(T), most, 2), np.nan)
        numbers = self.camera.numbers * np.repeat([KILO, 1.0], [4, len(self.camera.numbers) - 4])
        size = np.array([self.camera.lens.width, self.camera.lens.height])
        which = of if self.on_wrist else np.zeros_like(of)
        for number, corners in enumerate(boards):
            own, m = np.flatnonzero(which == number), len(corners)
            for part in np.array_split(own, len(own) * m // CHUNK_CORNERS + 1):
                each = np.repeat(T[part], m, axis=0)
                at = np.tile(corners, (len(part), 1))
                found, _ = project(LENSES[self.camera.lens.model], numbers, each[:, :3, :3], each[:, :3, 3], at)
                depth = (each[:, 2, :3] * at).sum(axis=1) + each[:, 2, 3]
                with np.errstate(invalid="ignore"):
                    inside = ((found > EDGE_PX) & (found < size - EDGE_PX)).all(axis=1)
                inside &= (depth >= self.nearest - SHARP_M) & (depth <= self.farthest + SHARP_M)
                pixel[part, :m], seen[part, :m] = found.reshape(-1, m, 2), inside.reshape(-1, m)
        return seen, pixel

    def _enough(self, T: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        counts = np.array([len(board.corners()) for board in self.board])[of if self.on_wrist else 0 * of]
        fewest = np.maximum(np.ceil(self.in_view * counts - 1e-9), FEWEST_CORNERS)
        return self._seen(T, of)[0].sum(axis=1) >= fewest

    def _flat(self, T: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, " n"]:
        """Angle between the board's normal and the line of sight, radians."""
        cosine = (T[:, :3, 3] * T[:, :3, 2]).sum(axis=1) / np.linalg.norm(T[:, :3, 3], axis=1)
        return np.arccos(np.clip(cosine, -1.0, 1.0))

    def _elsewhere(self, T: Float[np.ndarray, "n 4 4"]) -> Iterable[Float[np.ndarray, "n 4 4"]]:
        """The board before the camera where both are two standard uncertainties off, and turned about its normal."""
        for spin in SPINS:
            yield T @ se3.pose(se3.exp(np.array([0.0, 0.0, spin])), np.zeros(3))
        for axis in np.concatenate([np.eye(3), -np.eye(3)]):
            yield se3.translation(*2.0 * self.place_m * axis) @ T
            yield se3.pose(se3.exp(2.0 * self.place_rad * axis), np.zeros(3)) @ T

    def faults(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"], links: Links
    ) -> Mapping[str, Bool[np.ndarray, " n"]]:
        """Too few corners in the picture and in focus, there or where camera and board may be; too flat; hidden by the robot."""
        T = self._relative(model.poses(q) @ self._moving, of)
        enough = self._enough(T, of)
        surely = enough.copy()
        for moved in self._elsewhere(T):
            surely[surely] = self._enough(moved[surely], of[surely])
        return {
            "too few corners in the image and in focus": ~enough,
            "too few corners where camera and board may be": ~surely,
            "the board too flat": self._flat(T) > self.tilt + 1e-9,
            "the board hidden by the robot": ~self.sight_is_free(self.tip(model, q), of, links),
        }

    def views(
        self, model: ErrorModel, q: Float[np.ndarray, "n joints"], of: Int[np.ndarray, " n"]
    ) -> Mapping[str, Float[np.ndarray, " n"]]:
        """Corners in the image, distance of the board's middle, and its tilt."""
        T = self._relative(model.poses(q) @ self._moving, of)
        return {
            "corners": self._seen(T, of)[0].sum(axis=1).astype(float),
            "distance_mm": np.linalg.norm(T[:, :3, 3], axis=1) * 1e3,
            "tilt_deg": np.degrees(self._flat(T)),
        }

    def observation(self, of: Int[np.ndarray, " n"], target: Float[np.ndarray, "n 4 4"] | None = None) -> Pixels:
        """What the camera would see of the board of each row, corners with their noise."""
        kind = Pixels(
            boards=tuple(board.name for board in self.board),
            u_scale=tuple(board.u_scale for board in self.board),
            lens=self.camera.lens,
            on_wrist=self.on_wrist,
            given=self.camera,
            of=np.zeros(0, dtype=int),
        )
        if target is None:
            return kind
        which = of if self.on_wrist else np.zeros_like(of)
        moving = target if self.on_wrist else target @ self._centre(0)
        seen, pixel = self._seen(self._relative(moving, of), of)
        seen[seen.sum(axis=1) < FEWEST_CORNERS] = False
        rows = np.flatnonzero(seen.any(axis=1))
        there = np.full(len(of), -1)
        there[rows] = np.arange(len(rows))
        names, (row, corner) = tuple(map(str, rows)), np.nonzero(seen)
        places = np.concatenate([board.corners() for board in self.board])
        first = np.concatenate([[0], np.cumsum([len(board.corners()) for board in self.board])])
        T = (
            self._relative(moving, of)[rows]
            @ se3.inverse(np.stack([self._centre(k) for k in range(len(self.board))]))[which[rows]]
        )
        pictures = Pictures(
            lens=self.camera.lens,
            names=names,
            board=which[rows],
            first=np.concatenate([[0], np.cumsum(seen[rows].sum(axis=1))]),
            corner=places[first[which[row]] + corner],
            pixel=pixel[row, corner],
            weight=np.full(len(row), self.noise_px**-2.0),
            camera=self.camera.numbers,
            T_camera_board=T,
            noise=self.noise_px,
        )
        return replace(kind, of=there, images=names, pictures=pictures)

    def rotations(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n 3 3"] | None:
        """Of what moves in the frame of what stands."""
        poses = self.unknown[: 6 * self.count].reshape(-1, 6)
        return np.swapaxes(se3.exp(poses[:, 3:]), 1, 2)[of] @ tip[:, :3, :3]

    def columns(self, of: Int[np.ndarray, " n"]) -> dict[str, list[str]]:
        """The board that each image is to show, where there are several."""
        return {"board": [self.fixtures.names[k] for k in of]} if self.count > 1 else {}
