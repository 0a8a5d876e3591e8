"""Where things stand in a virtual cell: well inside of what the tool reaches, and far from each other."""

import numpy as np
from jaxtyping import Float, Int

INNER = 0.5
"""Share of the positions, those nearest to the middle, that things stand at."""


def spots(position: Float[np.ndarray, "n 3"], count: int) -> Int[np.ndarray, " count"]:
    """Numbers of some positions: the one nearest to the middle, then always the one farthest from those taken.

    Some come twice where there are fewer positions.
    """
    away = np.linalg.norm(position - np.median(position, axis=0), axis=1)
    inner = np.argsort(away)[: max(int(INNER * len(position)), min(count, len(position)))]
    taken = [int(inner[0])]
    while len(taken) < count:
        near = np.linalg.norm(position[inner][:, None] - position[taken], axis=2).min(axis=1)
        taken.append(int(inner[np.argmax(near)]))
    return np.array(taken)
