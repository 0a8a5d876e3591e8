"""A camera's lens, the corners of boards in its pictures, and what pictures alone say of the lens.

The pose of the board in a picture is eliminated: of a camera θ, each picture has the pose T(θ) that fits its corners best, the
information of that pose, and beside it residuals that depend on θ alone (variable projection: Golub and Pereyra 1973). Poses
and these residuals together are the corners' likelihood, to the second order in errors of a robot beside the distance of the board:
nothing of the corners is lost, and what a few corners in a row do not tell of a pose has no information there.
"""

from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.kernels.projection import FISHEYE, PINHOLE, POSE, eliminate_poses

KILO = 1e3
"""Pixels are in thousands among a fit's unknowns, as lengths are in metres: shown in pixels as those are in millimetres."""

LENSES = {"pinhole": PINHOLE, "fisheye": FISHEYE}

DISTORTION = {"pinhole": ("k1", "k2", "p1", "p2", "k3"), "fisheye": ("k1", "k2", "k3", "k4")}
"""Coefficients of each lens, in OpenCV's order."""

DISTORTION_PRIOR = {"k1": 1.0, "k2": 1.0, "k3": 1.0, "k4": 1.0, "p1": 0.02, "p2": 0.02}
"""Standard deviations about none: lenses of machine vision have k1 of −0.5 to 0.2 and decentring under 0.005; more says nothing."""

FOCAL_PRIOR, CENTRE_PRIOR = 1.0, 0.2
"""Of focal lengths about the first estimate, over it, and of the centre about the middle of the picture, over its width."""

FEWEST_CORNERS = 4
"""Corners that a pose needs."""

IN_LINE = 1e-9
"""Determinant of the scatter of corners, over its squared trace, up to which they are in a line: rounding; two rows of a grid have
a thousandth and more."""

FOCAL_GUESSES = (0.35, 0.6, 1.0, 1.6, 2.6, 4.0)
"""Focal lengths over the picture's width, tried where homographies do not tell: lenses from 110° to 14°."""

HUBER = 2.5
"""Standard deviations from which on a corner counts less. Of sound corners one in eighty is beyond."""

EXACT = 1e-6
"""Standard uncertainty of a camera's number that is stated as exact: a thousandth of a pixel, less than images show."""

ROUNDS, STEPS = 60, 30
"""Of the fit of a camera, and of a picture's pose, at most."""

STANDS = 1e-8
"""Newton decrement with which a camera is found, in variances."""


@dataclass(frozen=True, kw_only=True)
class Lens:
    """The form of a camera."""

    model: str
    """``pinhole`` or ``fisheye``."""
    width: int
    """Of a picture, pixels."""
    height: int

    @property
    def unknowns(self) -> tuple[str, ...]:
        """Names of its numbers: focal lengths and centre in thousands of pixels, then the distortion."""
        return ("fx", "fy", "cx", "cy", *DISTORTION[self.model])

    @property
    def deviations(self) -> Float[np.ndarray, " k"]:
        """Standard deviations of these before a picture is seen, for a focal length of the picture's width."""
        size = self.width / KILO
        lengths = [FOCAL_PRIOR * size] * 2 + [CENTRE_PRIOR * size] * 2
        return np.array([*lengths, *(DISTORTION_PRIOR[name] for name in DISTORTION[self.model])])

    def start(self, focal: float) -> Float[np.ndarray, " k"]:
        """A camera without distortion, of a focal length over the picture's width."""
        out = np.zeros(len(self.unknowns))
        out[:4] = np.array([focal * self.width, focal * self.width, 0.5 * (self.width - 1), 0.5 * (self.height - 1)])
        out[:4] /= KILO
        return out


class Settled(NamedTuple):
    """Pictures at a camera: the pose of each board, and what the corners say beside it."""

    T_camera_board: Float[np.ndarray, "n 4 4"]
    information: Float[np.ndarray, "n p p"]
    """Of the pose, a move and a turn in the camera's axes about the board's origin, and of the camera."""
    gradient: Float[np.ndarray, "n p"]
    cost: Float[np.ndarray, " n"]

    @property
    def pose_covariance(self) -> Float[np.ndarray, "n 6 6"]:
        """Of each board's pose by the noise of its corners."""
        return np.linalg.inv(self.information[:, :POSE, :POSE])

    @property
    def by_camera(self) -> Float[np.ndarray, "n 6 k"]:
        """Derivative of each board's pose by the camera."""
        H = self.information
        return -np.linalg.solve(H[:, :POSE, :POSE], H[:, :POSE, POSE:])

    @property
    def of_camera(self) -> tuple[Float[np.ndarray, "n k k"], Float[np.ndarray, "n k"]]:
        """Information and gradient of the camera, poses eliminated, of each picture."""
        H, by = self.information, self.by_camera
        information = H[:, POSE:, POSE:] + np.swapaxes(by, 1, 2) @ H[:, :POSE, POSE:]
        gradient = self.gradient[:, POSE:] + (np.swapaxes(by, 1, 2) @ self.gradient[:, :POSE, None])[..., 0]
        return information, gradient


@dataclass(frozen=True, eq=False, kw_only=True)
class Pictures:
    """Corners of boards in pictures of one camera."""

    lens: Lens
    names: tuple[str, ...]
    """Of the pictures."""
    board: Int[np.ndarray, " n"]
    """Number of the board in each."""
    view: Int[np.ndarray, " n"]
    """Number of the posture of the robot in each; an image with several boards is a picture of each of them."""
    first: Int[np.ndarray, " n1"]
    """Number of the first corner of each picture, and of all."""
    corner: Float[np.ndarray, "c 3"]
    """On its board, metres."""
    pixel: Float[np.ndarray, "c 2"]
    """Where it was seen, pixels; the middle of the first pixel is at zero."""
    weight: Float[np.ndarray, " c"]
    """Of each corner, per square pixel."""
    camera: Float[np.ndarray, " k"]
    """What the pictures alone say, as `Lens.unknowns`."""
    T_camera_board: Float[np.ndarray, "n 4 4"]
    """Poses of the boards there."""
    noise: float = 1.0
    """Standard deviation of a corner in each direction, pixels."""
    _last: list[tuple[bytes, Settled]] = field(default_factory=list[tuple[bytes, Settled]], repr=False)
    """The camera at which they were settled last, and how: a fit asks twice and more at each of its steps."""

    def __len__(self) -> int:
        return len(self.names)

    def settle(self, camera: Float[np.ndarray, " k"], steps: int = STEPS) -> Settled:
        """Find the poses of the boards at a camera."""
        key = camera.tobytes()
        for last, found in self._last:
            if last == key:
                return found
        pixels = np.concatenate([np.full(4, KILO), np.ones(len(camera) - 4)])
        T, H, g, cost = eliminate_poses(
            LENSES[self.lens.model],
            camera * pixels,
            self.corner,
            self.pixel,
            self.weight,
            self.first,
            self.T_camera_board,
            steps,
        )
        by_unknown = np.concatenate([np.ones(POSE), pixels])
        found = Settled(T, H * by_unknown[:, None] * by_unknown, g * by_unknown, cost)
        self._last[:] = [(key, found)]
        return found

    def take(self, numbers: Int[np.ndarray, " m"]) -> "Pictures":
        """Some of the pictures."""
        ends = self.first.tolist()
        corners = np.concatenate([np.arange(0), *(np.arange(ends[k], ends[k + 1]) for k in numbers.tolist())])
        return replace(
            self,
            names=tuple(self.names[k] for k in numbers),
            board=self.board[numbers],
            view=self.view[numbers],
            first=np.concatenate([[0], np.cumsum(np.diff(self.first)[numbers])]),
            corner=self.corner[corners],
            pixel=self.pixel[corners],
            weight=self.weight[corners],
            T_camera_board=self.T_camera_board[numbers],
            _last=[],
        )

    def of_views(self, views: Int[np.ndarray, " m"]) -> "Pictures":
        """The pictures of some postures, numbered anew."""
        part = self.take(np.flatnonzero(np.isin(self.view, views)))
        return replace(part, view=np.searchsorted(views, part.view))

    @property
    def of(self) -> Int[np.ndarray, " c"]:
        """Picture of each corner."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))

    def residual(self, settled: Settled, camera: Float[np.ndarray, " k"]) -> Float[np.ndarray, "c 2"]:
        """Seen less predicted with the board of each picture where it was settled, pixels."""
        return self.pixel - self.predicted(settled.T_camera_board, camera)

    def predicted(self, T_camera_board: Float[np.ndarray, "n 4 4"], camera: Float[np.ndarray, " k"]) -> np.ndarray:
        """Pixels of the corners for boards anywhere; NaN behind the camera."""
        from taskcal.kernels.projection import project

        T = T_camera_board[self.of]
        pixels = np.concatenate([np.full(4, KILO), np.ones(len(camera) - 4)])
        return project(LENSES[self.lens.model], camera * pixels, T[:, :3, :3], T[:, :3, 3], self.corner)[0]


# A camera from pictures alone, as a start, and the noise of the corners.


def calibrate_camera(
    lens: Lens,
    names: tuple[str, ...],
    board: Int[np.ndarray, " n"],
    first: Int[np.ndarray, " n1"],
    corner: Float[np.ndarray, "c 3"],
    pixel: Float[np.ndarray, "c 2"],
    view: Int[np.ndarray, " n"] | None = None,
) -> Pictures:
    """Find a camera and the poses of boards from pictures, and the noise of the corners.

    Args:
        lens: its form.
        names: of the pictures.
        board: number of the board in each.
        first: number of the first corner of each picture, and of all.
        corner: places on the boards, metres, all of a picture in one plane z = 0.
        pixel: where each was seen.
        view: number of the posture of the robot in each picture; by default each has its own.

    Raises:
        CampaignError: a picture has too few corners, or no camera fits the pictures.
    """
    for k in np.flatnonzero(np.diff(first) < FEWEST_CORNERS):
        raise CampaignError(
            f"picture '{names[k]}' shows {int(first[k + 1] - first[k])} corners, where a pose needs {FEWEST_CORNERS}; leave it out"
        )
    blank = Pictures(
        lens=lens,
        names=names,
        board=board,
        view=np.arange(len(names)) if view is None else view,
        first=first,
        corner=np.ascontiguousarray(corner),
        pixel=np.ascontiguousarray(pixel),
        weight=np.ones(len(pixel)),
        camera=lens.start(1.0),
        T_camera_board=np.tile(np.eye(4), (len(names), 1, 1)),
    )
    homographies = [homography(corner[a:b, :2], pixel[a:b]) for a, b in pairwise(first)]
    best, least = blank, np.inf
    for focal in [*_focal_lengths(lens, homographies), *FOCAL_GUESSES]:
        start = lens.start(focal)
        posed = replace(blank, camera=start, T_camera_board=_poses(start, homographies), _last=[])
        try:
            trial, cost = refine_camera(posed, rounds=10)
        except np.linalg.LinAlgError:  # corners that do not lie on a plane lead to boards at infinity
            continue
        if cost < least:
            best, least = trial, cost
    if not np.isfinite(least):
        raise CampaignError("no camera fits these pictures; check that the corners belong to the board")
    for _ in range(3):
        best = weigh_corners(refine_camera(best)[0])
    return best


Known = tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]
"""Numbers of a camera, and their standard uncertainties."""


def recalibrate(pictures: Pictures, known: Known) -> Pictures:
    """The same pictures with the camera that they and what is known of it have."""
    pictures = replace(pictures, camera=known[0], _last=[])
    for _ in range(3):
        pictures = weigh_corners(refine_camera(pictures, known)[0])
    return pictures


def refine_camera(pictures: Pictures, known: Known | None = None, *, rounds: int = ROUNDS) -> tuple[Pictures, float]:
    """The camera that fits best next to a start, by Levenberg and Marquardt, and the cost."""
    if known is None:
        precision = pictures.lens.deviations**-2.0
        mean = np.concatenate([pictures.camera[:2], pictures.lens.start(1.0)[2:]])
    else:
        mean, precision = known[0], np.maximum(known[1], EXACT) ** -2.0

    def cost_of(at: Settled, camera: np.ndarray) -> float:
        return float(at.cost.sum() + 0.5 * (precision * (camera - mean) ** 2).sum())

    camera, damping = pictures.camera, 1e-3
    at = pictures.settle(camera)
    cost = cost_of(at, camera)
    for _ in range(rounds):
        information, gradient = (part.sum(axis=0) for part in at.of_camera)
        A, g = information + np.diag(precision), gradient + precision * (mean - camera)
        step = np.linalg.solve(A + damping * np.diag(np.diag(A)), g)
        trial = camera + step
        moved = replace(pictures, T_camera_board=at.T_camera_board, _last=[]).settle(trial)
        better = cost_of(moved, trial)
        if better < cost:
            gain, at, camera, cost, damping = cost - better, moved, trial, better, 0.1 * damping
            if gain < STANDS * max(1.0, cost):
                break
        elif damping > 1e6:
            break
        else:
            damping *= 10.0
    return replace(pictures, camera=camera, T_camera_board=at.T_camera_board, _last=[]), cost


def weigh_corners(pictures: Pictures) -> Pictures:
    """Pictures with the corners weighed by their noise, which is found from the residuals; those far off count less (Huber 1964).

    The variance is that of the estimator: E[ψ²]/E[ψ′]² over the mean weight, since the information has the weights in it.
    """
    r = pictures.residual(pictures.settle(pictures.camera), pictures.camera)
    freedom = max(r.size - POSE * len(pictures) - len(pictures.camera), 1)
    scale = max(1.4826 * float(np.median(np.abs(r))) * np.sqrt(r.size / freedom), 1e-9)
    length = np.abs(r).max(axis=1)
    weight = np.minimum(1.0, HUBER * scale / np.maximum(length, 1e-300))
    psi, slope = weight[:, None] * r, float((length < HUBER * scale).mean())
    variance = float((psi**2).sum()) / freedom / max(slope, 0.1) ** 2 * float(weight.mean())
    variance = max(variance, 1e-18)
    return replace(pictures, weight=weight / variance, noise=float(np.sqrt(variance)), _last=[])


def noise_with(pictures: Pictures, model: str) -> float:
    """Noise of the corners if the camera had another lens, found from where the boards are now, pixels."""
    lens = replace(pictures.lens, model=model)
    start = np.concatenate([pictures.camera[:4], np.zeros(len(lens.unknowns) - 4)])
    other = replace(pictures, lens=lens, camera=start, _last=[])
    for _ in range(2):
        other = weigh_corners(refine_camera(other)[0])
    return other.noise


def homography(plane: Float[np.ndarray, "c 2"], pixel: Float[np.ndarray, "c 2"]) -> Float[np.ndarray, "3 3"]:
    """The homography from a plane to pixels, by the normalised direct linear transform (Hartley 1997)."""

    def normal(points: np.ndarray) -> np.ndarray:
        middle = points.mean(axis=0)
        scale = np.sqrt(2.0) / max(float(np.linalg.norm(points - middle, axis=1).mean()), 1e-12)
        return np.array([[scale, 0.0, -scale * middle[0]], [0.0, scale, -scale * middle[1]], [0.0, 0.0, 1.0]])

    A, B = normal(plane), normal(pixel)
    a = np.column_stack([plane, np.ones(len(plane))]) @ A.T
    b = np.column_stack([pixel, np.ones(len(pixel))]) @ B.T
    zero = np.zeros_like(a)
    rows = np.concatenate([np.hstack([a, zero, -b[:, :1] * a]), np.hstack([zero, a, -b[:, 1:2] * a])])
    H = np.linalg.inv(B) @ np.linalg.svd(rows)[2][-1].reshape(3, 3) @ A
    return H / np.linalg.norm(H)


def determines_pose(plane: Float[np.ndarray, "c 2"]) -> bool:
    """Whether corners of a board determine its homography: four or more, of which not all but one are in a line."""
    if len(plane) < FEWEST_CORNERS:
        return False
    off = plane - plane.mean(axis=0)
    n, (a, b, d) = len(off), (off[:, 0] @ off[:, 0], off[:, 0] @ off[:, 1], off[:, 1] @ off[:, 1])
    x, y = np.sqrt(n / (n - 1.0)) * off.T  # the scatter about their mean without each
    return bool(((a - x * x) * (d - y * y) - (b - x * y) ** 2).min() > IN_LINE * (a + d) ** 2)


def _focal_lengths(lens: Lens, homographies: list[Float[np.ndarray, "3 3"]]) -> list[float]:
    """Focal length over the picture's width by the orthogonality of a board's axes (Zhang 2000), the centre in the middle."""
    centre = np.array([[1, 0, -0.5 * (lens.width - 1)], [0, 1, -0.5 * (lens.height - 1)], [0, 0, lens.width]])
    rows, right = [], []
    for H in homographies:
        h = centre @ H / lens.width
        h /= np.linalg.norm(h[:, 0])
        x, y = h[:, 0], h[:, 1]
        rows += [x[:2] @ y[:2], x[:2] @ x[:2] - y[:2] @ y[:2]]
        right += [-x[2] * y[2], y[2] ** 2 - x[2] ** 2]
    a, b = np.array(rows), np.array(right)
    inverse = float(a @ b) / max(float(a @ a), 1e-300)
    return [float(1.0 / np.sqrt(inverse)) / lens.width] if inverse > 0 else []


def _poses(camera: Float[np.ndarray, " k"], homographies: list[Float[np.ndarray, "3 3"]]) -> Float[np.ndarray, "n 4 4"]:
    """Poses of boards by their homographies and a camera without distortion."""
    fx, fy, cx, cy = camera[:4] * KILO
    K = np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]])
    out: list[np.ndarray] = []
    for H in homographies:
        h = np.linalg.solve(K, H)
        h = h / (0.5 * (np.linalg.norm(h[:, 0]) + np.linalg.norm(h[:, 1])))
        h = h if h[2, 2] > 0 else -h
        R = se3.nearest_rotation(np.column_stack([h[:, 0], h[:, 1], np.cross(h[:, 0], h[:, 1])]))
        out.append(se3.pose(R, h[:, 2]))
    return np.stack(out)
