"""Boards that bend: the height of a printed sheet over its plane, where left-out images prove it.

A sheet that bows or twists is of the second order in its two directions, and three numbers say so: z = a·x² + b·x·y + c·y². What is
linear is the board's pose. The numbers are found beside the camera, each image's pose eliminated, as the camera is.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from taskcal.kernels.projection import POSE, project
from taskcal.observations.calibration_board import bend_terms
from taskcal.observations.camera import KILO, LENSES, Pictures, refine_camera, weigh_corners

BEND_PRIOR = 0.02
"""Standard deviation of each of the three heights about none, over half the board's size: sheets that look flat are within."""

PARTS = 4
"""Parts of the images, each predicted from the others."""

SURE_SIGMAS = 3.0
"""Standard errors by which left-out images must be predicted better before a board is taken for bent."""

FEWEST_PICTURES = 8
"""Images from which on a bend is looked for: two in each part."""

ROUNDS = 4
"""Of Gauss and Newton: heights of boards are nearly linear in what is seen."""


class Bend(NamedTuple):
    """Of a board."""

    board: int
    height: float
    """Of its highest corner over its lowest, beside the plane that fits best, metres."""
    error: float
    """Standard error of it."""


def find_bend(pictures: Pictures) -> tuple[Pictures, list[Bend], list[int]]:
    """Find boards that are bent.

    Returns:
        corners at the heights that their boards prove to have, with camera and noise beside them; which boards these are; and those
        that are taken for flat because their images do not tell: of a single tag, or ones whose bend runs away.
    """
    found, untold = list[Bend](), list[int]()
    for board in np.unique(pictures.board).tolist():
        own = np.flatnonzero(pictures.board == board)
        if not _shows_bend(pictures, own):
            untold.append(board)
            continue
        if len(own) < FEWEST_PICTURES:
            continue
        try:
            better = _gain(pictures, own)
        except np.linalg.LinAlgError:
            better = np.full(len(own), np.nan)
        if not np.isfinite(better).all():
            untold.append(board)
            continue
        if better.mean() <= SURE_SIGMAS * better.std(ddof=1) / np.sqrt(len(own)):
            continue
        bent, height, error = _bent(pictures, own)
        for _ in range(2):
            bent = weigh_corners(refine_camera(bent)[0])
        pictures = bent
        found.append(Bend(board, height, error))
    return pictures, found, untold


def _shows_bend(pictures: Pictures, own: Int[np.ndarray, " n"]) -> bool:
    """Whether the corners of a board would lie otherwise in every pose if it bent, unlike the four of a tag."""
    plane = np.unique(pictures.corner[np.isin(pictures.of, own), :2], axis=0)
    terms = np.column_stack([np.ones(len(plane)), plane, bend_terms(plane, plane)])
    return bool(np.linalg.matrix_rank(terms / np.abs(terms).max(axis=0)) == terms.shape[1])


def _gain(pictures: Pictures, own: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """How much better each image of a board is predicted with the bend of the other images than flat, in log likelihood."""
    out = np.zeros(len(own))
    for part in range(PARTS):
        left = own[part::PARTS]
        fitted = np.setdiff1d(np.arange(len(pictures)), left)
        others, seen = pictures.take(fitted), pictures.take(left)
        bent, _, _ = _bent(others, np.flatnonzero(np.isin(fitted, own)))
        flat = refine_camera(others)[0]
        z = _heights(seen, _coefficients(bent, others, np.isin(fitted, own)))
        raised = replace(seen, corner=z, _last=[])
        out[part::PARTS] = seen.settle(flat.camera).cost - raised.settle(bent.camera).cost
    return out


def _coefficients(bent: Pictures, flat: Pictures, own: np.ndarray) -> tuple[np.ndarray, Float[np.ndarray, " 3"]]:
    """The corners of a board that images show, flat, and its three heights."""
    mine = own[flat.of]
    terms = bend_terms(flat.corner[mine, :2], flat.corner[mine, :2])
    height = bent.corner[mine, 2] - flat.corner[mine, 2]
    return flat.corner[mine, :2], np.linalg.lstsq(terms, height, rcond=None)[0]


def _heights(pictures: Pictures, found: tuple[np.ndarray, Float[np.ndarray, " 3"]]) -> Float[np.ndarray, "c 3"]:
    """Corners of images, all of one board, with its heights."""
    whole, heights = found
    corner = pictures.corner.copy()
    corner[:, 2] += bend_terms(corner[:, :2], whole) @ heights
    return corner


def _bent(pictures: Pictures, own: Int[np.ndarray, " n"]) -> tuple[Pictures, float, float]:
    """Pictures with the bend of one board and the camera that fit best, its height over its plane, and the standard error of it."""
    mine = np.isin(pictures.of, own)
    terms = np.where(mine[:, None], bend_terms(pictures.corner[:, :2], pictures.corner[mine, :2]), 0.0)
    k = len(pictures.camera)
    pixels = np.concatenate([np.full(4, KILO), np.ones(k - 4)])
    half = 0.5 * float(np.ptp(pictures.corner[mine, :2], axis=0).max())
    precision = np.concatenate([pictures.lens.deviations**-2.0, np.full(3, (BEND_PRIOR * half) ** -2.0)])
    mean = np.concatenate([pictures.camera[:2], pictures.lens.start(1.0)[2:], np.zeros(3)])
    flat, x = pictures.corner, np.concatenate([pictures.camera, np.zeros(3)])
    at, covariance = pictures, np.zeros((len(x), len(x)))
    for _ in range(ROUNDS):
        corner = flat + np.column_stack([np.zeros((len(flat), 2)), terms @ x[k:]])
        at = replace(at, corner=corner, camera=x[:k], _last=[])
        settled = at.settle(x[:k])
        at = replace(at, T_camera_board=settled.T_camera_board, _last=[])
        T = settled.T_camera_board[at.of]
        seen, by = project(LENSES[at.lens.model], x[:k] * pixels, T[:, :3, :3], T[:, :3, 3], corner)
        by_height = (by[:, :, :3] @ T[:, :3, 2, None]) * terms[:, None, :]
        A = np.concatenate([by[:, :, :POSE], by[:, :, POSE:] * pixels, by_height], axis=2)
        S, g = np.diag(precision), precision * (mean - x)
        for first, end in zip(at.first[:-1].tolist(), at.first[1:].tolist(), strict=True):
            root = np.sqrt(at.weight[first:end])[:, None, None]
            B, r = (
                (root * A[first:end]).reshape(-1, A.shape[2]),
                (root[:, :, 0] * (at.pixel - seen)[first:end]).reshape(-1),
            )
            basis = np.linalg.qr(B[:, :POSE])[0]
            C = B[:, POSE:] - basis @ (basis.T @ B[:, POSE:])
            S, g = S + C.T @ C, g + C.T @ r
        x = x + np.linalg.solve(S, g)
        covariance = np.linalg.inv(S)
    corner = flat + np.column_stack([np.zeros((len(flat), 2)), terms @ x[k:]])
    plane = np.column_stack([np.ones(mine.sum()), flat[mine, :2]])
    over = terms[mine] - plane @ np.linalg.lstsq(plane, terms[mine], rcond=None)[0]
    z = over @ x[k:]
    ends = over[z.argmax()] - over[z.argmin()]
    error = float(np.sqrt(ends @ covariance[k:, k:] @ ends))
    return replace(at, corner=corner, camera=x[:k], _last=[]), float(np.ptp(z)), error
