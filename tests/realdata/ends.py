"""What is predicted beyond the measured range: ``python -m tests.realdata.ends [ROBOT …]``.

An experiment of minutes, not a test. Of each measured robot and of each of its three widest joints, the poses at one end are
predicted from 60 others, which reach up to there, or, *narrow*, hold the joint in the middle half of its poses. Prints for each
split the mean error in mm, with frames alone, by geometry and with all effects, and the shares inside the stated 95 % regions.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.robot.error_model import ErrorModel
from tests.conftest import DATA
from tests.realdata.held_out import judged, lengths
from tests.realdata.test_effects import FOLDERS, campaign_of, model_of

WIDEST, FITTED = 3, 60
"""Joints of a robot whose ends are left out, and rows that are fitted."""

END = 0.2
"""Share of the poses that is predicted."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Split:
    """Rows that are fitted, and others beyond them."""

    name: str
    fitted: Campaign
    unseen: Campaign


def splits(robot: str, campaign: Campaign) -> Iterator[Split]:
    """Both ends of the widest joints, each beyond nearly all other poses, and beyond the middle half of these."""
    campaign = campaign.take(np.flatnonzero(campaign.seen))
    rng = np.random.default_rng(0)
    for j in np.argsort(-np.std(campaign.q, axis=0))[:WIDEST]:
        for sign in (-1.0, 1.0):
            along = sign * campaign.q[:, j]
            rank = np.argsort(np.argsort(along, kind="stable"), kind="stable") / len(along)
            for kind, inside in (("end", rank < 1.0 - END), ("narrow", np.abs(rank - 0.5) < 0.25)):
                rows = rng.permutation(np.flatnonzero(inside))[:FITTED]
                yield Split(
                    name=f"{robot} J{j + 1}{'+' if sign > 0.0 else '-'} {kind}",
                    fitted=campaign.take(np.sort(rows)),
                    unseen=campaign.take(np.flatnonzero(rank >= 1.0 - END)),
                )


@dataclass(frozen=True, kw_only=True)
class Ends:
    """Mean errors in mm, and shares inside the regions."""

    frames: float
    geometry: float
    auto: float
    inside_geometry: float
    inside: float


def measured(model: ErrorModel, split: Split) -> Ends:
    """One split."""
    geometry, auto = identify(model, split.fitted), explain(model, split.fitted).calibration
    errors, inside = zip(*(judged(fit, split.unseen) for fit in (geometry, auto)), strict=True)
    return Ends(
        frames=float(lengths(identify(model, split.fitted, keep=[]), split.unseen).mean()),
        geometry=float(errors[0].mean()),
        auto=float(errors[1].mean()),
        inside_geometry=float(inside[0].mean()),
        inside=float(inside[1].mean()),
    )


def main(robots: Sequence[str]) -> None:
    """Print a line for each split, and what they come to."""
    print("split, mm with frames alone, by geometry, with all effects, ratio of these; inside: geometry, all effects")
    found: dict[str, list[Ends]] = {"end": [], "narrow": []}
    for robot in robots or FOLDERS:
        for split in splits(robot, campaign_of(DATA, robot)):
            try:
                one = measured(model_of(robot, ()), split)
            except Exception as error:  # a split may hold too little, which is said
                print(f"{split.name:36} {error}", flush=True)
                continue
            found[split.name.rpartition(" ")[2]].append(one)
            print(
                f"{split.name:36} {one.frames:8.4f} {one.geometry:8.4f} {one.auto:8.4f} {one.auto / one.geometry:6.2f} "
                f"{one.inside_geometry:6.3f} {one.inside:6.3f}",
                flush=True,
            )
    for kind, some in found.items():
        for of, shares in (
            ("geometry", [one.inside_geometry for one in some]),
            ("all effects", [one.inside for one in some]),
        ):
            print(
                f"{kind}, {of}: {np.mean(shares):.3f} inside, {sum(s < 0.8 for s in shares)} of {len(shares)} under 0.8"
            )
        ratios = [one.auto / one.geometry for one in some]
        print(f"{kind}, error over that of geometry: {np.mean(ratios):.2f}, {np.median(ratios):.2f}, {max(ratios):.2f}")


if __name__ == "__main__":
    main(sys.argv[1:])
