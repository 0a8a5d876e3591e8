"""Layers that several scenes in space share."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.presentation.theme import PURPLE
from taskcal.task.workspace import Workspace


def to_mm(points: Float[np.ndarray, "k 3"]) -> list[list[float]]:
    """Millimetres, to a tenth."""
    return np.round(np.asarray(points) * 1e3, 1).tolist()


def spread_rows(count: int, most: int) -> np.ndarray:
    """Numbers of at most so many rows, spread evenly over all."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).astype(int)) if count else np.zeros(0, dtype=int)


def workspace_layer(space: Workspace) -> Mapping[str, Any]:
    """The edges of a workspace."""
    edges = outline(space)
    gaps = np.flatnonzero(np.isnan(edges[:, 0]))
    strokes = [to_mm(stroke[np.isfinite(stroke[:, 0])]) for stroke in np.split(edges, gaps)]
    return {
        "kind": "strokes",
        "label": "workspace of the task",
        "colour": PURPLE,
        "width": 2.2,
        "at": [stroke for stroke in strokes if stroke],
    }


def coloured_points(
    label: str,
    points: Float[np.ndarray, "k 3"],
    values: Float[np.ndarray, " k"],
    span: tuple[float, float],
    tips: Sequence[str],
) -> Mapping[str, Any]:
    """Points from dark to bright by a value each.

    Args:
        label: of the layer, with what the colours mean.
        points: metres.
        values: of the points.
        span: values of the darkest and the brightest colour.
        tips: what is said of each point.
    """
    return {
        "kind": "points",
        "label": label,
        "size": 4,
        "at": to_mm(points),
        "values": np.round(values, 5).tolist(),
        "least": span[0],
        "most": span[1],
        "tips": list(tips),
    }


def outline(space: Workspace) -> Float[np.ndarray, "k 3"]:
    """Edges of a workspace in the base, metres; NaN between the strokes."""
    if space.shape == "box":
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]]) - 0.5
        rings = [np.c_[corners, np.full(5, side)] for side in (-0.5, 0.5)]
        posts = [np.array([[*corner, -0.5], [*corner, 0.5]]) for corner in corners[:4]]
    else:
        angle = np.linspace(0.0, 2.0 * np.pi, 49)
        circle = 0.5 * np.c_[np.cos(angle), np.sin(angle)]
        rings = [np.c_[circle, np.full(49, side)] for side in (-0.5, 0.5)]
        posts = [np.array([[*circle[k], -0.5], [*circle[k], 0.5]]) for k in (0, 12, 24, 36)]
    gap = np.full((1, 3), np.nan)
    local = np.concatenate([part for stroke in (*rings, *posts) for part in (stroke, gap)]) * space.size
    in_frame = space.center + local @ space.turned.T
    return in_frame @ space.T_base_frame[:3, :3].T + space.T_base_frame[:3, 3]
