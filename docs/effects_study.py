"""Measure anew how often effects are found on a robot that bends: ``python docs/effects_study.py FILE --draws 100``.

Every draw has its own robot, poses and noise; it takes some five seconds on an idle core. Draws that FILE has are not repeated.
"""

import argparse
import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from taskcal import Calibration, Campaign, ErrorModel, explain, identify, load_robot, reach_task
from taskcal.demo import GEARS, ROBOT, elastic_model, reference_task, try_models
from taskcal.estimation import single_threaded

MEASURED, NEW = 60, 100
AS_GOOD = 1.25
"""Largest mean error on new poses, as a multiple of that of the fit which was told everything."""

GEOMETRY = ErrorModel(load_robot(ROBOT))
TRUTHS = {"nothing": GEOMETRY, "gears": GEOMETRY + GEARS, "all": elastic_model(GEOMETRY.robot)}
EXPECTED = GEOMETRY + GEARS


def searched(model: ErrorModel, campaign: Campaign) -> Calibration:
    """The calibration with all effects, or with geometry alone where it predicts as well."""
    return explain(model, campaign).calibration


@single_threaded
def draw(truth: str, spread_deg: float, seed: int) -> list[dict[str, Any]]:
    """One robot, all ways to identify it."""
    task = reference_task(np.radians(spread_deg))
    fits = {
        "told": partial(identify, TRUTHS[truth]),
        "geometry": partial(identify, GEOMETRY),
        "auto": partial(searched, GEOMETRY),
        "gears expected": partial(searched, EXPECTED),
    }
    trials = try_models(
        TRUTHS[truth],
        fits,
        reach_task(GEOMETRY, task, MEASURED, seed=1000 + seed).q,
        reach_task(GEOMETRY, task, NEW, seed=100_000 + seed).q,
        rng=np.random.default_rng(seed),
    )
    return [
        {
            "truth": truth,
            "spread_deg": spread_deg,
            "seed": seed,
            "model": left.model,
            "mean_mm": 1e3 * left.new.mean,
            "inside": left.inside,
            "residual_mm": 1e3 * left.residual.maximum,
            "effects": [type(effect).__name__ for effect in left.calibration.model.effects],
        }
        for left in trials
    ]


def summary(rows: list[dict[str, Any]]) -> None:
    """Print the table."""
    print("truth, spread, model, draws, effects taken, as good, worst ratio, median of the mean error in mm, inside")
    told = {(r["truth"], r["spread_deg"], r["seed"]): r for r in rows if r["model"] == "told"}
    for key in dict.fromkeys((r["truth"], r["spread_deg"], r["model"]) for r in rows):
        own = [r for r in rows if (r["truth"], r["spread_deg"], r["model"]) == key]
        ratio = np.array([r["mean_mm"] / told[r["truth"], r["spread_deg"], r["seed"]]["mean_mm"] for r in own])
        given = {"auto": 0, "gears expected": len(EXPECTED.effects)}.get(key[2], np.inf)
        taken = sum(len(r["effects"]) > given for r in own)
        print(
            f"{key[0]:8} ±{key[1]:<3g} {key[2]:16} {len(own):4d} {taken:4d} {int((ratio <= AS_GOOD).sum()):4d} "
            f"{ratio.max():6.2f} {np.median([r['mean_mm'] for r in own]):8.4f} {np.mean([r['inside'] for r in own]):.3f}"
        )


def main() -> None:
    """Draw, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--truths", default="all,nothing,gears")
    parser.add_argument("--spreads", default="20,0", help="of the tool's orientation, degrees")
    given = parser.parse_args()
    rows = [json.loads(line) for line in given.file.read_text().splitlines()] if given.file.exists() else []
    done = {(r["truth"], r["spread_deg"], r["seed"]) for r in rows}
    with given.file.open("a") as file:
        for truth in given.truths.split(","):
            for spread in map(float, given.spreads.split(",")):
                for seed in range(given.draws):
                    if (truth, spread, seed) in done:
                        continue
                    new = draw(truth, spread, seed)
                    file.write("".join(json.dumps(row) + "\n" for row in new))
                    file.flush()
                    rows += new
    summary(rows)


if __name__ == "__main__":
    main()
