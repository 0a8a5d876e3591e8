"""Pixels: corners of boards in pictures of cameras, on the wrist or beside the robot.

A row is a posture, with a picture of each board in the image of each camera. What moves, a camera or a board, is the target; what
stands is fixed in the robot's base. Of cameras θ, a picture has the pose M(θ) of what moves in the frame of what stands, with the
covariance that its corners leave it; those of one posture are put together (`views`). What the corners say of θ beside these poses
is stated of it (`camera`).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.geometry.point_registration import orientations
from taskcal.io.codec import NOT_IN_FILE
from taskcal.kernels.projection import POSE, project
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
from taskcal.observations.camera import DISTORTION, EXACT, FEWEST_CORNERS, KILO, LENSES, Lens, Pictures
from taskcal.observations.camera_file import StatedCamera, read_camera
from taskcal.observations.instrument import NO_FIXTURES, Fixtures, Instrument, LookedFor, far_apart, on_the_floor
from taskcal.observations.landmark import Standing
from taskcal.observations.pose import turn_by_rotation
from taskcal.observations.standalone import Search, Standalone
from taskcal.observations.views import Posed, Views, apart, join_views
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.parameter import ShownUnit
from taskcal.short_repr import short_repr
from taskcal.task.orientation import towards
from taskcal.task.task import Task
from taskcal.task.workspace import Orientation
from taskcal_groundwork.options import Option
from taskcal_groundwork.said import Said

FEWEST = 3
"""Pictures, to find camera and board without a guess."""

COMPONENTS = ("tx", "ty", "tz", "rx", "ry", "rz")

CLEAR_TURN_RAD = np.radians(170.0)
"""Turn under which a rotation vector does not change its sign by errors."""

NO_INFORMATION = 1e-12
"""Eigenvalues of what the corners say of a camera, over the largest, under which they say nothing."""


class Sightings(NamedTuple):
    """What each picture is of."""

    view: Int[np.ndarray, " n"]
    """Number of its posture."""
    camera: Int[np.ndarray, " n"]
    board: Int[np.ndarray, " n"]
    moving: Int[np.ndarray, " n"]
    """Which camera or board on the wrist."""
    standing: Int[np.ndarray, " n"]
    """Which one of those that stand."""
    of_camera: Bool[np.ndarray, " n"]
    """Whether it is the camera that moves."""
    first: Int[np.ndarray, " views"]
    """Of each posture, the picture with most corners."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Pixels(Standalone):
    """M(θ) = L⁻¹·X: what moves, X, in the frame L of what stands, as pictures have it whose cameras and boards are θ.

    Cameras and boards are on the wrist or stand. Of what is on the wrist the first is the target, and the others have a place in
    its frame; what stands has one in the base.
    """

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
    images: Annotated[tuple[str, ...], NOT_IN_FILE] = ()
    """Names of the images, one for each posture, that rows refer to."""
    boards: tuple[str, ...] = ()
    """Names of the boards; of none before the pictures are looked at."""
    u_scale: tuple[float, ...] = ()
    """Relative standard uncertainty of the size of each as it is stated; zero where that is taken for exact."""
    cameras: tuple[str, ...] = ("camera",)
    """Names of the cameras, ``camera`` of the only one."""
    lenses: tuple[Lens, ...] = ()
    """Of the cameras; of none before the pictures are looked at."""
    moving: tuple[str, ...] = ("camera",)
    """Cameras and boards on the wrist, as `bodies` has them, the target first; all others stand."""
    given: Annotated[tuple[StatedCamera | None, ...], NOT_IN_FILE] = (None,)
    """What is known of each camera beforehand; None for nothing, and of a calibration, whose covariance has it."""
    pictures: Annotated[tuple[Pictures, ...] | None, NOT_IN_FILE] = None
    """What the images of each camera show; None of a calibration, whose own rows are not kept."""
    start: Annotated[Float[np.ndarray, " u"] | None, NOT_IN_FILE] = None
    """The unknowns as the nominal robot has them, by which pictures of one posture are weighed; None of a calibration."""

    @property
    def bodies(self) -> tuple[str, ...]:
        """Boards and cameras."""
        return (*(f"board {name}" for name in self.boards), *self.cameras)

    @property
    def standing(self) -> tuple[str, ...]:
        """Names of what stands."""
        return tuple(name for name in self.bodies if name not in self.moving)

    @property
    def on_wrist(self) -> tuple[bool, ...]:
        """Whether each camera is on the wrist."""
        return tuple(name in self.moving for name in self.cameras)

    @property
    def target(self) -> str:
        """Name of what is on the wrist: a camera or a board, or the first of them."""
        first, *others = self.moving
        return first if others else first.partition(" ")[0]

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Places of what stands, the cameras, the scales of the boards whose size is not exact, and places of more on the wrist."""
        poses = (f"{name}.{c}" for name in self.standing for c in COMPONENTS)
        numbers = (
            f"{name}.{number}"
            for name, lens in zip(self.cameras, self.lenses, strict=False)
            for number in lens.unknowns
        )
        scales = (f"board {self.boards[b]}.scale" for b in self._scaled)
        return (*poses, *numbers, *scales, *(f"{name}.{c}" for name in self.moving[1:] for c in COMPONENTS))

    @property
    def _scaled(self) -> list[int]:
        return [b for b, u in enumerate(self.u_scale) if u > 0.0]

    @property
    def _own(self) -> tuple[slice, ...]:
        """Of each camera among the unknowns."""
        ends = 6 * len(self.standing) + np.cumsum([0, *(len(lens.unknowns) for lens in self.lenses)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def _scale_columns(self) -> slice:
        first = 6 * len(self.standing) + sum(len(lens.unknowns) for lens in self.lenses)
        return slice(first, first + len(self._scaled))

    @property
    def deviations(self) -> Float[np.ndarray, " u"]:
        """As good as unknown; of the scales `stated` says more."""
        out = np.ones(len(self.unknowns))
        for own, lens in zip(self._own, self.lenses, strict=True):
            out[own] = lens.deviations
        return out

    def _scales(self, unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, " boards"]:
        out = np.ones(max(len(self.boards), 1))
        out[self._scaled] += unknown[self._scale_columns]
        return out

    @property
    def _looked_at(self) -> tuple[Pictures, ...]:
        if self.pictures is None:
            raise CampaignError(
                "these rows name images that were not looked at; give --images FOLDER and --board BOARD.toml"
            )
        return self.pictures

    def _posed(self, name: str, unknown: Float[np.ndarray, " u"]) -> Posed:
        """Place of a camera or a board: in the base if it stands, else in the frame of the target, which is at its own origin."""
        if name == self.moving[0]:
            return Posed(np.eye(4)[None], np.zeros((1, 6, len(unknown))))
        others = self.moving[1:]
        first = 6 * (self.standing.index(name) if name in self.standing else others.index(name) - len(others))
        first %= len(unknown)
        return Posed.of_numbers(unknown[None, first : first + 6], np.array([first]), len(unknown))

    def place_on_robot(
        self, name: str, target: Posed, unknown: Float[np.ndarray, " u"], own: Int[np.ndarray, " u"]
    ) -> Posed:
        """Place of a camera or a board: in the base if it stands, else in the tool frame; and its derivatives by an estimate.

        Args:
            name: one of `bodies`.
            target: its place in the tool frame, and the derivatives.
            unknown: the unknowns.
            own: their places in the estimate.
        """
        at = self._posed(name, unknown)
        by = np.zeros((1, 6, target.by.shape[2]))
        by[:, :, own] = at.by
        return Posed(at.T, by) if name in self.standing else target.then(Posed(at.T, by))

    def _places(self, names: Sequence[str], of: Int[np.ndarray, " n"], unknown: Float[np.ndarray, " u"]) -> Posed:
        """Places of cameras and boards, by the number of each among some names."""
        each = [self._posed(name, unknown) for name in names]
        return Posed(np.concatenate([one.T for one in each]), np.concatenate([one.by for one in each])).take(of)

    @cached_property
    def sightings(self) -> Sightings:
        """Which posture, camera and board each picture is of, those of one camera after another."""
        pictures = self._looked_at
        camera = np.repeat(np.arange(len(pictures)), [len(one) for one in pictures])
        view, board = (
            np.concatenate([getattr(one, name) for one in pictures]).astype(int) for name in ("view", "board")
        )
        of_camera = np.array([name in self.moving for name in self.cameras])[camera]
        names = np.array(self.bodies, dtype=object)
        seen, seeing = names[board], names[len(self.boards) + camera]
        moving = np.array([self.moving.index(name) for name in np.where(of_camera, seeing, seen)], dtype=int)
        standing = np.array([self.standing.index(name) for name in np.where(of_camera, seen, seeing)], dtype=int)
        corners = np.concatenate([np.diff(one.first) for one in pictures])
        order = np.lexsort((-corners, view))
        first = order[np.searchsorted(view[order], np.arange(len(self.images)))] if len(order) else order
        return Sightings(view, camera, board, moving, standing, of_camera, first)

    def seen(self, unknown: Float[np.ndarray, " u"], noise: bool = False) -> Posed:
        """What moves in the frame of what stands as each picture has it, and its derivatives by the unknowns.

        Args:
            unknown: the unknowns.
            noise: with the derivatives by a move and a turn of the board in the camera's frame before them.
        """
        parts: list[Posed] = []
        scales, before = self._scales(unknown), 6 * noise
        for pictures, own, on_wrist in zip(self._looked_at, self._own, self.on_wrist, strict=True):
            settled = pictures.settle(unknown[own])
            T, by = settled.T_camera_board.copy(), np.zeros((len(pictures), 6, before + len(unknown)))
            by[:, :, :before] = np.eye(6)[:, :before]
            by[:, :, before + own.start : before + own.stop] = settled.by_camera
            for column, b in enumerate(self._scaled, start=before + self._scale_columns.start):
                by[:, :3, column] = (pictures.board == b)[:, None] * T[:, :3, 3] / scales[b]
            scale = scales[pictures.board, None]
            T[:, :3, 3] *= scale
            by[:, :3] *= scale[:, None]
            parts.append(Posed(T, by).inverse if on_wrist else Posed(T, by))
        return Posed(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def views(self, unknown: Float[np.ndarray, " u"]) -> Views:
        """What the pictures of each posture say together of what moves, in the frame of what stands."""
        of, u = self.sightings, len(unknown)
        M, place = self.seen(unknown, noise=True), of.standing[of.first]

        def beside(posed: Posed) -> Posed:
            return Posed(posed.T, np.concatenate([np.zeros((len(posed.T), 6, 6)), posed.by], axis=2))

        others = np.flatnonzero(of.moving > 0)
        if len(others):
            carried = M.take(others).then(beside(self._places(self.moving, of.moving[others], unknown)).inverse)
            M.T[others], M.by[others] = carried
        others = np.flatnonzero(of.standing != place[of.view])
        if len(others):
            at, to = (
                beside(self._places(self.standing, own[others], unknown)) for own in (place[of.view], of.standing)
            )
            M.T[others], M.by[others] = at.inverse.then(to).then(M.take(others))
        corners = [pictures.settle(unknown[own]) for pictures, own in zip(self._looked_at, self._own, strict=True)]
        back = np.linalg.inv(M.by[:, :, :6])
        information = np.concatenate([one.information[:, :POSE, :POSE] for one in corners])
        return join_views(
            Posed(M.T, M.by[:, :, 6 : 6 + u]),
            np.swapaxes(back, 1, 2) @ information @ back,
            of.view,
            of.first,
            place,
        )

    def differentiate(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"], measured: Measured
    ) -> Differential:
        """Residual and derivatives, in the axes of what stands."""
        assert measured.rotations is not None
        n, u = len(target), len(unknown)
        M, by_own, place = se3.pose(measured.rotations, measured.points), np.zeros((n, 6, u)), np.zeros(n, dtype=int)
        if self.pictures is not None and self.of is not None:
            views, rows = self.views(unknown), np.flatnonzero(self.of >= 0)
            k = self.of[rows]
            M[rows], by_own[rows], place[rows] = views.moving.T[k], views.moving.by[k], views.place[k]
        by_twist = np.concatenate([np.tile(np.eye(6), (n, 1, 1)), np.zeros((n, 6, u))], axis=2)
        at = self._places(self.standing, place, unknown)
        there = Posed(at.T, np.concatenate([np.zeros((n, 6, 6)), at.by], axis=2)).inverse.then(Posed(target, by_twist))
        residual, seen = np.zeros((n, 6)), measured.valid
        residual[:, :3] = M[:, :3, 3] - there.T[:, :3, 3]
        residual[seen] = apart(M[seen], there.T[seen])
        by_turn = turn_by_rotation(residual[:, 3:])
        by = there.by.copy()
        by[:, 3:] = by_turn @ by[:, 3:]
        by[:, :3, 6:] -= by_own[:, :3]
        by[:, 3:, 6:] -= np.swapaxes(by_turn, 1, 2) @ by_own[:, 3:]
        return Differential(residual, by[:, :, :6], by[:, :, 6:])

    def covariance(
        self, measured: Measured, uncertainty: Float[np.ndarray, " n"] | None, tracker: TrackerNoise
    ) -> Float[np.ndarray, "n w w"]:
        """Covariance of each row by the noise of its corners."""
        assert self._looked_at
        assert self.start is not None
        return self.views(self.start).covariance[self.numbers]

    def stated(self, unknown: Float[np.ndarray, " u"]) -> Stated:
        """What the corners say beside the poses, of cameras and of all among each other; what is known; and the boards' sizes."""
        scales, own = np.array([self.u_scale[b] for b in self._scaled]), self._scale_columns
        by_unknown = np.eye(len(unknown))
        parts = [Stated(-unknown[own], by_unknown[own], scales)]
        for given, own in zip(self.given, self._own, strict=False):
            if given is not None and given.uncertainty is not None:
                u = np.maximum(given.uncertainty, EXACT)
                parts.append(Stated(given.numbers - unknown[own], by_unknown[own], u))
        if self.pictures is not None and self.of is not None:
            used = np.unique(self.of[self.of >= 0])
            for pictures, own in zip(self.pictures, self._own, strict=True):
                there = np.isin(pictures.view, used)
                information, gradient = (part[there].sum(axis=0) for part in pictures.settle(unknown[own]).of_camera)
                root, back = _roots(information[None])
                by_camera = np.zeros((len(gradient), len(unknown)))
                by_camera[:, own] = root[0]
                parts.append(Stated(back[0] @ gradient, by_camera, np.ones(len(gradient))))
            views = self.views(unknown)
            there = np.isin(views.of, used)
            off = views.residual[there].reshape(-1)
            by_off = -views.by_unknown[there].reshape(len(off), len(unknown))
            parts.append(Stated(off, by_off, np.ones(len(off))))
        return Stated(*(np.concatenate(part) for part in zip(*parts, strict=True)))

    def count_numbers(self, valid: Bool[np.ndarray, " n"]) -> int:
        """Of each picture the pose; what its corners say beside tells of the camera."""
        if self.pictures is None or self.of is None:
            return super().count_numbers(valid)
        return self.width * int(np.isin(self.sightings.view, self.of[valid & (self.of >= 0)]).sum())

    def told_of_unknowns(self, unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, "n k u"]:
        """What the corners of each row's images say of cameras, and of boards and cameras among each other, wherever all are."""
        if self.pictures is None:
            return np.zeros((len(self.numbers), 0, len(unknown)))
        parts: list[np.ndarray] = []
        for pictures, own in zip(self.pictures, self._own, strict=True):
            information = np.zeros((len(self.images), own.stop - own.start, own.stop - own.start))
            np.add.at(information, pictures.view, pictures.settle(unknown[own]).of_camera[0])
            parts.append(np.zeros((*information.shape[:2], len(unknown))))
            parts[-1][:, :, own] = _roots(information)[0]
        views = self.views(unknown)
        order = np.argsort(views.of, kind="stable")
        rank = np.arange(len(order)) - np.searchsorted(views.of[order], views.of[order])
        for k in range(rank.max(initial=-1) + 1):
            own = order[rank == k]
            parts.append(np.zeros((len(self.images), 6, len(unknown))))
            parts[-1][views.of[own]] = views.by_unknown[own]
        return np.concatenate(parts, axis=1)[self.numbers]

    def reproject(
        self, target: Float[np.ndarray, "n 4 4"], unknown: Float[np.ndarray, " u"]
    ) -> tuple[Float[np.ndarray, "c 2"], ...] | None:
        """Pixels of all corners of each camera less those predicted for the target where the robot has it."""
        if self.pictures is None or self.of is None:
            return None
        rows, of = np.zeros(len(self.images), dtype=int), self.sightings
        rows[self.of[self.of >= 0]] = np.flatnonzero(self.of >= 0)
        standing, carried = (
            self._places(names, own, unknown).T
            for names, own in ((self.standing, of.standing), (self.moving, of.moving))
        )
        T = se3.inverse(standing) @ target[rows[of.view]] @ carried
        T[of.of_camera] = se3.inverse(T[of.of_camera])
        # corners are at their stated places, so that a larger board is seen as one that is nearer
        T[:, :3, 3] /= self._scales(unknown)[of.board, None]
        return tuple(
            pictures.pixel - pictures.predicted(T[of.camera == k], unknown[own])
            for k, (pictures, own) in enumerate(zip(self.pictures, self._own, strict=True))
        )

    def two_steps(self, tool: Float[np.ndarray, "n 4 4"]) -> tuple[Float[np.ndarray, "4 4"], Float[np.ndarray, " u"]]:
        """The usual way: cameras from the pictures alone, then hand and eye from their poses and those of the nominal tool.

        Args:
            tool: its nominal poses at all rows.

        Returns:
            pose of what moves in the tool frame, and the unknowns.
        """
        assert self.of is not None
        rows = np.flatnonzero(self.of >= 0)
        here = replace(self, of=self.of[rows])
        T, M = here._most_seen(tool[rows])
        R = hand_eye_rotation(T, M)
        X, unknown = se3.pose(R, hand_eye_place(T, M, R)), np.full(len(self.unknowns), np.nan)
        return X, here.settle(tool[rows] @ X, here.blank(len(rows)), unknown)

    def on_robot(self, tool: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, " u"]:
        """The unknowns by poses of the tool: two steps where there are rows for it, else with the target at the tool."""
        assert self.of is not None
        if (self._rows >= 0).sum() >= FEWEST:
            return np.nan_to_num(self.two_steps(tool)[1])
        return np.nan_to_num(self.settle(tool, self.blank(len(tool)), np.full(len(self.unknowns), np.nan)))

    def _most_seen(self, tool: Float[np.ndarray, "n 4 4"]) -> tuple[np.ndarray, np.ndarray]:
        """Poses of the tool, and M as pictures alone have it, of the target and what it is seen with most."""
        of = self.sightings
        row, there = self._rows, self.sightings.moving == 0
        there &= row >= 0
        own = np.flatnonzero(there & (of.standing == np.bincount(of.standing[there]).argmax()))
        return tool[row[own]], self.seen(self._alone).T[own]

    @property
    def _alone(self) -> Float[np.ndarray, " u"]:
        """The cameras as their pictures alone have them, and all others unknown."""
        out = np.zeros(len(self.unknowns))
        for pictures, own in zip(self._looked_at, self._own, strict=True):
            out[own] = pictures.camera
        return out

    @property
    def _rows(self) -> Int[np.ndarray, " pictures"]:
        """Row of each picture; −1 where none refers to its posture."""
        assert self.of is not None
        rows = np.full(len(self.images), -1)
        rows[self.of[self.of >= 0]] = np.flatnonzero(self.of >= 0)
        return rows[self.sightings.view]

    def check(self, rows: Search) -> None:
        """Raise a `CampaignError` where the pictures are too few to find camera and board."""
        if len(rows.tool) < FEWEST:
            raise CampaignError(
                f"{len(rows.tool)} pictures with a board do not tell where camera and board are; take {FEWEST} or more, better 20"
            )

    def starts(self, rows: Search) -> Iterable[Float[np.ndarray, " x"]]:
        """The hand-eye of linear equations, and many orientations, with the places that fit best beside them."""
        here = replace(self, of=rows.kind.of)
        T, M = here._most_seen(rows.tool)
        for R in (hand_eye_rotation(T, M), *orientations()):
            yield rows.about(se3.pose(R, hand_eye_place(T, M, R)))

    def settle(
        self, target: Float[np.ndarray, "n 4 4"], measured: Measured, known: Float[np.ndarray, " u"]
    ) -> Float[np.ndarray, " u"]:
        """Each thing that stands in the middle of what its rows say; cameras as they are known, or as their pictures have them."""
        assert measured.rotations is not None
        out, poses = known.copy(), 6 * len(self.standing)
        out[self._scale_columns] = np.nan_to_num(out[self._scale_columns])
        out[:poses] = np.nan
        if self.pictures is None or self.of is None:
            seen = measured.valid
            M = se3.pose(measured.rotations, measured.points)
            out[:6] = _middle(target[seen] @ se3.inverse(M[seen]))
            return out
        for pictures, own in zip(self.pictures, self._own, strict=True):
            out[own] = np.where(np.isnan(out[own]), pictures.camera, out[own])
        row = self._rows
        sound = measured.valid & np.isfinite(target).all(axis=(1, 2))
        self._spread(out, target[row], self.seen(np.nan_to_num(out)).T, (row >= 0) & sound[row])
        return out

    def _spread(
        self,
        out: Float[np.ndarray, " u"],
        target: Float[np.ndarray, "pictures 4 4"],
        M: Float[np.ndarray, "pictures 4 4"],
        usable: Bool[np.ndarray, " pictures"],
    ) -> None:
        """Fill in where cameras and boards are, from one to the next; M is what moves, as seen from what stands."""
        of, others = self.sightings, self.moving[1:]
        first = len(out) - 6 * len(others)
        carried: dict[int, np.ndarray] = {0: np.eye(4)}
        for k in range(len(others)):
            own = out[first + 6 * k : first + 6 * k + 6]
            if np.isfinite(own).all():
                carried[k + 1] = se3.pose(se3.exp(own[3:]), own[:3])
        standing: dict[int, np.ndarray] = {}
        while True:
            places = [
                (s, m, np.flatnonzero(usable & (of.standing == s) & (of.moving == m)))
                for s, m in dict.fromkeys(zip(of.standing[usable].tolist(), of.moving[usable].tolist(), strict=True))
            ]
            ready = [(s, m, own) for s, m, own in places if (s in standing) != (m in carried)]
            if ready:  # that with most pictures first: it is the surest
                s, m, own = max(ready, key=lambda one: len(one[2]))
                if s in standing:
                    x = _middle(se3.inverse(target[own]) @ standing[s] @ M[own])
                    out[first + 6 * m - 6 : first + 6 * m] = x
                    carried[m] = se3.pose(se3.exp(x[3:]), x[:3])
                else:
                    x = _middle(target[own] @ carried[m] @ se3.inverse(M[own]))
                    out[6 * s : 6 * s + 6] = x
                    standing[s] = se3.pose(se3.exp(x[3:]), x[:3])
                continue
            left = [(m, own) for s, m, own in places if s not in standing]
            if not left:
                return
            m, own = max(left, key=lambda one: len(one[1]))  # no picture leads there: by the robot
            R = hand_eye_rotation(target[own], M[own])
            carried[m] = se3.pose(R, hand_eye_place(target[own], M[own], R))
            out[first + 6 * m - 6 : first + 6 * m] = [*carried[m][:3, 3], *se3.log(R)]

    def take(self, rows: Int[np.ndarray, " k"]) -> "Pixels":
        """The observation of some rows, with their images."""
        if self.of is None:
            return self
        numbers, of = np.unique(self.of[rows][self.of[rows] >= 0], return_inverse=True)
        there = np.full(len(rows), -1)
        there[self.of[rows] >= 0] = of
        pictures = None if self.pictures is None else tuple(one.of_views(numbers) for one in self.pictures)
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

    def named_like(self, other: Observation, unknown: Float[np.ndarray, " u"]) -> Float[np.ndarray, " v"]:
        """Another one's unknowns in the order of these, NaN for those it does not have.

        Raises:
            CampaignError: a camera has another lens or size there, or what is on the wrist stands there.
        """
        assert isinstance(other, Pixels)
        lenses = dict(zip(other.cameras, other.lenses, strict=False))
        for name, lens in zip(self.cameras, self.lenses, strict=False):
            if lenses.get(name, lens) != lens:
                here, there = (f"{one.width} × {one.height} pixels ({one.model})" for one in (lens, lenses[name]))
                raise CampaignError(
                    f"{name} has images of {here}, and was calibrated with {there}: its numbers are of that size and lens"
                )
        for name in self.bodies:
            if name in other.bodies and (name in self.moving) != (name in other.moving):
                here, there = ("is on the wrist" if name in one.moving else "stands" for one in (self, other))
                raise CampaignError(
                    f"{name} {here} in these images, and {there} in the calibration: check the names of folders and boards"
                )
        return super().named_like(other, unknown)


def images_of(kinds: Sequence[Observation]) -> tuple[int, Pixels] | None:
    """Number of the target that images show, or from which they were taken, and what they show; None without images."""
    return next(((t, one) for t, one in enumerate(kinds) if isinstance(one, Pixels)), None)


def pictures_of(kinds: Sequence[Observation]) -> Pixels | None:
    """What images show that were looked at; None without such."""
    found = images_of(kinds)
    return None if found is None or found[1].pictures is None else found[1]


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
    board: tuple[Board, ...]
    """Those that stand, as the fixtures name them; or the one on the tool."""
    camera: StatedCamera
    on_wrist: bool = True
    """Whether the camera is on the tool."""
    fixtures: Standing = NO_FIXTURES
    tilt: Annotated[
        float,
        Option(
            metavar="DEG",
            help="of images between a board's normal and the line of sight (60)",
            named="cone",
            unit="deg",
            low=0.0,
            high=90.0,
            ends=False,
        ),
    ] = TILT
    """Radians."""
    depths: Annotated[
        tuple[float, float],
        Option(
            metavar="LOW,HIGH",
            help="of images the depths at which it is in focus (as the camera's file states)",
            named="range",
            unit="mm",
            low=0.0,
            high=1e6,
            rising=True,
        ),
    ]
    """Of corners, metres."""
    in_view: Annotated[
        float,
        Option(
            metavar="SHARE",
            help="Share of a board's corners that must be in the image (0.6; without markers 1).",
            low=1e-6,
            high=1.0,
        ),
    ]
    noise_px: Annotated[
        float, Option(metavar="PX", help="Noise of a corner in each direction, 1σ (0.15).", low=0.0, ends=False)
    ] = CORNER_NOISE_PX
    place_m: Annotated[
        float,
        Option(
            metavar="MM",
            help="Standard uncertainty of stated places of boards and camera (10).",
            named="place",
            unit="mm",
            low=0.0,
            ends=False,
        ),
    ] = PLACE_M
    """Per axis, metres."""
    place_rad: Annotated[
        float,
        Option(
            metavar="DEG",
            help="Standard uncertainty of their stated directions (3).",
            named="place",
            unit="deg",
            low=0.0,
            high=30.0,
            ends=False,
        ),
    ] = PLACE_RAD
    """Radians."""
    roll: Annotated[
        float,
        Option(
            metavar="DEG",
            help="Turn of the camera about its line of sight (0).",
            unit="deg",
            low=0.0,
            high=360.0,
        ),
    ] = 0.0
    """Radians."""
    found: Float[np.ndarray, "fixtures 4 4"] | None = None
    """Where a fit has the middle of each board, or the camera, in the base; None for where the fixtures are stated."""

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
        stated = {"depths": (low, high), "in_view": 1.0 if whole else SHARE_SEEN, **stated}
        return super().set_up(model, task, T_tool_tip, fixtures, board=boards, camera=seen, on_wrist=on_wrist, **stated)

    @classmethod
    def arrange(
        cls, p: Float[np.ndarray, "n 3"], pointing: Float[np.ndarray, " 3"], reach: float, stated: Mapping[str, Any]
    ) -> Fixtures:
        """Boards before the tool, as far from one another as the task has room, all facing it."""
        names = tuple(board.name for board in stated["board"])
        position = far_apart(p, len(names)) if len(names) > 1 else p.mean(axis=0)[None]
        position = on_the_floor(position + 0.5 * sum(stated["depths"]) * pointing)
        return Fixtures(names=names, position=position, direction=np.tile(-pointing, (len(names), 1)))

    @property
    def label(self) -> str:
        """What stands."""
        return "board" if self.on_wrist else "camera"

    @property
    def instructions(self) -> str:
        """Instructions for the file of a plan."""
        return Said(
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
        if self.found is not None:
            return self.found
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

    def as_fitted(
        self, kind: Observation, unknown: Float[np.ndarray, " u"], T_tool_target: Float[np.ndarray, "4 4"]
    ) -> "PixelInstrument":
        """Boards and camera where a fit has them, and the camera's numbers as it has these."""
        at = dict(zip(kind.unknowns, unknown, strict=True))
        names = [f"board {name}" if self.on_wrist else name for name in self.fixtures.names]
        pose = np.array([[at[f"{name}.{c}"] for c in COMPONENTS] for name in names])
        found, tip = se3.pose(se3.exp(pose[:, 3:]), pose[:, :3]), T_tool_target
        if self.on_wrist:
            found = found @ np.stack([self._centre(k) for k in range(self.count)])
        else:
            tip = T_tool_target @ self._centre(0) @ FLIP
        numbers = np.array([at[f"camera.{name}"] for name in self.camera.lens.unknowns])
        camera = replace(self.camera, numbers=numbers, uncertainty=None)
        return replace(self, found=found, T_tool_tip=tip, camera=camera, roll=0.0)

    @property
    def looked_for(self) -> LookedFor:
        """The boards, in images of the camera's size."""
        return LookedFor(self.board, self.camera.lens)

    def sight(
        self, target: Float[np.ndarray, "4 4"], rng: np.random.Generator
    ) -> tuple[Int[np.ndarray, " c"], Float[np.ndarray, "c 2"]]:
        """The same; of a board that is found as a whole all corners or none."""
        of = np.zeros(1, dtype=np.int64)
        moving = target[None] if self.on_wrist else (target @ self._centre(0))[None]
        seen, pixel = (one[0] for one in self._seen(self._relative(moving, of), of))
        if not self.board[0].markers and not seen.all():
            seen = np.zeros_like(seen)
        own = np.flatnonzero(seen)
        return self.board[0].ids()[own], pixel[own] + self.noise_px * rng.normal(size=(len(own), 2))

    def _relative(self, moving: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]) -> Float[np.ndarray, "n 4 4"]:
        """The middle of the board in the camera's frame, by the pose of what moves, camera or middle of the board."""
        standing = self._standing[of]
        return se3.inverse(moving) @ standing if self.on_wrist else se3.inverse(standing) @ moving

    def goals(
        self, model: ErrorModel, task: Task, fixture: int, u: Float[np.ndarray, "n 6"]
    ) -> Float[np.ndarray, "n 4 4"]:
        """The middle of the board anywhere in the picture and in focus, tilted to all sides and turned at will."""
        lens, (fx, fy, cx, cy) = self.camera.lens, self.camera.numbers[:4] * KILO
        nearest, farthest = self.depths
        depth = nearest + (farthest - nearest) * u[:, 5]
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
                inside &= (depth >= self.depths[0] - SHARP_M) & (depth <= self.depths[1] + SHARP_M)
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
            Said("too few corners in the image and in focus"): ~enough,
            Said("too few corners where camera and board may be"): ~surely,
            Said("the board too flat"): self._flat(T) > self.tilt + 1e-9,
            Said("the board hidden by the robot"): ~self.sight_is_free(self.tip(model, q), of, links),
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
            lenses=(self.camera.lens,),
            moving=("camera" if self.on_wrist else f"board {self.board[0].name}",),
            given=(self.camera,),
            start=self.unknown,
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
            view=np.arange(len(rows)),
            first=np.concatenate([[0], np.cumsum(seen[rows].sum(axis=1))]),
            corner=places[first[which[row]] + corner],
            pixel=pixel[row, corner],
            weight=np.full(len(row), self.noise_px**-2.0),
            camera=self.camera.numbers,
            T_camera_board=T,
            noise=self.noise_px,
        )
        return replace(kind, of=there, images=names, pictures=(pictures,))

    def rotations(
        self, tip: Float[np.ndarray, "n 4 4"], of: Int[np.ndarray, " n"]
    ) -> Float[np.ndarray, "n 3 3"] | None:
        """Of what moves in the frame of what stands."""
        poses = self.unknown[: 6 * self.count].reshape(-1, 6)
        return np.swapaxes(se3.exp(poses[:, 3:]), 1, 2)[of] @ tip[:, :3, :3]

    def columns(self, of: Int[np.ndarray, " n"]) -> dict[str, list[str]]:
        """The board that each image is to show, where there are several."""
        return {"board": [self.fixtures.names[k] for k in of]} if self.count > 1 else {}
