"""Mistakes in some rows of measured campaigns, and what they do: ``python -m tests.realdata.mistakes [CASE …]``.

An experiment of some minutes, not a test. Rows are drawn at random from measured robots, some of them are spoilt, and each line
says of ten campaigns how many of the visible mistakes were named (left out or listed as outliers; all, where the campaign was
refused) and left out; how many sound rows were, a campaign; and how far predictions of 200 other rows move from those of the same
rows without mistakes, beside how far they move where exactly the spoilt rows are left out.

A mistake is visible from 0.6 mm on the UR5 on, and from as many model errors on others; points are off by 0.8 to 5 times that
(0.5 to 3 mm on the UR5).
"""

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import ClosureError, TaskcalError
from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.conftest import DATA
from tests.realdata.test_effects import FOLDERS

CAMPAIGNS, HELD_OUT = 10, 200

VISIBLE_SIGMAS = 10.0
"""Model errors per axis: 0.6 mm on the UR5, whose model error is 0.06 mm."""

Spoil = Callable[[Campaign, int, float, np.random.Generator], tuple[np.ndarray, np.ndarray]]
"""Joints and points of a row with a mistake, from a campaign, the row and what is visible, metres."""


def _measured(name: str, targets: Sequence[str]) -> tuple[ErrorModel, Campaign]:
    robot = load_robot(name)
    return ErrorModel(robot), read_campaign(DATA / FOLDERS[name] / "measurements.csv", robot, targets=targets or None)


def _sockets() -> tuple[ErrorModel, Campaign]:
    folder = DATA / "panda_sockets"
    model = ErrorModel(load_robot(folder / "nominal.urdf"))
    with tempfile.TemporaryDirectory() as place:
        stated = Path(place) / "distances.csv"
        stated.write_text("socket_a,socket_b,distance_mm\n0,1,50.0\n", encoding="utf-8")
        return model, read_campaign(folder / "measurements.csv", model.robot, options=ReadOptions(distances=stated))


def _virtual() -> tuple[ErrorModel, Campaign]:
    """An IRB 6660 whose poses err by what single ones of measured robots do: t-distributed, 0.06 mm per axis."""
    model, rng = ErrorModel(load_robot("abb-irb6660-205-1.9")), np.random.default_rng(7)
    q = rng.uniform(-1.0, 1.0, (600, 6)) * [1.0, 0.4, 0.4, 1.0, 1.0, 2.0]
    campaign, _ = simulate(model, q, rng=rng)
    return model, replace(campaign, points=campaign.points + 6e-5 * rng.standard_t(5.0, campaign.points.shape))


@dataclass(frozen=True)
class Case:
    """Campaigns of so many rows of a robot."""

    load: Callable[[], tuple[ErrorModel, Campaign]]
    rows: int
    counts: tuple[int, ...] = (1, 2, 6)
    mistakes: tuple[str, ...] = ("points", "gross points", "typed joints")


_ur5 = cache(lambda: _measured("ur5", ()))
CASES = {
    "ur5-60": Case(_ur5, 60),
    "ur5-30": Case(_ur5, 30, (1, 3)),
    "ur5-15": Case(_ur5, 15, (1,)),
    "irb120-60": Case(cache(lambda: _measured("abb-irb120", ("smr1",))), 60),
    "irb120-3x40": Case(cache(lambda: _measured("abb-irb120", ("smr1", "smr2", "smr3"))), 40, (1, 4)),
    "ur10-60": Case(cache(lambda: _measured("ur10", ())), 60),
    "panda-120": Case(cache(_sockets), 120, (1, 6), ("typed joints",)),
    "irb6660-60": Case(cache(_virtual), 60),
}


def _shifted(least: float, most: float) -> Spoil:
    def spoil(campaign: Campaign, row: int, visible: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        way, points = rng.normal(size=3), campaign.points[row].copy()
        points[rng.integers(len(points))] += way / np.linalg.norm(way) * visible * rng.uniform(least, most)
        return campaign.q[row], points

    return spoil


def _typed(campaign: Campaign, row: int, visible: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A joint as somebody wrote it down: a digit wrong, two digits swapped, or another sign; no more than a turn and a half."""
    q, joint = campaign.q[row].copy(), rng.integers(campaign.q.shape[1])
    text = list(f"{np.degrees(q[joint]):.3f}")
    places = [i for i, c in enumerate(text) if c.isdigit()]
    kind, at = rng.integers(3), rng.integers(len(places) - 1)
    if kind == 0:
        text[places[at]] = str((int(text[places[at]]) + rng.integers(1, 10)) % 10)
    elif kind == 1:
        a, b = places[at : at + 2]
        text[a], text[b] = text[b], text[a]
    else:
        text = text[1:] if text[0] == "-" else ["-", *text]
    q[joint] = np.radians(float("".join(text)))
    return (q, campaign.points[row]) if abs(q[joint]) < 3.0 * np.pi else _typed(campaign, row, visible, rng)


MISTAKES: dict[str, Spoil] = {
    "points": _shifted(0.8, 5.0),
    "gross points": _shifted(17.0, 330.0),
    "typed joints": _typed,
}


def _spoilt(
    model: ErrorModel, campaign: Campaign, spoil: Spoil, rows: np.ndarray, visible: float, rng: np.random.Generator
) -> Campaign:
    q, points = campaign.q.copy(), campaign.points.copy()
    for row in rows:
        while True:
            q[row], points[row] = spoil(campaign, int(row), visible, rng)
            with suppress(ClosureError):  # of a parallelogram, which would be refused
                model.poses(q[[row]])
                break
    return replace(campaign, q=q, points=points)


def _visible(right: Calibration, sound: Campaign, spoilt: Campaign, rows: np.ndarray) -> set[int]:
    """Rows whose residual changed by more than is visible."""
    change = np.nan_to_num(right.residuals_on(spoilt) - right.residuals_on(sound))
    size = np.linalg.norm(change.reshape(*change.shape[:2], -1, 3), axis=3).max(axis=1) / np.array(right.model_error)
    return {int(row) for row in rows if size[row].max() >= VISIBLE_SIGMAS}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Of one campaign."""

    refused: bool
    visible: int
    named: int
    left_out: int
    innocent: int
    innocent_left_out: int
    shift: float
    best: float
    seconds: float


def _try_one(model: ErrorModel, whole: Campaign, case: Case, spoil: Spoil, count: int, seed: int) -> Outcome:
    order = np.random.default_rng(seed).permutation(len(whole))
    sound = whole.take(np.sort(order[: case.rows]))
    others = whole.take(np.sort(order[case.rows : case.rows + HELD_OUT]))
    right = identify(model, sound)
    rng = np.random.default_rng([seed, count])
    rows = rng.choice(case.rows, count, replace=False)
    spoilt = _spoilt(model, sound, spoil, rows, VISIBLE_SIGMAS * right.model_error[0], rng) if count else sound
    visible = {sound.row_of(i) for i in _visible(right, sound, spoilt, rows)}
    wrong = {sound.row_of(int(i)) for i in rows}

    def shift(calibration: Calibration) -> float:
        moved = (calibration.residuals_on(others) - right.residuals_on(others))[..., :3]
        return float(np.nanmean(np.linalg.norm(moved, axis=2))) * 1e3

    start = time.perf_counter()
    try:
        found = identify(model, spoilt)
    except TaskcalError:
        every = len(visible)
        seconds = time.perf_counter() - start
        return Outcome(refused=True, visible=every, named=every, left_out=0, innocent=0, innocent_left_out=0,
                       shift=np.nan, best=np.nan, seconds=seconds)  # fmt: skip
    seconds = time.perf_counter() - start
    out = {one.row for one in found.left_out}
    named = out | {one.row for one in found.outliers}
    mask = np.zeros(case.rows, dtype=bool)
    mask[rows] = True
    return Outcome(
        refused=False,
        visible=len(visible),
        named=len(named & visible),
        left_out=len(out & visible),
        innocent=len(named - wrong),
        innocent_left_out=len(out - wrong),
        shift=shift(found),
        best=shift(identify(model, sound.without(mask), gross_errors="keep")),
        seconds=seconds,
    )


def measure(name: str) -> None:
    """Print the lines of a case."""
    case = CASES[name]
    model, whole = case.load()
    for mistake, count in [("none", 0), *((mistake, count) for mistake in case.mistakes for count in case.counts)]:
        spoil = MISTAKES.get(mistake, _typed)
        found = [_try_one(model, whole, case, spoil, count, seed) for seed in range(CAMPAIGNS)]
        visible = sum(one.visible for one in found)
        shifts = [one.shift for one in found if not one.refused] or [np.nan]
        best = [one.best for one in found if not one.refused] or [np.nan]
        print(
            f"{name:12} {mistake:13} {count:2d} | {sum(one.named for one in found):3d} {sum(one.left_out for one in found):3d} of "
            f"{visible:3d} | {np.mean([one.innocent for one in found]):5.2f} "
            f"{np.mean([one.innocent_left_out for one in found]):5.2f} | {np.median(shifts):6.3f} {max(shifts):7.3f} "
            f"{np.median(best):6.3f} {max(best):6.3f} | {sum(one.refused for one in found):2d} | "
            f"{1e3 * np.median([one.seconds for one in found]):6.1f}",
            flush=True,
        )


def main(names: Sequence[str]) -> None:
    """Print the lines of some cases, or of all."""
    print(
        "case, mistake, rows | named, left out of visible | sound rows named, left out, a campaign | shift of predictions, mm: "
        "median, most; of the right rows alone | refused | ms"
    )
    for name in names or CASES:
        measure(name)


if __name__ == "__main__":
    main(sys.argv[1:])
