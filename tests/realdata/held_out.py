"""What `--effects auto` predicts on measured robots: ``python -m tests.realdata.held_out [CASE …]``.

An experiment of many minutes, not a test. Prints for each case the mean error of held-out rows, with frames alone, by
geometry and with all effects, the share of their points inside the stated 95 % regions, and the processor time of one calibration;
of the splits 0 to 9, or of every pose of the FANUC.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import chdtri

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.calibration import Calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.robot.error_model import ErrorModel
from tests.conftest import DATA
from tests.realdata.test_effects import campaign_of, model_of


@dataclass(frozen=True)
class Case:
    """Rows of a robot that are fitted."""

    robot: str
    rows: float
    """So many, or this share; all but one pose where 0."""
    splits: int = 10


CASES = {
    "ur5-60": Case("ur5", 60),
    "ur5-700": Case("ur5", 700),
    "ur10": Case("ur10", 0.7, 3),
    "irb120-60": Case("abb-irb120", 60),
    "irb120-430": Case("abb-irb120", 430),
    "fanuc": Case("fanuc-r2000ic-165f", 0, 36),
    "wam": Case("barrett-wam", 0.7),
}


def parts(case: Case, campaign: Campaign) -> Iterator[tuple[Campaign, Campaign]]:
    """Fitted and held-out rows."""
    n = len(campaign)
    count = round(case.rows * n) if case.rows < 1 else int(case.rows)
    for seed in range(case.splits):
        order = np.random.default_rng(seed).permutation(n) if case.rows else np.roll(np.arange(n), -seed - 1)
        count = count or n - 1
        yield campaign.take(np.sort(order[:count]) if not case.rows else order[:count]), campaign.take(order[count:])


def lengths(calibration: Calibration, unseen: Campaign) -> np.ndarray:
    """Lengths of the errors, millimetres."""
    return np.linalg.norm(calibration.residuals_on(unseen)[unseen.valid][:, :3], axis=1) * 1e3


def judged(calibration: Calibration, unseen: Campaign) -> tuple[np.ndarray, np.ndarray]:
    """Lengths of the errors, millimetres, and whether each is inside its region."""
    at = unseen.valid
    error = calibration.residuals_on(unseen)[at][:, :3]
    C = calibration.predict_covariance(unseen.q, unseen.conditions)[..., :3, :3] + unseen.covariances()[..., :3, :3]
    square = np.einsum("ni,ni->n", error, np.linalg.solve(C[at], error[..., None])[..., 0])
    return lengths(calibration, unseen), square < chdtri(3.0, 0.05)


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A case: mean errors in space of each split, mm, or of all poses where each is held out in turn; and what goes with them."""

    splits: int
    frames: list[float]
    geometry: list[float]
    auto: list[float]
    inside: list[float]
    """Share of the points inside their regions."""
    seconds: list[float]


def measured(data: Path, name: str) -> Measured:
    """One case, measured again."""
    case = CASES[name]
    campaign, model = campaign_of(data, case.robot), model_of(case.robot, ())
    results = [_results(model, *both) for both in parts(case, campaign)]
    *errors, inside, seconds = (list(column) for column in zip(*results, strict=True))
    if not case.rows:  # every pose once: one mean of all
        errors = [[np.concatenate(some)] for some in errors]
    frames, geometry, auto = ([float(np.mean(some)) for some in of_fit] for of_fit in errors)
    shares = [float(np.mean(some)) for some in inside]
    return Measured(splits=len(results), frames=frames, geometry=geometry, auto=auto, inside=shares, seconds=seconds)


def measure(name: str) -> str:
    """A line of the table."""
    one = measured(DATA, name)
    return (
        f"{name:12} {one.splits:3d} {np.median(one.frames):8.4f} {np.median(one.geometry):8.4f} "
        f"{np.median(one.auto):8.4f} {min(one.auto):8.4f} {max(one.auto):8.4f} "
        f"{np.mean(one.inside):7.3f} {min(one.inside):6.3f} {max(one.inside):6.3f} {np.median(one.seconds):7.1f}"
    )


def _results(
    model: ErrorModel, fitted: Campaign, unseen: Campaign
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    start = time.process_time()
    auto = explain(model, fitted).calibration
    seconds = time.process_time() - start
    frames, geometry = (lengths(identify(model, fitted, keep=keep), unseen) for keep in ([], None))
    return frames, geometry, *judged(auto, unseen), seconds


def main(names: Sequence[str]) -> None:
    """Print a line for each case."""
    print(
        "case, splits, mm with frames alone, by geometry, by all effects (median, least, most), "
        "inside (mean, least, most), CPU seconds"
    )
    for name in names or CASES:
        print(measure(name), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
