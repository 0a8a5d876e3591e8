"""Whether a rewritten program, read again, says what was to be written."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Int

from taskcal.errors import TaskcalError
from taskcal.programs.program import Move, Waypoint

ROUNDING = 1e-5
"""Numbers are written to this at least, metres."""


def check_reading(
    moves: Sequence[Move],
    pieces: Int[np.ndarray, " m"],
    waypoints: Mapping[int, tuple[Waypoint, ...]],
    tolerance: float,
) -> None:
    """See that rewritten motions go where they should: what they share with others may have been changed for those.

    Args:
        moves: of the rewritten program, as read again.
        pieces: into how many of them each motion of the given program became.
        waypoints: what was to be written, by number of the motion.
        tolerance: how far a target may be off that goes with another one, metres.

    Raises:
        TaskcalError: one does not.
    """
    first = np.cumsum(pieces) - pieces
    for i, path in waypoints.items():
        for move, waypoint in zip(moves[first[i] : first[i] + pieces[i]], path, strict=True):
            if waypoint.T is None or move.end.T is None:
                continue
            off = float(np.linalg.norm(move.end.T[:3, 3] - waypoint.T[:3, 3]))
            if off > tolerance + ROUNDING:
                raise TaskcalError(
                    f"{move.place}: the corrected program reads {off * 1e3:.3f} mm beside what it should say; nothing was written"
                )
