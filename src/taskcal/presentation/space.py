"""Layers that several scenes in space share."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.presentation.plan_figures import outline
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
