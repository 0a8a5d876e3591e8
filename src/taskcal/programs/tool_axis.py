"""Orientations of a tool of which only the axis is known."""

import numpy as np
from jaxtyping import Float


def with_axis(axis: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """Some orientation of the tool for each direction of its axis.

    Args:
        axis: from the tool's tip towards its holder, as APT has it (CATIA V5, syntax of generated APT instructions); need
            not be of unit length. The tool's own z points the other way, out of the tool.

    Returns:
        Rotations with that z; x lies as near to the first axis of the part's frame as it can, or to the second one
        where the tool is nearly parallel to the first.
    """
    z = -axis / np.linalg.norm(axis, axis=-1, keepdims=True)
    near = np.where(np.abs(z[..., :1]) < 0.9, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    x = near - (near * z).sum(axis=-1, keepdims=True) * z
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    y = z[..., [1, 2, 0]] * x[..., [2, 0, 1]] - z[..., [2, 0, 1]] * x[..., [1, 2, 0]]
    return np.stack([x, y, z], axis=-1)
