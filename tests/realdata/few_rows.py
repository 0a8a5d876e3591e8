"""Regions and errors of few rows on measured robots: ``python -m tests.realdata.few_rows [ROBOT …]``.

An experiment of some minutes, not a test. Prints for each robot and number of random rows the mean error of up to 300 other
rows, mm, and the share of their points inside the stated 95 % regions: of geometry alone (20 splits) and of all effects (5 splits).
"""

import sys
from collections.abc import Sequence

import numpy as np

from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from tests.conftest import DATA
from tests.realdata.held_out import judged
from tests.realdata.test_effects import campaign_of, model_of

ROBOTS = "ur5", "abb-irb120", "ur10", "barrett-wam"
ROWS = 15, 20, 30, 60
SPLITS = {"geometry": 20, "effects": 5}
NEW = 300


def measured(robot: str, rows: int, kind: str) -> np.ndarray:
    """Mean error, mm, and share inside, of each split."""
    campaign, model = campaign_of(DATA, robot), model_of(robot, ())
    found: list[tuple[float, float]] = []
    for seed in range(SPLITS[kind]):
        order = np.random.default_rng(seed).permutation(len(campaign))
        fitted, new = campaign.take(np.sort(order[:rows])), campaign.take(order[rows : rows + NEW])
        calibration = identify(model, fitted) if kind == "geometry" else explain(model, fitted).calibration
        lengths, inside = judged(calibration, new)
        found.append((float(lengths.mean()), float(inside.mean())))
    return np.array(found)


def main(robots: Sequence[str]) -> None:
    """Print a line for each robot, number of rows and kind of fit."""
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
