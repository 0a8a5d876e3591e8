"""What the poses do not say of the targets' places on the tool, and what is taken instead, in words."""

import numpy as np
from jaxtyping import Float

from taskcal.measurement.registration import Registration

CLEAR = 1e-6
"""Share of a direction that counts as present or absent."""


def describe_unobservable(registration: Registration) -> tuple[str, ...]:
    """For each target what the poses do not say of its place, empty where they say all.

    In directions that the poses do not determine the target, or what all targets have in common, is held at the tool
    point. In the others it is found from the data, however far off that is.
    """
    common = _common(registration.unobservable)
    return tuple("" if located else _say(common) for located in registration.located)


def _common(unlocated: Float[np.ndarray, "offsets offsets"]) -> tuple[int, Float[np.ndarray, "3 3"]] | None:
    """Number of targets, and the projector onto the directions in which they are undetermined together; None otherwise."""
    count = len(unlocated) // 3
    blocks = unlocated.reshape(count, 3, count, 3)
    directions = np.einsum("tisj->ij", blocks) / count
    same = np.kron(np.full((count, count), 1.0 / count), directions)
    return (count, directions) if np.allclose(same, unlocated, atol=CLEAR) else None


def _say(common: tuple[int, Float[np.ndarray, "3 3"]] | None) -> str:
    if common is None:
        return "the poses do not locate it in every direction: there it is taken as near to the tool point as the others allow"
    count, directions = common
    what = "it" if count == 1 else "the targets, but for their distances to each other"
    taken = "it is" if count == 1 else "their middle is"
    values, vectors = np.linalg.eigh(directions)
    rank = int((values > 0.5).sum())
    if rank == 3:
        return f"the poses do not locate {what}: {taken} taken at the tool point"
    if rank == 1:
        along = _axis(vectors[:, -1])
        return f"the poses do not locate {what}, along {along} of the tool: in that direction alone {taken} taken at the tool point"
    across = _axis(vectors[:, 0])
    return f"the poses do not locate {what}, across {across} of the tool: in those directions {taken} taken at the tool point"


def _axis(direction: Float[np.ndarray, " 3"]) -> str:
    """A direction in the tool frame, by the name of an axis where it is one."""
    largest = int(np.argmax(np.abs(direction)))
    if abs(direction[largest]) > 1.0 - CLEAR:
        return "xyz"[largest]
    return "({:.2f} {:.2f} {:.2f})".format(*(direction * np.sign(direction[largest]) + 0.0))
