"""Regions and errors of few rows: ``python -m tests.realdata.few_rows [ROBOT …]``, or ``siblings [geometry|effects …]`` for them.

An experiment of some minutes, not a test. Prints for each robot and number of random rows the mean error of up to 300 other
rows, mm, and the share of their points inside the stated 95 % regions: of geometry alone (20 splits) and of all effects (5 splits).

No two robots of one make were measured. ``siblings`` therefore draws robots of the sizes that were found on the measured UR5, and
calibrates them from 15 rows without a sibling, with one of the same sizes (60 rows), and with the measured UR10 and IRB 120, which
are none; and the measured UR5 itself with these two.
"""

import sys
from collections.abc import Sequence

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.calibration import Calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.observations.base import TrackerNoise
from taskcal.planning.study import VirtualRobots
from taskcal.robot.error_model import ErrorModel
from tests.conftest import DATA
from tests.realdata.held_out import judged
from tests.realdata.test_effects import campaign_of, model_of

ROBOTS = "ur5", "abb-irb120", "ur10", "barrett-wam"
ROWS = 15, 20, 30, 60
SPLITS = {"geometry": 20, "effects": 5}
NEW = 300

SIBLING_ROWS, FULL_ROWS, FEW_ROWS, SIBLING_SEED = 60, 300, 15, 500
DRAWN = {"geometry": 40, "effects": 16}
"""Robots that are drawn."""


def calibrated(model: ErrorModel, rows: Campaign, kind: str, like: Calibration | None = None) -> Calibration:
    """A calibration of one kind."""
    return identify(model, rows, like=like) if kind == "geometry" else explain(model, rows, like=like).calibration


def split(campaign: Campaign, rows: int, seed: int) -> tuple[Campaign, Campaign]:
    """Random rows of a campaign, and others."""
    order = np.random.default_rng(seed).permutation(len(campaign))
    return campaign.take(np.sort(order[:rows])), campaign.take(order[rows : rows + NEW])


def measured(robot: str, rows: int, kind: str) -> np.ndarray:
    """Mean error, mm, and share inside, of each split."""
    campaign, model = campaign_of(DATA, robot), model_of(robot, ())
    found: list[tuple[float, float]] = []
    for seed in range(SPLITS[kind]):
        fitted, new = split(campaign, rows, seed)
        calibration = calibrated(model, fitted, kind)
        lengths, inside = judged(calibration, new)
        found.append((float(lengths.mean()), float(inside.mean())))
    return np.array(found)


def of_siblings(kind: str) -> None:
    """Print a line for each calibration that is called a sibling, of drawn robots and of the measured UR5."""
    campaign, model = campaign_of(DATA, "ur5"), model_of("ur5", ())
    none = {
        robot: calibrated(model_of(robot, ()), split(campaign_of(DATA, robot), SIBLING_ROWS, 0)[0], kind)
        for robot in ("ur10", "abb-irb120")
    }
    robots = VirtualRobots.like(calibrated(model, split(campaign, FULL_ROWS, 0)[0], kind), None)
    noise = TrackerNoise()

    def drawn(seed: int, rows: int) -> tuple[Campaign, Campaign]:
        rng = np.random.default_rng(1000 + seed)
        some, new = split(campaign, rows, seed)
        q = np.concatenate([some.q, new.q])
        both = robots.measure(robots.draw(rng), q, noise, rng)[0]
        return both.take(np.arange(rows)), both.take(np.arange(rows, len(q)))

    true = calibrated(model, drawn(SIBLING_SEED, SIBLING_ROWS)[0], kind)
    likes = {"without": None, "drawn alike": true, **none}
    for name, cases in (
        ("drawn", [drawn(seed, FEW_ROWS) for seed in range(DRAWN[kind])]),
        ("ur5", [split(campaign, FEW_ROWS, seed) for seed in range(SPLITS[kind])]),
    ):
        alone: np.ndarray | None = None
        for sibling, like in likes.items():
            if name == "ur5" and sibling == "drawn alike":
                continue
            fits = [calibrated(model, fitted, kind, like) for fitted, _ in cases]
            both = [judged(fit, new) for fit, (_, new) in zip(fits, cases, strict=True)]
            error, inside = np.array([(lengths.mean(), share.mean()) for lengths, share in both]).T
            alone = error if alone is None else alone
            taken = sum(bool(fit.provenance.options.get("like", {}).get("taken")) for fit in fits)
            print(
                f"{name:6} {kind:9} {len(cases):3d} {sibling:12} taken {taken:3d} {error.mean():8.4f} "
                f"{(error / alone).mean():6.3f} {(error / alone).max():6.3f} {inside.mean():7.3f} {inside.min():6.3f}",
                flush=True,
            )


def main(robots: Sequence[str]) -> None:
    """Print a line for each robot, number of rows and kind of fit; or for each sibling."""
    if robots[:1] == ["siblings"]:
        print(
            "robot, kind, cases, sibling, taken, error mm (mean), over that without (mean, most), inside (mean, least)"
        )
        for kind in robots[1:] or SPLITS:
            of_siblings(kind)
        return
    print("robot, rows, kind, splits, error mm (mean, median), share inside (mean, least, most)")
    for robot in robots or ROBOTS:
        for kind in SPLITS:
            for rows in ROWS:
                error, inside = measured(robot, rows, kind).T
                print(
                    f"{robot:12} {rows:3d} {kind:9} {len(error):3d} {error.mean():8.4f} {np.median(error):8.4f} "
                    f"{inside.mean():7.3f} {inside.min():6.3f} {inside.max():6.3f}",
                    flush=True,
                )


if __name__ == "__main__":
    main(sys.argv[1:])
