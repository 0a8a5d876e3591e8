"""How far the true tool is from where a program wants it, at its targets and between them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Bool, Float, Int

from taskcal.correction.controller_trajectory import ControllerTrajectory
from taskcal.correction.placement import Placed
from taskcal.correction.rounded_path import RoundedPath
from taskcal.geometry import se3
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class Deviations:
    """Where the true tool is against where the program wants it."""

    move: Int[np.ndarray, " k"]
    """Motion of the program as it was given."""
    share: Float[np.ndarray, " k"]
    """Share of its length."""
    at_target: Bool[np.ndarray, " k"]
    """At the motion's end, which is in its target or in the middle of the corner there; elsewhere the component along the path is
    left out of the error."""
    q: Float[np.ndarray, "k joints"]
    """Joint positions of the controller, radians."""
    error: Float[np.ndarray, "k 3"]
    """True less wanted position of the tool point in the part's axes, metres."""
    turn: Float[np.ndarray, " k"]
    """Angle between true and wanted orientation, radians."""

    def of_moves(self, moves: Bool[np.ndarray, " m"]) -> "Deviations":
        """Those in some of the motions."""
        rows = moves[self.move]
        return Deviations(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @property
    def length(self) -> Float[np.ndarray, " k"]:
        """Of the errors, in space, metres."""
        return np.linalg.norm(self.error, axis=1)


def assess(
    placed: Placed,
    wanted: RoundedPath,
    trajectory: ControllerTrajectory,
    origin: Sequence[tuple[int, float, float]] | None = None,
) -> Deviations:
    """Compare the true tool with the path that a program asks for; between targets only where a segment's start is known.

    Args:
        placed: the motions of the program as it was given, on the robot as calibrated, or as it truly is.
        wanted: the path that it asks for, tool in part.
        trajectory: where the controller moves its joints, in this program or in a rewritten one.
        origin: for each motion of the rewritten program, the one it comes from, and the shares of its length where it
            begins and ends; the program itself by default.
    """
    table = np.array([(i, 0.0, 1.0) for i in range(len(trajectory.end))] if origin is None else origin, dtype=float)
    table = table.reshape(-1, 3)
    source = table[:, 0].astype(np.int64)
    unsampled = np.isfinite(trajectory.end[:, 0])
    unsampled[trajectory.move] = False  # a sampled motion has its end among the samples
    single = np.flatnonzero(unsampled)
    move = np.concatenate([trajectory.move, single])
    share = np.concatenate([trajectory.share, np.ones(len(single))])
    q = np.concatenate([trajectory.q, trajectory.passes[single]])
    order = np.lexsort((share, move))
    move, share, q = move[order], share[order], q[order]
    first, last = table[move, 1], table[move, 2]
    original, along = source[move], first + share * (last - first)
    at_target = along >= 1.0 - 1e-12
    assessable = at_target | np.isfinite(wanted.segments.start[original, 0, 0])
    original, along, q, at_target = original[assessable], along[assessable], q[assessable], at_target[assessable]
    T = wanted.at(original, along)
    true = placed.tool_in_part(original, along, q)
    error = true[:, :3, 3] - T[:, :3, 3]
    between = np.flatnonzero(~at_target)
    tangent = wanted.direction(original[between], along[between])
    error[between] -= (error[between] * tangent).sum(axis=1, keepdims=True) * tangent
    turn = np.linalg.norm(se3.log(true[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)), axis=1)
    return Deviations(move=original, share=along, at_target=at_target, q=q, error=error, turn=turn)
