"""Poses against their points alone, error of position where nothing was fitted: ``python -m tests.identification.six_d [FOLDER]``.

An experiment of some minutes, not a test. Forty poses of virtual robots whose wrists err most, by instruments that are more or less
turned; with the folder of the measured robots, forty of the UR10's, drawn anew for each seed. A line for each kind: median over the
seeds of the mean error, by geometry alone and by `explain`, from poses and from their points, and the largest ratio of the two.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.geometry import se3
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.observations.base import TrackerNoise
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance, EncoderGain, Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

ROBOTS = "abb-irb120", "ur5"
POSES, UNSEEN = 40, 300
KINDS = {
    "sound instrument": (0.0, 5e-5),
    "turned instrument": (3e-4, 5e-5),
    "turned and coarse instrument": (3e-4, 2e-4),
}
"""Turn of the rotations that are measured, and noise of each, radians."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Case:
    """Poses to fit, and where to look at the errors."""

    model: ErrorModel
    fitted: Campaign
    unseen: Campaign

    def errors_mm(self, *, auto: bool) -> tuple[float, float]:
        """Mean error of position from poses, and from their points alone."""
        return self._error_mm(self.fitted, auto=auto), self._error_mm(replace(self.fitted, rotations=None), auto=auto)

    def _error_mm(self, fitted: Campaign, *, auto: bool) -> float:
        calibration = explain(self.model, fitted).calibration if auto else identify(self.model, fitted)
        error = calibration.residuals_on(replace(self.unseen, rotations=None))
        return float(np.linalg.norm(error[:, 0], axis=1).mean() * 1e3)


def virtual(name: str, kind: str, seed: int) -> Case:
    """A robot whose wrist errs most, measured by an instrument of a kind; errors are looked at without noise."""
    turn, noise = KINDS[kind]
    rng, model = np.random.default_rng(seed), ErrorModel(load_robot(name))
    limits = 0.9 * np.clip(model.robot.limits, -2.5, 2.5)
    q = rng.uniform(limits[:, 0], limits[:, 1], (POSES + UNSEEN, len(limits)))
    wrist = Harmonics(orders=(1, 2, 3), joints=model.robot.joint_names[3:], tolerance=2e-4, falling=True)
    true = model + wrist + EncoderGain(tolerance=5e-5) + Compliance(tolerance=1e-4)
    targets = {"tool": rng.normal(size=3) * 0.05 + [0.0, 0.0, 0.1]}
    campaign, truth = simulate(true, q, rng=rng, pose=True, targets=targets, noise=TrackerNoise(rotation=noise))
    axis = rng.normal(size=3)
    turned = replace(campaign, rotations=se3.exp(turn * axis / np.linalg.norm(axis)) @ campaign.rotations)
    exact = replace(campaign, points=truth.points(q))
    return Case(model=model, fitted=turned.take(np.arange(POSES)), unseen=exact.take(np.arange(POSES, len(q))))


def measured(folder: Path, seed: int) -> Case:
    """Some of the UR10's poses, and others."""
    model = ErrorModel(load_robot("ur10"))
    campaign = read_campaign(folder / "ur10_tmac" / "measurements.csv", model.robot)
    order = np.random.default_rng(seed).permutation(len(campaign))
    return Case(
        model=model, fitted=campaign.take(order[:POSES]), unseen=campaign.take(order[POSES : POSES + 2 * UNSEEN])
    )


def cases(folder: Path | None, seeds: range) -> Iterator[tuple[str, list[Case]]]:
    """Every kind, and its cases."""
    if folder is not None:
        yield "ur10, measured", [measured(folder, seed) for seed in seeds]
        return
    for name in ROBOTS:
        for kind in KINDS:
            yield f"{name}, {kind}", [virtual(name, kind, seed) for seed in seeds]


def main(arguments: list[str]) -> None:
    """Print a line for each kind, geometry alone first."""
    for kind, drawn in cases(Path(arguments[0]) if arguments else None, range(8)):
        for auto in (False, True):
            errors = np.array([case.errors_mm(auto=auto) for case in drawn])
            poses, points = np.median(errors, axis=0)
            ratio = errors[:, 0] / errors[:, 1]
            print(
                f"{kind}, {'with all effects' if auto else 'geometry alone'}: poses {poses:.4f}, points {points:.4f} mm, "
                f"ratio {np.median(ratio):.2f}, largest {ratio.max():.2f}",
                flush=True,
            )


if __name__ == "__main__":
    main(sys.argv[1:])
