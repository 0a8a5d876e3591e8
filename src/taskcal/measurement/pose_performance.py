"""Accuracy and repeatability of a pose that was approached several times: ISO 9283:1998, clause 7.2."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from taskcal.errors import CampaignError
from taskcal.geometry import se3
from taskcal.short_repr import short_repr


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PosePerformance:
    """How a commanded pose was attained, over cycles in one direction of approach."""

    barycentre: Float[np.ndarray, " 3"]
    """Mean of the attained positions, metres."""
    distances: Float[np.ndarray, " cycles"]
    """Distance l of each attained position from the barycentre, metres."""
    offset: Float[np.ndarray, " 3"] | None
    """Barycentre less commanded position (AP_x, AP_y, AP_z), metres; None without a command."""
    orientation: Float[np.ndarray, "3 3"] | None
    """Mean of the attained orientations; None where positions were measured."""
    angles: Float[np.ndarray, "cycles 3"] | None
    """Rotations from the mean orientation to each attained one, about the frame's axes, radians."""
    turn: Float[np.ndarray, " 3"] | None
    """Rotation from the commanded to the mean orientation about the frame's axes, radians; no Euler angles."""

    @property
    def cycles(self) -> int:
        """How often the pose was measured."""
        return len(self.distances)

    @property
    def accuracy(self) -> float | None:
        """Positioning accuracy AP_p, metres (7.2.1); None without a command."""
        return None if self.offset is None else float(np.linalg.norm(self.offset))

    @property
    def repeatability(self) -> float | None:
        """Positioning repeatability RP_l, metres (7.2.2); None for a single cycle."""
        return float(mean_and_three_deviations(self.distances)) if self.cycles > 1 else None

    @property
    def orientation_repeatability(self) -> Float[np.ndarray, " 3"] | None:
        """Three deviations of each rotation, to be read as ±, radians; the standard's (7.2.2) are of Euler angles."""
        return None if self.angles is None or self.cycles < 2 else 3.0 * self.angles.std(axis=0, ddof=1)

    def summary(self) -> dict[str, float | int]:
        """What is known of it, in millimetres and degrees."""
        out: dict[str, float | int] = {"cycles": self.cycles}
        if self.accuracy is not None and self.offset is not None:
            out["AP_p_mm"] = self.accuracy * 1e3
            out |= {f"AP_{axis}_mm": float(value) * 1e3 for axis, value in zip("xyz", self.offset, strict=True)}
        out |= in_degrees("AP", self.turn)
        if self.repeatability is not None:
            out["RP_l_mm"] = self.repeatability * 1e3
        return out | in_degrees("RP", self.orientation_repeatability)


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class DirectionVariation:
    """How far the mean poses lie apart that one command gives from several directions of approach (7.2.3)."""

    position: float
    """Largest distance between two barycentres (vAP_p), metres."""
    rotation: Float[np.ndarray, " 3"] | None
    """Largest angle between two mean orientations about each axis, radians; None for positions."""

    def summary(self) -> dict[str, float]:
        """The variation in millimetres and degrees."""
        return {"vAP_p_mm": self.position * 1e3} | in_degrees("vAP", self.rotation)


def assess_pose(
    attained: Float[np.ndarray, "cycles 3"],
    commanded: Float[np.ndarray, " 3"] | None = None,
    *,
    rotations: Float[np.ndarray, "cycles 3 3"] | None = None,
    commanded_rotation: Float[np.ndarray, "3 3"] | None = None,
) -> PosePerformance:
    """Accuracy and repeatability of one pose (ISO 9283:1998, 7.2.1 and 7.2.2).

    Instead of the standard's differences of Euler angles a, b, c, orientations are compared by the rotation vector from one to
    the other in the axes of the frame, which depends on no sequence of angles; it is named rx, ry, rz.

    Args:
        attained: measured positions, in the frame of the command, metres.
        commanded: commanded position, metres; without it only the repeatability is known.
        rotations: measured orientations, in the same frame.
        commanded_rotation: commanded orientation.

    Raises:
        CampaignError: there is no cycle, or a measurement is not a number.
    """
    if not len(attained):
        raise CampaignError("a pose needs at least one cycle")
    if not np.isfinite(attained).all():
        cycle = int(np.flatnonzero(~np.isfinite(attained).all(axis=1))[0])
        raise CampaignError(f"the position measured in cycle {cycle} is not a number; leave the cycle out")
    barycentre = attained.mean(axis=0)
    orientation = angles = turn = None
    if rotations is not None:
        orientation, angles = mean_orientation(rotations)
        turn = None if commanded_rotation is None else se3.log(orientation @ commanded_rotation.T)
    return PosePerformance(
        barycentre=barycentre,
        distances=np.linalg.norm(attained - barycentre, axis=1),
        offset=None if commanded is None else barycentre - commanded,
        orientation=orientation,
        angles=angles,
        turn=turn,
    )


def compare_directions(poses: Sequence[PosePerformance]) -> DirectionVariation:
    """Multi-directional pose accuracy variation (ISO 9283:1998, 7.2.3).

    Args:
        poses: one commanded pose, approached from two or more directions.

    Raises:
        CampaignError: there is only one direction.
    """
    if len(poses) < 2:
        raise CampaignError(f"directions of approach are compared with each other; {len(poses)} is too few, give two")
    position = max(float(np.linalg.norm(h.barycentre - k.barycentre)) for h, k in combinations(poses, 2))
    orientations = [pose.orientation for pose in poses if pose.orientation is not None]
    rotation = None
    if len(orientations) == len(poses):
        pairs = [np.abs(se3.log(h @ k.T)) for h, k in combinations(orientations, 2)]
        rotation = np.max(pairs, axis=0)
    return DirectionVariation(position=position, rotation=rotation)


def mean_and_three_deviations(distances: Float[np.ndarray, "cycles ..."]) -> Float[np.ndarray, "..."]:
    """The radius l̄ + 3 S_l of clauses 7.2.2 and 8.3, over the first axis."""
    return np.asarray(distances.mean(axis=0) + 3.0 * distances.std(axis=0, ddof=1))


def mean_orientation(
    rotations: Float[np.ndarray, "cycles *b 3 3"],
) -> tuple[Float[np.ndarray, "*b 3 3"], Float[np.ndarray, "cycles *b 3"]]:
    """The rotation nearest to the mean of the matrices, and the rotation vectors from it to each, radians."""
    mean = se3.nearest_rotation(rotations.mean(axis=0))
    return mean, se3.log(rotations @ np.swapaxes(mean, -1, -2))


def in_degrees(symbol: str, angles: Float[np.ndarray, " 3"] | None) -> dict[str, float]:
    """Rotations about x, y, z for a summary, degrees; nothing where they are not known.

    They are called rx, ry, rz and not a, b, c: those of the standard are differences of Euler angles.
    """
    if angles is None:
        return {}
    return {
        f"{symbol}_{axis}_deg": float(np.degrees(value)) for axis, value in zip(("rx", "ry", "rz"), angles, strict=True)
    }
