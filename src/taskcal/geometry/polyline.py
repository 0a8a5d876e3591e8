"""A path in space given by its points: tangents, distances from it, and where it crosses planes."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

_BLOCK = 1_000_000
"""Pairs of a point and a segment that are looked at together; bounds the memory."""

_ROUNDING = 1e-9
"""Metres by which a point abreast of an end may seem to lie beyond it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Crossings:
    """Crossings of a path with planes, at most one for each."""

    planes: Int[np.ndarray, " k"]
    """Which planes are crossed, ascending."""
    points: Float[np.ndarray, "k 3"]
    """Where, metres."""
    segments: Int[np.ndarray, " k"]
    """Number of the path's segment that crosses."""
    fractions: Float[np.ndarray, " k"]
    """How far along that segment, from 0 to 1."""


def is_closed(path: Float[np.ndarray, "n 3"]) -> bool:
    """Whether a path of more than two points ends where it begins."""
    return len(path) > 3 and bool(np.array_equal(path[0], path[-1]))


def tangents(path: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Unit tangents: halfway between the directions of the segments that meet at a point; zero where the path turns back.

    Args:
        path: points, no two neighbours the same.
    """
    steps = np.diff(path, axis=0)
    steps /= np.linalg.norm(steps, axis=1, keepdims=True)
    before, after = np.vstack([steps[:1], steps]), np.vstack([steps, steps[-1:]])
    if is_closed(path):
        before[0], after[-1] = steps[-1], steps[0]
    sums = before + after
    lengths = np.linalg.norm(sums, axis=1, keepdims=True)
    back = lengths < 1e-6
    return np.where(back, 0.0, sums / np.where(back, 1.0, lengths))


def distances(
    points: Float[np.ndarray, "m 3"], path: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, " m"], Bool[np.ndarray, " m"]]:
    """Distance of each point from the nearest point of a path, and whether it lies off one of the path's ends.

    Args:
        points: the points, metres.
        path: at least two points, no two neighbours the same, metres.

    Returns:
        distances, metres; where the nearest point is an end of an open path and the point lies beyond it.
    """
    from scipy.spatial import KDTree

    start, step = path[:-1], np.diff(path, axis=0)
    length = np.linalg.norm(step, axis=1)
    to_points, _ = KDTree(path).query(points)
    nearest, off = np.empty(len(points)), np.zeros(len(points), dtype=bool)
    for row, segment in _near(points, path, to_points):
        away = points[row] - start[segment]
        along = np.einsum("ki,ki->k", away, step[segment]) / length[segment] ** 2
        away -= np.clip(along, 0.0, 1.0)[:, None] * step[segment]
        distance, slack = np.linalg.norm(away, axis=1), _ROUNDING / length[segment]
        beyond = ((segment == 0) & (along < -slack)) | ((segment == len(step) - 1) & (along > 1.0 + slack))
        order = np.lexsort((distance, row))
        rows, firsts = np.unique(row[order], return_index=True)
        nearest[rows], off[rows] = distance[order[firsts]], beyond[order[firsts]]
    return nearest, off & (not is_closed(path))


def cross_planes(
    path: Float[np.ndarray, "m 3"], origins: Float[np.ndarray, "n 3"], normals: Float[np.ndarray, "n 3"], within: float
) -> Crossings:
    """Points where a path crosses planes in the sense of their normals.

    Args:
        path: its points, metres.
        origins: a point of each plane, metres.
        normals: unit normal of each plane.
        within: a crossing counts if it is no farther than this from its plane's origin, metres; the nearest is taken.
    """
    crossing_parts: list[tuple[np.ndarray, ...]] = []
    for plane, segment in _near(origins, path, np.full(len(origins), within)):
        before = np.einsum("ki,ki->k", path[segment] - origins[plane], normals[plane])
        after = np.einsum("ki,ki->k", path[segment + 1] - origins[plane], normals[plane])
        through = (before <= 0.0) & (after >= 0.0) & (after > before)
        crossing_parts.append((plane[through], segment[through], before[through] / (before[through] - after[through])))
    plane, segment, fraction = (np.concatenate(parts) for parts in zip(*crossing_parts, strict=True))
    points = path[segment] + fraction[:, None] * (path[segment + 1] - path[segment])
    away = np.linalg.norm(points - origins[plane], axis=1)
    order = np.lexsort((away, plane))
    order = order[away[order] <= within]
    planes, firsts = np.unique(plane[order], return_index=True)
    chosen = order[firsts]
    return Crossings(planes=planes, points=points[chosen], segments=segment[chosen], fractions=fraction[chosen])


def _near(
    points: Float[np.ndarray, "m 3"], path: Float[np.ndarray, "n 3"], radii: Float[np.ndarray, " m"]
) -> Iterator[tuple[Int[np.ndarray, " k"], Int[np.ndarray, " k"]]]:
    """Pairs of a point and a segment, all that may be as close as the point's radius, some points at a time."""
    from scipy.spatial import KDTree

    middles = KDTree(0.5 * (path[:-1] + path[1:]))
    half = 0.5 * np.linalg.norm(np.diff(path, axis=0), axis=1).max() + _ROUNDING
    block = max(1, _BLOCK // len(path))
    for first in range(0, len(points), block):
        part = slice(first, first + block)
        segments = middles.query_ball_point(points[part], radii[part] + half)
        rows = np.repeat(np.arange(first, first + len(segments)), [len(each) for each in segments])
        yield rows, np.concatenate([np.asarray(each, dtype=np.intp) for each in segments])
