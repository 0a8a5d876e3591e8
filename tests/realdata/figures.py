"""Figures of measured robots as pages show them: ``python -m tests.realdata.figures [MAKER …]`` prints them.

Each maker measures and gives parts of pages with the figures rounded to the digits that are shown; a ``*`` stands for words or for
figures that it does not make. ``docs/claims.toml`` names the makers of a claim, and a test holds its words to what they make.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.identification.calibration import Calibration
from taskcal.identification.effects import explain
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import PERIODIC, Backlash, Compliance, Effect, EncoderGain, Harmonics, Overshoot, Settling
from taskcal.robot.error_model import ErrorModel
from tests.conftest import DATA
from tests.realdata.held_out import CASES, Case, lengths, measured, parts
from tests.realdata.model_errors import model_errors
from tests.realdata.test_effects import campaign_of, model_of
from tests.realdata.test_sockets import PLACES, place_of

README, INDEX, VALIDATION, EXPECTED = (
    "README.md",
    "docs/index.md",
    "docs/validation.md",
    "docs/theory/expected-error.md",
)

Figure = tuple[str, str]
"""A page, and a part of it."""


def _means(data: Path, case: Case, effects: Sequence[Effect], keep: Sequence[str] | None = None) -> list[float]:
    """Mean error in space of each split's held-out rows, or of all of them where every pose is held out in turn, mm."""
    campaign, model = campaign_of(data, case.robot), model_of(case.robot, effects)
    errors = [lengths(identify(model, fitted, keep=keep), unseen) for fitted, unseen in parts(case, campaign)]
    return [float(e.mean()) for e in (errors if case.rows else [np.concatenate(errors)])]


@cache
def _geometry(data: Path, name: str, splits: int) -> tuple[list[float], list[float]]:
    """With frames alone, and with all of geometry."""
    case = replace(CASES[name], splits=splits)
    return _means(data, case, (), keep=[]), _means(data, case, ())


def geometry(data: Path) -> Iterator[Figure]:
    """What is left on held-out rows by the nominal robot, registered, and by geometry alone."""
    rows = {
        "ur5-60": ("| UR5 | * | 60 of 1000 |", 2),
        "ur5-700": ("| UR5 | * | 700 of 1000 |", 2),
        "ur10": ("| UR10 | * | 70 % of 1495 |", 2),
        "irb120-60": ("| ABB IRB 120 | * | 60 of 620 |", 2),
        "irb120-430": ("| ABB IRB 120 | * | 430 of 620 |", 2),
        "fanuc": ("| FANUC R-2000iC/165F | * | 35 of 36 |", 2),
        "wam": ("| Barrett WAM, 7 axes | * | 70 % of 216 |", 1),
    }
    for name, (words, digits) in rows.items():
        nominal, fitted = (
            f"{np.median(some):.{digits}f}" for some in _geometry(data, name, 36 if name == "fanuc" else 10)
        )
        yield README, f"{words} {nominal} | {fitted} | *"
        if name == "ur5-60":
            yield INDEX, f"{nominal} mm nominal (registered), {fitted} mm geometry, *"
    for name, words, digits in (
        ("ur5-60", "| UR5 | 60 | 10 |", 3),
        ("ur5-700", "| UR5 | 700 | 10 |", 3),
        ("ur10", "| UR10 | 70 % | 3 |", 3),
        ("irb120-60", "| ABB IRB 120 | 60 | 10 |", 3),
        ("irb120-430", "| ABB IRB 120 | 430 | 10 |", 3),
        ("fanuc", "| FANUC R-2000iC/165F | 35 poses | 36 poses |", 2),
        ("wam", "| Barrett WAM | 151 | 10 |", 2),
    ):
        fitted = _geometry(data, name, CASES[name].splits)[1]
        yield VALIDATION, f"{words} {np.median(fitted):.{digits}f} | *"


def model_error(data: Path) -> Iterator[Figure]:
    """What geometry does not explain of all rows."""
    found = {name: 1e3 * size for name, size in model_errors(data).items()}
    for name, words, digits in (
        ("ur5", "UR5", 3),
        ("fanuc-r2000ic-165f", "FANUC R-2000iC/165F", 3),
        ("ur10", "UR10", 3),
        ("abb-irb120", "ABB IRB 120", 3),
        ("barrett-wam", "Barrett WAM", 2),
    ):
        yield EXPECTED, f"| {words} | {found[name]:.{digits}f} |*"
    sizes = list(found.values())
    yield (
        README,
        (
            f"* {np.median(sizes):.2f} mm per axis (1σ), the median of five measured robots ({min(sizes):.2f} to "
            f"{max(sizes):.2f} mm)"
        ),
    )


def named_effects(data: Path) -> Iterator[Figure]:
    """What is left on held-out rows with effects that are asked for by name, beside geometry alone."""
    gain, order = (EncoderGain(), Compliance()), Harmonics(orders=(1,))
    harmonics, periodic = (Harmonics(), Compliance()), (PERIODIC, Compliance())
    rows: dict[str, tuple[str, int, tuple[tuple[Effect, ...], ...]]] = {
        "ur5-60": ("| UR5 | 60 |", 3, (periodic,)),
        "ur5-700": ("| UR5 | 700 |", 3, (periodic, (*periodic, Backlash()))),
        "ur10": ("| UR10 | 70 % |", 3, ((Harmonics(), *periodic),)),
        "irb120-60": ("| ABB IRB 120 | 60 |", 3, (gain, (*gain, Settling()), (*gain, Overshoot()))),
        "irb120-430": ("| ABB IRB 120 | 430 |", 3, (gain, (*gain, Settling()), (*gain, Overshoot()))),
        "fanuc": (
            "| FANUC R-2000iC/165F | 35 poses |",
            2,
            (harmonics, (*harmonics, Settling()), (*harmonics, Overshoot())),
        ),
        "wam": (
            "| Barrett WAM | 151 |",
            2,
            ((Backlash(),), (order, *gain, Backlash()), (order, *gain, Backlash(), Overshoot())),
        ),
    }
    for name, (words, digits, several) in rows.items():
        case = replace(CASES[name], splits=36 if name == "fanuc" else 10)
        plain = _geometry(data, name, case.splits)[1]
        for number, effects in enumerate(several):
            before = _spread(plain, digits) if not number else f"{np.median(plain):.{digits}f}"
            yield VALIDATION, f"{words} {before} | {_spread(_means(data, case, effects), digits)} |*"


def _spread(means: list[float], digits: int) -> str:
    """The median, and in brackets the least and largest of several."""
    most = f" ({min(means):.{digits}f}–{max(means):.{digits}f})" if len(means) > 1 else ""
    return f"{np.median(means):.{digits}f}{most}"


_WITH_ALL_EFFECTS = {
    "ur5-60": ("| UR5 | * | 60 of 1000 |", 3, "| UR5 | 60 | 10 |", 3),
    "ur5-700": ("| UR5 | * | 700 of 1000 |", 3, "| UR5 | 700 | 10 |", 3),
    "ur10": ("| UR10 | * | 70 % of 1495 |", 3, "| UR10 | 70 % | 3 |", 3),
    "irb120-60": ("| ABB IRB 120 | * | 60 of 620 |", 2, "| ABB IRB 120 | 60 | 10 |", 3),
    "irb120-430": ("| ABB IRB 120 | * | 430 of 620 |", 2, "| ABB IRB 120 | 430 | 10 |", 3),
    "fanuc": ("| FANUC R-2000iC/165F | * | 35 of 36 |", 2, "| FANUC R-2000iC/165F | 35 poses |", 3),
    "wam": ("| Barrett WAM, 7 axes | * | 70 % of 216 |", 1, "| Barrett WAM | 151 | 10 |", 2),
}
"""A case's row in the README and in the validation, and the digits that each shows."""


def _all_effects(data: Path, *names: str) -> Iterator[Figure]:
    """What is left on held-out rows by all effects at once, and how many of them are in their stated regions."""
    for name in names:
        readme, few, validation, digits = _WITH_ALL_EFFECTS[name]
        one = measured(data, name)
        inside = f"{100 * np.mean(one.inside):.0f} %"
        if len(one.auto) > 1:
            inside += f" ({100 * min(one.inside):.0f}–{100 * max(one.inside):.0f})"
        yield README, f"{readme} * | {np.median(one.auto):.{few}f} | {inside} |"
        yield VALIDATION, f"{validation} * | {_spread(one.auto, digits)} | {inside} |"
        if name == "ur5-60":
            yield INDEX, f"* mm geometry, {np.median(one.auto):.{few}f} mm geometry + effects"


def all_effects_of_ur(data: Path) -> Iterator[Figure]:
    """Of the robots with many rows: half of the time."""
    return _all_effects(data, "ur5-700", "ur10", "ur5-60")


def all_effects_of_others(data: Path) -> Iterator[Figure]:
    """Of the other robots."""
    return _all_effects(data, "irb120-430", "irb120-60", "fanuc", "wam")


def sockets(data: Path) -> Iterator[Figure]:
    """What is left of the ball in its sockets, at places that were fitted and at those that were not."""
    folder = data / "panda_sockets"
    model = ErrorModel(load_robot(folder / "nominal.urdf"))
    with TemporaryDirectory() as place:
        distances = Path(place) / "distances.csv"
        distances.write_text("socket_a,socket_b,distance_mm\n0,1,50.0\n", encoding="utf-8")
        campaign = read_campaign(folder / "measurements.csv", model.robot, options=ReadOptions(distances=distances))
    at = place_of(campaign)

    def left(fit: Callable[[Campaign], Calibration]) -> tuple[float, float]:
        """Of all rows fitted, and of each place predicted from the others, mm."""
        apart = [
            validate(fit(campaign.take(np.flatnonzero(at != name))), campaign.take(np.flatnonzero(at == name))).mean
            for name in PLACES
        ]
        return validate(fit(campaign), campaign).mean * 1e3, float(np.mean(apart)) * 1e3

    nominal, _ = left(lambda some: identify(model, some, keep=[], prior=None))
    (fitted, apart), (auto, auto_apart) = (
        left(lambda some: identify(model, some)),
        left(lambda some: explain(model, some).calibration),
    )
    page = "docs/how-to/calibrate-with-sockets.md"
    yield page, f"| nominal | {nominal:.1f} | |"
    yield page, f"| geometry | {fitted:.2f} | {apart:.2f} |"
    yield page, f"| geometry + effects (*) | {auto:.2f} | {auto_apart:.2f} |"


MAKERS: dict[str, Callable[[Path], Iterator[Figure]]] = {
    maker.__name__: maker
    for maker in (all_effects_of_ur, all_effects_of_others, named_effects, geometry, sockets, model_error)
}


def main(names: Sequence[str]) -> None:
    """Print what each maker makes."""
    for name in names or MAKERS:
        for page, words in MAKERS[name](DATA):
            print(f"{page}: {words}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
