"""Accuracy and repeatability of a path that was passed once or several times: ISO 9283:1998, clauses 8.2 and 8.3."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from taskcal.errors import CampaignError
from taskcal.geometry import polyline, se3
from taskcal.measurement.pose_performance import in_degrees, mean_and_three_deviations, mean_orientation
from taskcal.short_repr import short_repr

_CORNER = 2.0
"""In a plane that halves a corner of 60° or more, a path crosses at most so many times its distance away."""

_ROUNDING = 1e-9
"""Metres that an exact pass may seem to leave its path by."""


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PathPerformance:
    """How a commanded path was attained, in planes normal to it at its points."""

    sections: Int[np.ndarray, " sections"]
    """Which points of the commanded path were evaluated: those whose normal plane every pass crosses."""
    left_out: Int[np.ndarray, " others"]
    """The other points."""
    offsets: Float[np.ndarray, "passes sections 3"]
    """Where each pass crosses the normal plane, less the commanded point, metres."""
    angles: Float[np.ndarray, "passes sections 3"] | None
    """Rotations from the mean attained orientation there to each pass's, about the frame's axes, radians."""
    turn: Float[np.ndarray, "sections 3"] | None
    """Rotation from the commanded to the mean attained orientation, about the frame's axes, radians."""
    deviations: Float[np.ndarray, " samples"]
    """Distance of every sample of all passes from the nearest point of the commanded path, metres."""

    @property
    def cycles(self) -> int:
        """How many passes there are."""
        return len(self.offsets)

    @property
    def accuracy_along(self) -> Float[np.ndarray, " sections"]:
        """Distance of the mean of the passes from each commanded point, metres."""
        return np.linalg.norm(self.offsets.mean(axis=0), axis=1)

    @property
    def accuracy(self) -> float:
        """Positioning path accuracy AT_p: the largest of `accuracy_along`, metres (8.2)."""
        return float(self.accuracy_along.max())

    @property
    def orientation_accuracy(self) -> Float[np.ndarray, " 3"] | None:
        """Orientation path accuracy AT_a, AT_b, AT_c, radians (8.2); None where orientations are not known."""
        return None if self.turn is None else np.abs(self.turn).max(axis=0)

    @property
    def repeatability_along(self) -> Float[np.ndarray, " sections"] | None:
        """Repeatability of the passes at each commanded point, metres; None for a single pass."""
        if self.cycles < 2:
            return None
        return mean_and_three_deviations(np.linalg.norm(self.offsets - self.offsets.mean(axis=0), axis=-1))

    @property
    def repeatability(self) -> float | None:
        """Positioning path repeatability RT_p: the largest of `repeatability_along`, metres (8.3)."""
        along = self.repeatability_along
        return None if along is None else float(along.max())

    @property
    def orientation_repeatability(self) -> Float[np.ndarray, " 3"] | None:
        """Orientation path repeatability RT_a, RT_b, RT_c, which is to be read as ±, radians (8.3)."""
        if self.angles is None or self.cycles < 2:
            return None
        return 3.0 * self.angles.std(axis=0, ddof=1).max(axis=0)

    @property
    def maximum(self) -> float:
        """Largest distance of a sample from the path, metres."""
        return float(self.deviations.max())

    @property
    def rms(self) -> float:
        """Root mean square distance of the samples from the path, metres."""
        return float(np.sqrt(np.mean(self.deviations**2)))

    def summary(self) -> dict[str, float | int]:
        """What is known of it, in millimetres and degrees."""
        out: dict[str, float | int] = {"cycles": self.cycles, "sections": len(self.sections)}
        out["AT_p_mm"] = self.accuracy * 1e3
        out |= in_degrees("AT", self.orientation_accuracy)
        if self.repeatability is not None:
            out["RT_p_mm"] = self.repeatability * 1e3
        out |= in_degrees("RT", self.orientation_repeatability)
        return out | {"max_mm": self.maximum * 1e3, "rms_mm": self.rms * 1e3}


def assess_path(
    commanded: Float[np.ndarray, "points 3"],
    attained: Float[np.ndarray, "passes samples 3"] | Sequence[Float[np.ndarray, "_ 3"]],
    *,
    commanded_rotations: Float[np.ndarray, "points 3 3"] | None = None,
    rotations: Float[np.ndarray, "passes samples 3 3"] | Sequence[Float[np.ndarray, "_ 3 3"]] | None = None,
) -> PathPerformance:
    """Accuracy and repeatability of a path (ISO 9283:1998, 8.2 and 8.3), and how far its samples lie off.

    Samples may lie anywhere along the path: between them a pass is taken to be straight. At every commanded point it is cut
    with the plane normal to the path. Where it begins or ends a little short of such a plane, by no more than it lies off
    elsewhere, it is carried on along the path. Samples beyond an end of the path do not count as deviations.

    Args:
        commanded: points of the commanded path in order, which are the sections, metres. The path is straight between
            them; repeat the first at the end for a closed path.
        attained: samples of each pass in order, in the same frame, metres; one pass gives no repeatability.
        commanded_rotations: commanded orientation at each point.
        rotations: attained orientation at each sample.

    Raises:
        CampaignError: there is no path or no pass, a number is not finite, two neighbouring points are the same, the path
            turns back on itself, a pass runs against it, or no section is crossed by every pass.
    """
    passes = list(attained)
    _check(commanded, passes)
    tangents = polyline.tangents(commanded)
    if (back := np.flatnonzero(~tangents.any(axis=1))).size:
        raise CampaignError(f"the commanded path turns back on itself at point {back[0]}; give the parts one by one")
    crossings_by_pass: list[polyline.Crossings] = []
    deviations: list[np.ndarray] = []
    for number, samples in enumerate(passes):
        away, off = polyline.distances(samples, commanded)
        if off.all():
            raise CampaignError(f"pass {number} lies beyond the ends of the commanded path; are both in one frame?")
        deviations.append(away[~off])
        between, beyond = polyline.distances(0.5 * (samples[:-1] + samples[1:]), commanded)
        farthest = max(float(away[~off].max()), float(between[~beyond].max(initial=0.0)))
        within = _CORNER * farthest + _ROUNDING
        ends = [samples[0] - within * tangents[0], samples[-1] + within * tangents[-1]]
        carried_on = np.vstack([ends[:1], samples, ends[1:]])
        crossings = polyline.cross_planes(carried_on, commanded, tangents, within)
        if not ((crossings.segments > 0) & (crossings.segments < len(samples))).any():
            raise CampaignError(f"pass {number} crosses no plane normal to the path; does it run in the path's sense?")
        crossings_by_pass.append(crossings)
    crossed = np.bincount(np.concatenate([c.planes for c in crossings_by_pass]), minlength=len(commanded))
    sections = np.flatnonzero(crossed == len(passes))
    if not len(sections):
        raise CampaignError("no plane normal to the commanded path is crossed by every pass; give passes of one path")
    chosen = [np.searchsorted(c.planes, sections) for c in crossings_by_pass]
    points = np.stack([c.points[rows] for c, rows in zip(crossings_by_pass, chosen, strict=True)])
    angles = turn = None
    if rotations is not None and commanded_rotations is not None:
        turned = [_turned(R, c, rows) for R, c, rows in zip(rotations, crossings_by_pass, chosen, strict=True)]
        mean, angles = mean_orientation(np.stack(turned))
        turn = se3.log(mean @ np.swapaxes(commanded_rotations[sections], 1, 2))
    return PathPerformance(
        sections=sections,
        left_out=np.flatnonzero(crossed < len(passes)),
        offsets=points - commanded[sections],
        angles=angles,
        turn=turn,
        deviations=np.concatenate(deviations),
    )


def _check(commanded: Float[np.ndarray, "points 3"], passes: Sequence[Float[np.ndarray, "_ 3"]]) -> None:
    if len(commanded) < 2:
        raise CampaignError(f"a commanded path needs two points or more, not {len(commanded)}")
    if not passes:
        raise CampaignError("there is no pass along the path")
    if not np.isfinite(commanded).all():
        raise CampaignError("a point of the commanded path is not a number")
    same = np.flatnonzero((np.diff(commanded, axis=0) == 0.0).all(axis=1))
    if len(same):
        raise CampaignError(f"points {same[0]} and {same[0] + 1} of the commanded path are the same; leave one out")
    for number, samples in enumerate(passes):
        if len(samples) < 2:
            raise CampaignError(f"pass {number} has {len(samples)} samples; it needs two or more")
        if not np.isfinite(samples).all():
            raise CampaignError(f"a sample of pass {number} is not a number; leave it out")


def _turned(
    rotations: Float[np.ndarray, "samples 3 3"], crossings: polyline.Crossings, rows: Int[np.ndarray, " sections"]
) -> Float[np.ndarray, "sections 3 3"]:
    """Orientations of a pass at its crossings, turning evenly between samples."""
    last = len(rotations) - 1
    after = crossings.segments[rows]  # one more than the number of the sample before, as the pass was carried on
    before, after = rotations[np.clip(after - 1, 0, last)], rotations[np.clip(after, 0, last)]
    step = se3.log(np.swapaxes(before, 1, 2) @ after)
    return before @ se3.exp(crossings.fractions[rows, None] * step)
