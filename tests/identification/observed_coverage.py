"""How often intervals hold, and whether measuring in two ways beats either: ``python -m tests.identification.observed_coverage``.

An experiment of some minutes for each hundred robots, not a test: the virtual IRB 120 with errors of 0.5 mm and 0.5 mrad is
measured in every way, each robot with its own postures, cell and noise. ``--ways`` chooses some, ``--robots`` how many, ``--both``
measures in two ways at once instead, and compares with each of both alone, robot by robot.
"""

from argparse import ArgumentParser
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.planning.study import aligned_errors
from taskcal.virtual.cell import Truth, simulate
from tests.reading.virtual_task import MODEL, postures

TWO_SIDED = 1.959964
"""Standard deviations of a 95 % interval."""

ERRORS = 0.5
"""Of the true robots, as a multiple of the tolerances of a millimetre and a milliradian, which the fit believes in."""


@dataclass(frozen=True)
class Covered:
    """Of one robot."""

    points: float
    """Share of the coordinates of predicted TCPs inside of their interval."""
    alone: float
    """The same without the growth beyond the measured range, which these robots, that the model describes, do not need."""
    parameters: float
    """The same of parameters."""
    stands: float
    """The same of what stands: sockets, anchors, landmarks; NaN where there is nothing."""
    error_mm: float
    """Rms over the task, the frames taught."""


def task_error(calibration: Calibration, truth: Truth, q: np.ndarray) -> float:
    """Rms over postures with the frames taught, millimetres."""
    weights = np.full(len(q), 1.0 / len(q))
    off = aligned_errors(calibration.tool_in_base(q), truth.model.poses(q, truth.x)[:, :3, 3], weights)
    return 1e3 * float(np.sqrt((off**2).sum(axis=1).mean()))


def covered(way: str, seed: int, rows: int) -> Covered:
    """One robot, measured and judged."""
    measured, unseen = postures(rows, seed), postures(60, 100_000 + seed)
    x = ERRORS * MODEL.tolerances * np.random.default_rng((seed, 1)).normal(size=len(MODEL))
    campaign, truth = simulate(MODEL, measured, rng=np.random.default_rng((seed, 2)), x=x, observe=way)
    calibration = identify(MODEL, campaign)
    error = truth.points(unseen) - calibration.predict(unseen)[..., :3]
    deviation, alone = (
        np.sqrt(np.einsum("ntii->nti", one.predict_covariance(unseen)))[..., :3]
        for one in (calibration, replace(calibration, range_growth=0.0))
    )
    layout, deviations = calibration.layout, np.sqrt(np.diag(calibration.z_covariance))
    true = np.array([truth.unknowns.get(name, np.nan) for name in layout.names])
    stands = np.isfinite(true)
    return Covered(
        points=float((np.abs(error) < TWO_SIDED * deviation).mean()),
        alone=float((np.abs(error) < TWO_SIDED * alone).mean()),
        parameters=float((np.abs(calibration.estimate - x) < TWO_SIDED * calibration.standard_errors).mean()),
        stands=float((np.abs(calibration.z - true) < TWO_SIDED * deviations)[stands].mean())
        if stands.any()
        else np.nan,
        error_mm=task_error(calibration, truth, unseen),
    )


def both(ways: str, seed: int, rows: int) -> dict[str, float]:
    """Task error of one robot, measured in each of several ways and in all of them, with as many rows of each."""
    names = ways.split("+")
    measured, unseen = postures(rows * len(names), seed), postures(60, 100_000 + seed)
    x = ERRORS * MODEL.tolerances * np.random.default_rng((seed, 1)).normal(size=len(MODEL))
    campaign, truth = simulate(MODEL, measured, rng=np.random.default_rng((seed, 2)), x=x, observe=ways)
    out = {ways: task_error(identify(MODEL, campaign), truth, unseen)}
    for k, name in enumerate(names):
        part = campaign.take(slice(k * rows, (k + 1) * rows)).of_targets([campaign.targets[k]])
        out[name] = task_error(identify(MODEL, part), truth, unseen)
    return out


def share(values: list[float]) -> str:
    """A mean and its standard error."""
    return f"{np.mean(values):.4f} ± {np.std(values) / np.sqrt(len(values)):.4f}"


def main() -> None:
    """Measure, and print a line for each way."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--ways", default="tracker,socket,wire,camera,board")
    parser.add_argument("--robots", type=int, default=100)
    parser.add_argument("--rows", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="seed of the first robot")
    parser.add_argument("--both", action="store_true", help="compare ways such as tracker+socket with their parts")
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.robots)
    for way in given.ways.split(","):
        start = process_time()
        if given.both:
            found = [both(way, seed, given.rows) for seed in seeds]
            best = min(way.split("+"), key=lambda name: np.mean([one[name] for one in found]))
            gain = np.array([one[best] - one[way] for one in found])
            means = ", ".join(f"{name} {np.median([one[name] for one in found]):.4f}" for name in found[0])
            print(
                f"{way:22} median rms mm: {means}; less than {best} by {gain.mean():.5f} ± "
                f"{gain.std() / np.sqrt(len(gain)):.5f}, in {np.mean(gain > 0):.0%}; {process_time() - start:.0f} s",
                flush=True,
            )
            continue
        all_of = [covered(way, seed, given.rows) for seed in seeds]
        error = np.array([one.error_mm for one in all_of])
        print(
            f"{way:22} points {share([one.points for one in all_of])}  parameters "
            f"{share([one.parameters for one in all_of])}  stands {share([one.stands for one in all_of])}  rms mm "
            f"{np.median(error):.4f} ({np.percentile(error, 5):.4f} to {np.percentile(error, 95):.4f})  "
            f"{process_time() - start:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
