"""Campaigns of one robot, put together: what a tracker saw, and then what a ball in sockets said."""

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
from jaxtyping import Float

from taskcal.errors import CampaignError
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.observation import Point, Pose
from taskcal.measurement.observation.observation import Observation
from taskcal.robot.conditions import Conditions


def join(campaigns: Sequence[Campaign]) -> Campaign:
    """One campaign of the rows of several, one after another; in the rows of one, the targets of the others were not seen.

    Raises:
        CampaignError: none is given, two have a target of one name, two measure rotations, or some state how sure they are
            and others do not.
    """
    if len(campaigns) < 2:
        if not campaigns:
            raise CampaignError("there is no campaign to join")
        return campaigns[0]
    names = [name for one in campaigns for name in one.targets]
    for name in names:
        if names.count(name) > 1:
            raise CampaignError(f"two of the campaigns have a target '{name}'; rename one of them")
    if sum(one.rotations is not None for one in campaigns) > 1:
        raise CampaignError("two of the campaigns measure rotations; one campaign can hold those of one")
    if len({one.uncertainty is None for one in campaigns}) > 1:
        raise CampaignError("some of the campaigns state uncertainties (u_mm) and others do not; state all or none")
    first = np.cumsum([0, *map(len, campaigns)])
    return Campaign(
        ids=tuple(str(number) for number in range(first[-1])),
        q=np.concatenate([one.q for one in campaigns]),
        targets=tuple(names),
        points=_blocks([one.points for one in campaigns]),
        rotations=_rotations(campaigns),
        observations=tuple(
            _among(kind, int(first[k]), int(first[-1])) for k, one in enumerate(campaigns) for kind in _kinds(one)
        ),
        uncertainty=None if campaigns[0].uncertainty is None else _blocks([_stated(one) for one in campaigns]),
        conditions=_conditions(campaigns),
        source=" and ".join(dict.fromkeys(one.source for one in campaigns if one.source)),
        notes=tuple(dict.fromkeys(note for one in campaigns for note in one.notes)),
    )


def _kinds(campaign: Campaign) -> tuple[Observation, ...]:
    if campaign.observations:
        return campaign.observations
    return tuple(Point() if campaign.rotations is None else Pose() for _ in campaign.targets)


def _among(kind: Observation, first: int, count: int) -> Observation:
    """A kind whose rows stand among others."""
    if kind.of is None:
        return kind
    of = np.full(count, -1)
    of[first : first + len(kind.of)] = kind.of
    return replace(kind, of=of)


def _blocks(parts: list[np.ndarray]) -> np.ndarray:
    """Along the diagonal of rows and targets, NaN beside it."""
    rows, targets = (sum(part.shape[axis] for part in parts) for axis in (0, 1))
    out = np.full((rows, targets, *parts[0].shape[2:]), np.nan)
    row = target = 0
    for part in parts:
        out[row : row + part.shape[0], target : target + part.shape[1]] = part
        row, target = row + part.shape[0], target + part.shape[1]
    return out


def _stated(campaign: Campaign) -> Float[np.ndarray, "n targets"]:
    assert campaign.uncertainty is not None
    return campaign.uncertainty


def _rotations(campaigns: Sequence[Campaign]) -> Float[np.ndarray, "n 3 3"] | None:
    if all(one.rotations is None for one in campaigns):
        return None
    return np.concatenate(
        [np.tile(np.eye(3), (len(one), 1, 1)) if one.rotations is None else one.rotations for one in campaigns]
    )


def _conditions(campaigns: Sequence[Campaign]) -> Conditions:
    """What all of them tell."""
    told: dict[str, np.ndarray] = {}
    for quantity in fields(Conditions):
        values = [getattr(one.conditions, quantity.name) for one in campaigns]
        if all(value is not None for value in values):
            told[quantity.name] = np.concatenate(values)
    return Conditions(**told)
