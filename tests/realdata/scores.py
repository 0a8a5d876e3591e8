"""How well is predicted, stored and compared: ``python -m tests.realdata.scores FILE [BEFORE] [--robots NAME …]``.

An experiment of many minutes, not a test. Of measured robots, and of virtual ones whose truth is known, poses are predicted from 60
others: random ones, those at an end of one of the widest joints, and those at which the tool is turned farthest. Keeps for each
split the mean error, the share inside of 95 % regions and the mean log score of a point (Gneiting and Raftery 2007), by geometry
and with all effects. With BEFORE, an earlier FILE of the same splits, prints paired ratios and differences, with their standard
errors over robots: a robot counts once, and a single split scatters by 5 %.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import chdtri

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Effect, Harmonics, JointField
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import draw_defects, simulate
from tests.conftest import DATA
from tests.realdata.test_effects import FOLDERS, campaign_of, model_of

FITTED, PREDICTED, JUDGED = 60, 0.2, 200
"""Rows that are fitted, at most; share of the rows at an end, or turned, that is predicted; and rows that are judged, at most."""

SPLITS, OF_VIRTUAL = (4, 2, 2), (2, 1, 1)
"""Random splits of a robot, its widest joints both of whose ends are left out, and draws of the rows under a turned tool; of one
that is virtual, of which there are more."""

VIRTUAL, POSES, LIMIT = ("abb-irb120", "ur10", "ur5"), 300, 1.5
"""Virtual robots, their poses, and the largest joint position of these, radians."""

PLAIN, GEARS = 12, 9
"""Virtual robots without effects, and with lines of gears above the orders of the spectrum."""

Rows = np.ndarray
Kept = dict[str, Any]
"""What is kept of a split, as in the file."""


def plain(seed: int) -> tuple[ErrorModel, Campaign]:
    """A robot of geometry alone, with white errors of single poses, small errors of no form beside these, or none."""
    white, effect = ((0.0, None), (5e-5, None), (1e-5, JointField(tolerance=1e-5, length=0.7, seed=seed)))[seed % 3]
    return _virtual(seed, [] if effect is None else [effect], white)


def gears(seed: int) -> tuple[ErrorModel, Campaign]:
    """A robot with a line or two of its gears, at no whole orders, beside lower orders and white errors."""
    rng = np.random.default_rng([seed, 1])
    names = load_robot(VIRTUAL[seed % len(VIRTUAL)]).joint_names
    lines = [
        Harmonics(joints=(str(joint),), orders=(round(float(rng.uniform(35.0, 400.0)), 2),), tolerance=1e-4)
        for joint in rng.choice(names[:4], 1 + seed % 2, replace=False)
    ]
    return _virtual(seed, [Harmonics(orders=(1, 2), tolerance=5e-5), *lines], 2e-5)


def _virtual(seed: int, effects: Sequence[Effect], white: float) -> tuple[ErrorModel, Campaign]:
    rng = np.random.default_rng([seed, 2])
    model = ErrorModel(load_robot(VIRTUAL[seed % len(VIRTUAL)]))
    true = ErrorModel(model.robot, effects=tuple(effects))
    limits = np.clip(model.robot.limits, -LIMIT, LIMIT)
    q = rng.uniform(limits[:, 0], limits[:, 1], (POSES, len(limits)))
    return model, simulate(true, q, rng=rng, x=draw_defects(true, rng), model_error=white)[0]


def robots() -> Iterator[str]:
    """Names of all robots."""
    yield from FOLDERS
    yield from (f"plain {seed}" for seed in range(PLAIN))
    yield from (f"gears {seed}" for seed in range(GEARS))


def campaign_named(name: str) -> tuple[ErrorModel, Campaign]:
    """Model of the geometry, and the measurements."""
    kind, _, seed = name.partition(" ")
    if seed:
        return (plain if kind == "plain" else gears)(int(seed))
    campaign = campaign_of(DATA, name)
    return model_of(name, ()), campaign.take(np.flatnonzero(campaign.seen))


def splits(model: ErrorModel, campaign: Campaign, counts: tuple[int, int, int]) -> Iterator[tuple[str, Rows, Rows]]:
    """Class of each split, with the rows that are fitted and predicted; so many of each class."""
    seeds, joints, turned = counts
    n, rng = len(campaign), np.random.default_rng(0)
    few = min(FITTED, n - max(round(PREDICTED * n), 1))
    for seed in range(seeds):
        order = np.random.default_rng(seed).permutation(n)
        yield "random", np.sort(order[:few]), order[few:][:JUDGED]
    ranked: list[tuple[str, np.ndarray]] = []
    for j in np.argsort(-np.std(campaign.q, axis=0))[:joints]:
        ranked += [("end", sign * campaign.q[:, j]) for sign in (-1.0, 1.0)]
    R = model.robot.tool_poses(campaign.q)[:, :3, :3]
    away = -np.einsum("ij,nij->n", se3.nearest_rotation(R.mean(axis=0)), R)  # falls as the cosine of the angle
    ranked += [("turned", away)] * turned
    for kind, along in ranked:
        order = np.argsort(along, kind="stable")
        inside, beyond = order[: round((1.0 - PREDICTED) * n)], order[round((1.0 - PREDICTED) * n) :]
        yield kind, np.sort(rng.permutation(inside)[:few]), rng.permutation(beyond)[:JUDGED]


@dataclass(frozen=True, kw_only=True)
class Score:
    """Of a fit, at poses that it has not seen."""

    error: float
    """Mean, mm."""
    inside: float
    """Share of the measured points in their 95 % regions."""
    log: float
    """Mean log density of a point, which is measured in mm."""


def score(fit: Calibration, unseen: Campaign) -> Score:
    """Of a fit."""
    at = unseen.valid
    error = fit.residuals_on(unseen)[at][:, :3]
    C = (fit.predict_covariance(unseen.q, unseen.conditions) + unseen.covariances())[..., :3, :3][at]
    square = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
    log = -0.5 * (square + np.linalg.slogdet(2.0 * np.pi * 1e6 * C)[1])
    return Score(
        error=1e3 * float(np.linalg.norm(error, axis=1).mean()),
        inside=float((square < chdtri(3.0, 0.05)).mean()),
        log=float(log.mean()),
    )


def measured(name: str) -> Iterator[Kept]:
    """What is kept of each split of a robot."""
    model, campaign = campaign_named(name)
    counts = SPLITS if name in FOLDERS else OF_VIRTUAL
    for number, (kind, rows, beyond) in enumerate(splits(model, campaign, counts)):
        fitted, unseen = campaign.take(rows), campaign.take(beyond)
        start = time.process_time()
        geometry = identify(model, fitted)
        between = time.process_time()
        found = explain(model, fitted)
        end = time.process_time()
        yield {
            "split": f"{name}, {kind}, {number}",
            "robot": name,
            "class": kind,
            "geometry": asdict(score(geometry, unseen)) | {"seconds": between - start},
            "auto": asdict(score(found.calibration, unseen)) | {"seconds": end - between},
            "kept": len(found.calibration.kept) > len(geometry.kept),
            "proven": [effect.name for effect in found.effects],
        }


def _over_robots(values: Mapping[str, Sequence[float]]) -> str:
    """Mean over robots of the means of their splits, with its standard error."""
    means = np.array([np.mean(own) for own in values.values()])
    return f"{means.mean():7.3f} ({means.std(ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.nan:.3f})"


def _sort(robot: str) -> str:
    return robot.partition(" ")[0] if " " in robot else "measured"


def described(now: Sequence[Kept], before: Sequence[Kept]) -> Iterator[str]:
    """Lines of a table, of measured robots and of each kind of virtual ones."""
    earlier = {one["split"]: one for one in before}
    for sort in ("measured", "plain", "gears"):
        for kind in ("random", "end", "turned"):
            some = [one for one in now if one["class"] == kind and _sort(one["robot"]) == sort]
            some = [one for one in some if not earlier or one["split"] in earlier]
            if some:
                ratio = [one["auto"]["error"] / one["geometry"]["error"] for one in some]
                kept, proven = sum(one["kept"] for one in some), sum(bool(one["proven"]) for one in some)
                yield (
                    f"{sort} {kind}, {len(some)} splits: auto over geometry {np.mean(ratio):.3f}, most {max(ratio):.3f}; more than "
                    f"geometry kept {kept}, with something proven {proven}"
                )
                yield from (f"  {of:9}{_scores(of, some)}{_against(of, some, earlier)}" for of in ("geometry", "auto"))


def _scores(of: str, some: Sequence[Kept]) -> str:
    shares, seconds = ([one[of][key] for one in some] for key in ("inside", "seconds"))
    return f" inside {np.mean(shares):.3f}, least {min(shares):.3f}; {np.mean(seconds):.2f} s"


def _against(of: str, some: Sequence[Kept], earlier: Mapping[str, Kept]) -> str:
    if not earlier:
        return ""
    errors: dict[str, list[float]] = {}
    logs: dict[str, list[float]] = {}
    for one in some:
        new, old = one[of], earlier[one["split"]][of]
        errors.setdefault(one["robot"], []).append(new["error"] / old["error"])
        logs.setdefault(one["robot"], []).append(new["log"] - old["log"])
    worst = max(errors, key=lambda robot: float(np.mean(errors[robot])))
    return (
        f"; before{_scores(of, [earlier[one['split']] for one in some])}; error × {_over_robots(errors)}, worst {worst} "
        f"{np.mean(errors[worst]):.3f}; log score + {_over_robots(logs)}"
    )


def main(arguments: Sequence[str]) -> None:
    """Measure what is not in the file yet, and print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    parser.add_argument("before", type=Path, nargs="?")
    parser.add_argument("--robots", nargs="*", default=list(robots()))
    chosen = parser.parse_args(arguments)
    now = json.loads(chosen.file.read_text()) if chosen.file.exists() else []
    for name in chosen.robots:
        if any(one["robot"] == name for one in now):
            continue
        now += measured(name)
        chosen.file.write_text(json.dumps(now, indent=1))
    before = json.loads(chosen.before.read_text()) if chosen.before else []
    for line in described([one for one in now if one["robot"] in chosen.robots], before):
        print(line)


if __name__ == "__main__":
    main(sys.argv[1:])
