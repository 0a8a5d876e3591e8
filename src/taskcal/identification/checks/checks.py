"""All safeguards of a fit: what makes it refuse, hold something back, or say a remark, each a condition, its words and the remedy.

Those of the geometry are asked of it also where effects follow, which would explain away what is wrong with robot or rows. What a
file, a campaign or a registration alone is refused for is of their rooms: others than a fit ask for it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Generic, Literal, NamedTuple, TypeVar

import numpy as np
from jaxtyping import Float, Int

from taskcal.campaigns.campaign import Campaign, name_moving, named_file
from taskcal.errors import CampaignError, FitError, NothingLearntError, OpenFrameError, TaskcalError, listed, shortened
from taskcal.estimation.matrices import invert_positive
from taskcal.estimation.noisy_rows import TYPICAL
from taskcal.identification.calibration import (
    COURSE_IN_DOUBT,
    FILE_IN_DOUBT,
    SCALE_IN_DOUBT,
    UNINFORMED_SHARE,
    Calibration,
)
from taskcal.identification.checks.course import describe_event, find_in_course
from taskcal.identification.checks.digits import few_digits_of
from taskcal.identification.fit import Fit
from taskcal.identification.hyperparameters import MAX_ROUNDS
from taskcal.identification.options import FitOptions
from taskcal.identification.sibling import MIN_GAIN, has_own_sizes
from taskcal.observations import TrackerNoise, pictures_of
from taskcal.reading.pictures import BoardPoses, focus_drift
from taskcal.registration.length_scale import NAMED_SIGMAS, board_said, find_length_scale
from taskcal.registration.plausibility import is_in_base, most_wrong_rows
from taskcal.registration.registration import nominal_poses, register
from taskcal.registration.rotations import fit_rotations
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import EXACT, ErrorModel
from taskcal_groundwork.said import Said, joined

Of = TypeVar("Of")
Does = Literal["refuses", "holds back", "remarks"]
Values = Mapping[str, str | float]
"""What fills the places of a safeguard's words."""


@dataclass(frozen=True, kw_only=True)
class Safeguard(Generic[Of]):
    """What keeps a fit from being believed more than it may."""

    does: Does
    condition: Callable[[Of], Iterable[Values]]
    """What fills the words, of everything that is not sound; nothing where all is."""
    words: str
    """What is not sound: the beginning of the sentence, as `Said` has it."""
    remedy: str
    """Its end; empty where the words that fill it name one."""
    error: type[TaskcalError]
    """That it refuses with."""

    @property
    def template(self) -> str:
        """The whole sentence."""
        return f"{self.words} {self.remedy}".rstrip()

    def holds(self, of: Of) -> bool:
        """Whether anything is not sound."""
        return next(iter(self.condition(of)), None) is not None

    def said(self, values: Values) -> Said:
        """The sentence with its places filled."""
        return Said(self.template, **values)


def safeguard(
    does: Does, words: str, remedy: str = "", error: type[TaskcalError] = CampaignError
) -> Callable[[Callable[[Of], Iterable[Values]]], Safeguard[Of]]:
    """The safeguard of the condition below."""
    return lambda condition: Safeguard(does=does, condition=condition, words=words, remedy=remedy, error=error)


def refuse(of: Of, safeguards: Iterable[Safeguard[Of]], source: str = "") -> None:
    """Raise the error of the first safeguard that finds something not sound.

    Args:
        of: what is asked.
        safeguards: that refuse.
        source: that the message begins with, such as the file's name.
    """
    for one in safeguards:
        for values in one.condition(of):
            raise one.error(f"{source}{one.said(values)}")


def said_of(of: Of, safeguards: Iterable[Safeguard[Of]]) -> tuple[str, ...]:
    """What safeguards say."""
    return tuple(one.said(values) for one in safeguards for values in one.condition(of))


DOCTOR = Said("'taskcal doctor' (in Python: diagnose) tests the usual mistakes")


# Of what is asked for, before anything is fitted.


class Asked(NamedTuple):
    """A fit that was not made yet."""

    model: ErrorModel
    campaign: Campaign
    options: FitOptions


@safeguard(
    "refuses",
    "frames of several stations ({names}) are fitted, and cannot be held:",
    "leave out frames='fixed' (--frames fixed), or fit one station",
)
def several_stations_held(asked: Asked) -> Iterator[Values]:
    stations = asked.campaign.stations
    if asked.options.frames == "fixed" and stations is not None and len(stations.names) > 1:
        yield {"names": ", ".join(stations.names)}


MAX_SCALE = 3.0
"""Prior scale, at most, of campaigns that no length is in. A convention: beyond, the residuals of a shrinking robot gain more
than its lengths lose."""


def scale_is_unobservable(campaign: Campaign) -> bool:
    """Whether a smaller robot leaves smaller residuals of all that was measured: any size fits, and the smallest fits best."""
    return all(kind.shrinks for kind in campaign.observations)


def _open_length(asked: Asked) -> str:
    """A length that is to be fitted, though nothing that was measured tells the robot's size; empty where there is none."""
    model, campaign, options = asked
    kept = range(len(model)) if options.keep is None else model.indices(options.keep)
    lengths = (model.parameters[i].name for i in kept if model.parameters[i].unit == "m")
    return next(lengths, "") if scale_is_unobservable(campaign) else ""


@safeguard(
    "refuses",
    "has no length that was measured or stated, so that a robot of any size fits it, the smallest best;",
    "state a distance between two sockets (--distances FILE), touch opposite faces of a cube, hold the lengths ({length} "
    "and others) by a prior of at most {most:g} tolerances, or keep none of them",
)
def no_length(asked: Asked) -> Iterator[Values]:
    length, scale = _open_length(asked), asked.options.prior_scale
    if length and (asked.options.prior is None or (scale != "estimate" and scale > MAX_SCALE)):
        yield {"length": length, "most": MAX_SCALE}


def hold_scale(asked: Asked) -> FitOptions:
    """Options that take the stated tolerances of the lengths as they are, where nothing that was measured tells the size.

    The residuals of a ball in its sockets are as small as the robot is. Where the scale of the tolerances is estimated beside
    the model error, the fit that explains all is a robot of no size, which no tolerance then forbids (`size_of_lengths` says so).

    Raises:
        CampaignError: lengths are to be fitted without a prior, or with one that is too wide.
    """
    refuse(asked, [no_length], named_file(asked.campaign))
    held = _open_length(asked) and asked.options.prior_scale == "estimate"
    return replace(asked.options, prior_scale=1.0) if held else asked.options


# Of a calibration that is to tell of a robot's sizes.

MAX_NAMES_LENGTH = 60
"""Characters of parameters' names in a message."""


def described_sibling(like: Calibration) -> str:
    """A calibration in words: its file, robot and campaign."""
    made = like.provenance
    return Said(
        "{file} ({robot}, {rows} rows of {campaign})",
        file=str(like.source) if like.source else Said("the calibration"),
        robot=made.robot,
        rows=made.rows,
        campaign=made.campaign or Said("a campaign"),
    )


class Sibling(NamedTuple):
    """A calibration of a robot that is taken to be of the same make."""

    model: ErrorModel
    """Of this robot."""
    like: Calibration
    effects: bool
    """Whether this robot's effects are found by their evidence."""

    @property
    def named(self) -> dict[str, str]:
        """The two, in words."""
        return {"named": described_sibling(self.like), "robot": self.model.robot.name}


@safeguard(
    "refuses",
    "{named} is no sibling of {robot}: their joints differ ({differing});",
    "take a calibration of a robot of the same make",
    error=TaskcalError,
)
def other_joints(of: Sibling) -> Iterator[Values]:
    each = [
        [
            f"{name} {'slides' if slides else 'turns'}"
            for name, slides in zip(robot.joint_names, robot.prismatic, strict=True)
        ]
        for robot in (of.model.robot, of.like.model.robot)
    ]
    own, theirs = map(len, each)
    differing = [f"{a} and {b}" for a, b in zip(*each, strict=False) if a != b]
    if own != theirs:
        differing = [f"{own} joints and {theirs}"]
    if differing:
        yield {**of.named, "differing": "; ".join(differing)}


@safeguard(
    "refuses",
    "{named} estimates none of this model's parameters, but {kept};",
    "take one that does",
    error=TaskcalError,
)
def other_parameters(of: Sibling) -> Iterator[Values]:
    if not set(of.model.names) & set(of.like.kept):
        yield {**of.named, "kept": shortened(", ".join(of.like.kept), MAX_NAMES_LENGTH) or "none at all"}


@safeguard(
    "refuses", "{named} had no prior, so that it says nothing of sizes;", "identify it with one", error=TaskcalError
)
def no_sizes(of: Sibling) -> Iterator[Values]:
    if of.like.prior_scale is None:
        yield of.named


@safeguard(
    "refuses",
    "{named} has sizes beside all effects, and these are not the sizes of geometry alone:",
    "identify with --effects auto, or take a calibration without (in Python: explain in place of identify)",
    error=TaskcalError,
)
def other_sizes(of: Sibling) -> Iterator[Values]:
    if has_own_sizes(of.like) and not of.effects:
        yield of.named


# Of rows that cannot be right.

MAX_NAMED_ROWS = 6
"""Rows that a message names."""


class WrongRows(NamedTuple):
    """Rows of a campaign that do not agree with the others."""

    campaign: Campaign
    numbers: Int[np.ndarray, " k"]


@safeguard(
    "refuses",
    "{count} of {seen} rows do not agree with the others ({named}): with more than a tenth of the rows, which are the wrong "
    "ones cannot be told.",
    "Correct or leave out the wrong ones, or fit all of them (gross_errors='keep', --gross-errors keep)",
)
def too_many_wrong_rows(rows: WrongRows) -> Iterator[Values]:
    count, seen = len(rows.numbers), int(rows.campaign.seen.sum())
    if count > most_wrong_rows(seen):
        named = listed((rows.campaign.row(int(row)) for row in rows.numbers), MAX_NAMED_ROWS)
        yield {"count": count, "seen": seen, "named": named}


@safeguard(
    "holds back",
    "{count} of {seen} rows cannot be right beside all others and were left out: {named}.",
    "Measure them again; if they are right, measure more poses like them, and fit all rows with gross_errors='keep' "
    "(--gross-errors keep)",
)
def rows_left_out(fit: Fit) -> Iterator[Values]:
    out, campaign = {row.id: row for row in fit.left_out}, fit.measured
    if not out:
        return
    turned = fit_rotations(fit.problem.layout.model, campaign)
    degrees = np.degrees(np.where(turned.wrong, turned.off, 0.0) if turned else np.zeros(len(campaign)))
    every: list[Said] = []
    for i in np.flatnonzero(np.isin(campaign.ids, list(out))):
        row = out[campaign.ids[i]]
        told = {"row": campaign.row(int(i)), "off": row.distance * 1e3, "times": row.studentised}
        every.append(
            Said(
                "{row}, {off:.1f} mm and its rotation {turn:.0f}° off, {times:.0f} standard deviations",
                turn=float(degrees[i]),
                **told,
            )
            if degrees[i]
            else Said("{row}, {off:.1f} mm off, {times:.0f} standard deviations", **told)
        )
    more = [Said("and {more} more", more=len(every) - MAX_NAMED_ROWS)] if len(every) > MAX_NAMED_ROWS else []
    yield {
        "count": len(out),
        "seen": int(campaign.seen.sum()),
        "named": joined("; ", [*every[:MAX_NAMED_ROWS], *more]),
    }


# Of a fit: whether it tells what it is asked for.


@safeguard(
    "holds back",
    "no length that is known was measured or stated: how large the robot is comes from {alone};",
    "state a distance of two sockets (--distances), trust the wire's scale, or touch opposite faces of a cube",
)
def size_of_lengths(fit: Fit) -> Iterator[Values]:
    if not any(kind.tells_scale for kind in fit.campaign.observations):
        held = scale_is_unobservable(fit.campaign)
        stated = Said("its nominal lengths alone within its tolerances as they are stated")
        yield {"alone": stated if held else Said("its nominal lengths alone")}


@safeguard(
    "remarks",
    "{measured} measured numbers for {unknowns} unknowns: residuals of the fitted rows say little, those of held-out "
    "rows more",
)
def few_numbers(fit: Fit) -> Iterator[Values]:
    measured, unknowns = _counted(fit)
    if measured < 2 * unknowns:
        yield {"measured": measured, "unknowns": unknowns}


def _counted(fit: Fit) -> tuple[int, int]:
    """Numbers that were measured, and those that were sought."""
    return fit.problem.measured_numbers, len(fit.z) - len(fit.problem.layout.model) + len(fit.estimated)


@safeguard("remarks", "model error and prior scale had not settled when the search for them ended")
def unsettled(fit: Fit) -> Iterator[Values]:
    if fit.rounds > MAX_ROUNDS:
        yield {}


@safeguard("remarks", "no model error could be told from so few rows, so the stated uncertainty leaves it out")
def untold_error(fit: Fit) -> Iterator[Values]:
    if fit.model_error[0] == 0.0:
        yield from few_numbers.condition(fit)


TOLD_NUMBERS = 2.0 / 3.0
"""Measured numbers over unknowns, below which no fit tells a model error, however large. Of virtual robots with one of 0.05 mm, 8
to 10 rows (24 to 30 numbers, 51 unknowns) had 67 to 85 % of the errors inside of the 95 % regions without it, 12 rows all."""


@safeguard(
    "holds back",
    "no model error could be told from so few rows, so the stated uncertainty takes {typical:.2g} mm per axis, as of any "
    "robot",
)
def typical_error(fit: Fit) -> Iterator[Values]:
    """Where all was estimated, and found without a model error only because the rows are so few that it explains any."""
    (measured, unknowns), by = _counted(fit), fit.by
    found = by is not None and fit.options.model_error == "estimate" and not by.hyper.variances.any()
    whole = len(fit.estimated) == len(fit.problem.layout.model)
    if found and whole and fit.options.prior is not None and measured < TOLD_NUMBERS * unknowns:
        yield {"typical": TYPICAL * 1e3}


OPEN_ROTATION = 0.3
"""Standard deviation of a tracker frame's rotation, radians, from which on it is open: a linear covariance says what it should of
smaller turns only (a turn by 0.3 moves points by 4 % along, beside 30 % across)."""


@safeguard(
    "refuses",
    "these rows do not determine the tracker frame: its rotation is open by {open:.0f}° (1σ), where {most:.0f}° can be "
    "calibrated; {motion}.",
    "Measure poses in which at least three joints move, the tool turns about two axes, and the points spread over some "
    "hundred millimetres",
    error=OpenFrameError,
)
def open_frame(fit: Fit) -> Iterator[Values]:
    """By all that the tolerances allow; under another prior, which may allow anything, with the parameters as they are."""
    C, layout, by, k = fit.covariance, fit.problem.layout, fit.by, 0
    if by is not None and fit.options.prior != "tolerances":
        own, k = len(fit.estimated), len(layout.estimated)
        C = invert_positive((by.solution.information + by.prior.precision(by.hyper.prior_factor))[own:, own:])
    for base in layout.bases:
        columns = base.columns[3:] - k
        turn = float(np.sqrt(np.linalg.eigvalsh(C[np.ix_(columns, columns)]).max(initial=0.0)))
        if turn > OPEN_ROTATION:
            yield {
                "open": min(np.degrees(turn), 180.0),
                "most": np.degrees(OPEN_ROTATION),
                "motion": _describe_motion(fit.campaign, layout.model.robot.joint_names),
            }


def _describe_motion(campaign: Campaign, joints: tuple[str, ...]) -> str:
    """Which joints move, and how far the points spread."""
    names = name_moving(campaign, joints)
    said = f"only {names[0]} moves" if len(names) == 1 else f"{', '.join(names) or 'no joints'} move"
    points = campaign.points[campaign.valid]
    along = (points - points.mean(axis=0)) @ np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2].T
    return f"{said}, and the points lie within {' × '.join(f'{size * 1e3:.0f}' for size in np.ptp(along, axis=0))} mm"


WORTHLESS_SIZE = 3e-4
"""Model error, metres per axis, from which on a robot that shows none of its tolerances is no nearly perfect one. A convention:
a nearly perfect robot leaves less."""


def tells_nothing(
    standard_errors: Float[np.ndarray, " k"],
    tolerances: Float[np.ndarray, " k"],
    scale: float,
    likeliest_scale: float,
    model_error: float,
) -> bool:
    """Whether a fit learnt nothing, and called all that was measured error.

    The rows tell nothing where every parameter is as uncertain as its prior of the most probable scale, which is next to
    zero then; of the expected one, which allows for what the rows do not exclude, they would always seem to tell a little.

    Args:
        standard_errors: of the parameters that were estimated.
        tolerances: of these.
        scale: of the prior's standard deviations, as expected.
        likeliest_scale: the most probable one.
        model_error: metres per axis.
    """
    if not len(standard_errors) or model_error < WORTHLESS_SIZE:
        return False
    told = np.maximum(standard_errors**-2 - (scale * tolerances) ** -2, 0.0)
    unseen = 1.0 / np.sqrt(1.0 + told * (likeliest_scale * tolerances) ** 2)
    return bool((unseen > UNINFORMED_SHARE).all())


@safeguard(
    "refuses",
    "no parameter is determined by these rows: none explains them, and {error:.2f} mm per axis were taken for error. Some "
    "rows contradict the others:",
    "check joints and points ({doctor}), or compare with the nominal robot alone (keep=[], --keep none)",
    error=NothingLearntError,
)
def nothing_learnt(fit: Fit) -> Iterator[Values]:
    """By the fit's own posterior: what it does not estimate, but considers, makes others uncertain that fit well."""
    by = fit.by
    if by is None or fit.options.prior_scale != "estimate" or fit.options.prior is None:
        return
    scale, error, k = by.hyper.prior_scale, by.hyper.model_error[0], len(fit.estimated)
    likeliest = scale if by.likeliest_factor is None else float(np.sqrt(by.likeliest_factor))
    own = np.sqrt(np.maximum(np.diag(by.posterior)[:k], 0.0))
    if tells_nothing(own, fit.problem.layout.model.tolerances[fit.estimated], scale, likeliest, error):
        yield {"error": error * 1e3, "doctor": DOCTOR}


@safeguard("holds back", "{what}.", "Only tracker frame and targets were fitted: the robot stays nominal")
def frames_alone(fit: Fit) -> Iterator[Values]:
    if fit.refusal is not None:
        said = str(fit.refusal)
        yield {"what": said.partition(". ")[0] if isinstance(fit.refusal, NothingLearntError) else said}


CONTRADICTING = 3.0
"""Standard deviations of what the tolerances make of the tool's position, beyond which an unexplained error is the rows' and not
the robot's: 3σ, as for a single gross error."""


@safeguard("refuses", "{what}", error=FitError)
def beyond_tolerances(fit: Fit) -> Iterator[Values]:
    if fit.refusal is not None and fit.model_error[0] > CONTRADICTING * error_by_tolerances(fit.calibration):
        yield {"what": str(fit.refusal)}


def by_tolerances(fit: Fit) -> Fit:
    """The same, unless what it leaves is more than an error of the robot.

    Raises:
        FitError: no parameter was estimated, and the rows are farther off than the robot's tolerances allow.
    """
    if fit.refusal is not None and beyond_tolerances.holds(fit):
        raise fit.refusal
    return fit


@safeguard("remarks", "{said}")
def unusual_effects(fit: Fit) -> Iterator[Values]:
    model, deviations = fit.problem.layout.model, np.sqrt(np.diag(fit.covariance))
    estimates = {model.names[i]: (float(fit.z[i]), float(deviations[i])) for i in fit.estimated}
    for effect in model.effects:
        yield from ({"said": said} for said in effect.remarks(model.robot, estimates))


@safeguard(
    "holds back",
    "the sizes of {named} were not taken: this robot's rows are not more probable under them (Δ log evidence {gain:.1f}, "
    "threshold {threshold:g}), as where the two are no siblings; all is as without",
)
def sibling_not_taken(fit: Fit) -> Iterator[Values]:
    if fit.help is not None and not fit.help.taken:
        yield {"named": described_sibling(fit.help.like), "gain": fit.help.gain, "threshold": MIN_GAIN}


@safeguard("remarks", "sizes and model error are expected as those of {named} (Δ log evidence {gain:+.1f})")
def sibling_taken(fit: Fit) -> Iterator[Values]:
    if fit.help is not None and fit.help.taken and not fit.help.untold:
        yield {"named": described_sibling(fit.help.like), "gain": fit.help.gain}


@safeguard(
    "remarks",
    "sizes and model error are expected as those of {named} (Δ log evidence {gain:+.1f}); it says nothing of {untold}, which "
    "are as without",
)
def sibling_taken_in_part(fit: Fit) -> Iterator[Values]:
    if fit.help is not None and fit.help.taken and fit.help.untold:
        untold = ", ".join(fit.help.untold)
        yield {"named": described_sibling(fit.help.like), "gain": fit.help.gain, "untold": untold}


class Unused(NamedTuple):
    """A calibration to which a sibling told nothing."""

    calibration: Calibration
    like: Calibration


@safeguard("remarks", "{named} was not used: this calibration has effects of their own sizes, and that one has none")
def sibling_without_effects(of: Unused) -> Iterator[Values]:
    if has_own_sizes(of.calibration):
        yield {"named": described_sibling(of.like)}


@safeguard("remarks", "{named} was not used: this calibration has no effects of their own sizes, and that one has some")
def sibling_with_effects(of: Unused) -> Iterator[Values]:
    if not has_own_sizes(of.calibration):
        yield {"named": described_sibling(of.like)}


# Of the geometry: whether robot file, rows, their course and their digits can be as they are.

JUDGED_ROWS = 100
"""Rows, at most, evenly among all, that a check computes poses at. A convention that bounds the time."""


def _some(n: int) -> np.ndarray:
    return np.unique(np.linspace(0, n - 1, min(n, JUDGED_ROWS)).astype(int))


def error_by_tolerances(calibration: Calibration) -> float:
    """Error of the nominal robot's tool point that its tolerances let expect at the fitted rows, rms in space, metres."""
    q, p = calibration.q, len(calibration.model)
    moved = calibration.tool_jacobian(q[_some(len(q))])[:, :3, :p] * calibration.model.tolerances
    return float(np.sqrt((moved**2).sum(axis=2).mean()))


def _is_whole(fit: Fit) -> bool:
    """Whether nothing but the tolerances holds a parameter of the geometry, so that none stands for another's error."""
    return fit.asked.keep is None and fit.asked.prior == "tolerances" and not fit.calibration.model.lengths_only


# Whether the robot file, and the joints as it counts them, are those of this robot.

WIDE_SCALE = 5.0
"""Prior scale beyond which a look at the robot file is advised. A convention: five times the tolerances on average are no
scatter of one robot."""


@safeguard(
    "remarks",
    FILE_IN_DOUBT + "the robot deviates {scale:.0f} times as much as its tolerances say:",
    "check the joints' order, signs and zero positions and the lengths in the robot file ({doctor}), or state wider "
    "tolerances",
)
def far_from_tolerances(fit: Fit) -> Iterator[Values]:
    scale = fit.calibration.prior_scale
    if scale is not None and len(fit.calibration.estimated) and scale > WIDE_SCALE:
        yield {"scale": scale, "doctor": DOCTOR}


UNEXPLAINED_SHARE = 1.0
"""Model error per axis over the error in space that the tolerances let expect of the tool, beyond which joints or robot file are in
doubt: what no parameter explains is more than all of them let the robot be off. The last joint of eight simulated robots turned the
other way, or coupled to the one before, left 1.4 to 2.1 with a target 10 mm off its axis; effects of usual size 0.02 to 0.5."""


@safeguard(
    "remarks",
    FILE_IN_DOUBT + "geometry leaves {error:.2f} mm per axis (1σ) that no parameter explains, more than the "
    "{expected:.2f} mm in space that all tolerances together let expect:",
    "a joint that turns the other way, or is coupled to another, leaves as much ({doctor})",
)
def unexplained(fit: Fit) -> Iterator[Values]:
    error = fit.calibration.model_error[0]
    if not _is_whole(fit) or (fit.calibration.model.tolerances <= EXACT).any():
        return
    expected = error_by_tolerances(fit.calibration)
    if error > UNEXPLAINED_SHARE * expected:
        yield {"error": error * 1e3, "expected": expected * 1e3, "doctor": DOCTOR}


INNOCENT_ROBOTS = 0.01
"""Chance that a length of a sound robot is called wrong. A convention."""

SEVERAL_TOLERANCES = 3.0
"""Tolerances, at least, that a length is off where it is called wrong: smaller ones are a robot's own. A convention."""

LEAST_TOLD = 0.1
"""Share of its prior variance that the rows must take from a length to judge it; of what tracker frame and targets repeat they take
next to nothing."""


class _OffLength(NamedTuple):
    """A length that is farther off than the other parameters let expect."""

    chance: float
    """Of any as far off in a sound robot."""
    name: str
    """Of its parameter."""
    others: list[str]
    """Parameters that the poses do not tell from it, or from its negative."""
    off: float
    """Metres."""
    u: float
    """Standard uncertainty of that, metres."""
    tolerance: float
    """Metres."""


SAME_DIRECTION = 0.99
"""Correlation of what the rows tell of two lengths from which on they are taken for one. A convention."""


def _off_lengths(fit: Fit) -> list[_OffLength]:
    """Lengths that are off by several tolerances, the least likely first.

    The prior shares an error out among the parameters that repeat each other: of a length that is off by δ the estimate is
    m = s·δ, with s = 1 − C/σ² the share of the prior variance σ² that the rows took from it. So δ̂ = m/s, of variance σ²/s where
    all other parameters scatter as their prior says (the score test of a prior mean), is the same for all lengths that stand
    for one. σ is the tolerance times the scatter of the others without what δ̂ explains, as of an externally studentised residual
    (Cook and Weisberg, Residuals and Influence in Regression, 1982): of all parameters, or of the lengths alone, as the joints'
    zero positions may be far off where the lengths are not. The likelier of both counts, doubled.
    """
    from scipy.special import stdtr  # heavy, and nothing is so far off as a rule

    calibration, model = fit.calibration, fit.calibration.model
    kept = calibration.estimated[calibration.estimated < len(model) - len(model.effect_names)]
    tolerance, m = model.tolerances[kept], calibration.estimate[kept]
    variance = np.square(tolerance * (calibration.prior_scale or 1.0))
    told = np.diag(variance) - calibration.covariance[np.ix_(kept, kept)]
    share = np.clip(np.diag(told) / variance, 0.0, 1.0)
    names = np.array([model.names[i] for i in kept])
    # where a joint slides its zero position is off, and the controller has the same
    zeros = [
        f"{name}.tz" for name, slides in zip(model.robot.joint_names, model.robot.prismatic, strict=True) if slides
    ]
    length = np.array([model.parameters[i].unit == "m" for i in kept])
    judged = length & (share > LEAST_TOLD) & ~np.isin(names, zeros)
    off = np.divide(m, share, out=np.zeros_like(m), where=judged)
    found: list[_OffLength] = []
    for k in np.flatnonzero(np.abs(off) > SEVERAL_TOLERANCES * tolerance):
        left = np.square((m - off[k] * told[:, k] / variance[k]) / tolerance)
        chance, u = 1.0, 0.0
        for some in (np.ones(len(kept), dtype=bool), length):
            freedom = max(float(share[some].sum()) - 1.0, 1.0)
            spread = float(tolerance[k] * np.sqrt(left[some].sum() / freedom / share[k]))
            own = 2.0 * share[judged].sum() * 2.0 * float(stdtr(freedom, -abs(off[k]) / spread))
            chance, u = min((chance, u), (own, spread))
        alike = judged & (np.abs(told[:, k]) > SAME_DIRECTION * np.sqrt(np.abs(np.diag(told)) * told[k, k]))
        others = [str(name) for name in names[alike] if name != names[k]]
        found.append(_OffLength(chance, str(names[k]), others, float(off[k]), u, float(tolerance[k])))
    return sorted((one for one in found if one.chance < INNOCENT_ROBOTS), key=lambda one: one.chance)


@safeguard(
    "remarks",
    FILE_IN_DOUBT + "{name} is {off:+.2f} mm ({u}), where the tolerance is {tolerance:g} mm:",
    "compare this length of the robot file with the maker's, correct it and identify again. The controller computes with "
    "its own lengths, and a program that is corrected by wrong ones gets worse",
)
def wrong_length(fit: Fit) -> Iterator[Values]:
    whole = _is_whole(fit) and len(fit.calibration.estimated)
    for length in _off_lengths(fit)[:1] if whole else ():
        u = Said("u {size:.2f} mm", size=length.u * 1e3)
        if length.others:
            u = Said("{u}; these poses do not tell it from {others}", u=u, others=", ".join(length.others))
        yield {"name": length.name, "off": length.off * 1e3, "u": u, "tolerance": length.tolerance * 1e3}


BETTER_SHARE = 0.5
"""Residual of another nominal robot over that of the own, below which it is said. A convention: robots of one make deviate from
their nominal geometry alike."""

FEW_ROWS, SAME_ROTATION = 5, 1e-6
"""Rows at which robots of the same joints turn their tools alike, to rounding: those of the catalogue that do are variants in
length, and any other robot is too far off to be fitted at all."""


@safeguard(
    "remarks",
    FILE_IN_DOUBT + "{name} of the catalogue fits better as it is, to {least:.2f} mm rms in place of {before:.2f} mm:",
    "if that is the robot, identify with --robot {again}",
)
def better_variant(fit: Fit) -> Iterator[Values]:
    """The robot of the catalogue that fits best as it is, of those with the same joints and other lengths, if it fits better.

    It is looked for where the robot's own file is in doubt.
    """
    if not any(one.holds(fit) for one in (far_from_tolerances, unexplained, wrong_length)):
        return
    own, campaign = ErrorModel(fit.calibration.model.robot), fit.campaign
    seen = np.flatnonzero(campaign.seen)
    some = campaign.take(seen[_some(len(seen))])
    q = some.q[:FEW_ROWS]
    turned = own.poses(q)[:, :3, :3]
    robots = [load_robot(name) for name in catalogue_names() if name != own.robot.name]
    alike = [ErrorModel(robot) for robot in robots if robot.prismatic == own.robot.prismatic]

    def residual(model: ErrorModel) -> float:
        try:
            same = np.allclose(model.poses(q)[:, :3, :3], turned, atol=SAME_ROTATION)
            return register(model, some).rms if same else np.inf
        except TaskcalError:  # its closed loop is another, or these joints reach nothing
            return np.inf

    before, found = residual(own), [(residual(model), model.robot.name) for model in alike]
    least, name = min(found, default=(np.inf, ""))
    if least < BETTER_SHARE * before < np.inf:
        yield {"name": name, "again": name, "least": least * 1e3, "before": before * 1e3}


# Whether the points were measured at all.

CALCULATED = 1.5e-5
"""Residual of fitted points, metres rms, below which no instrument measured them: a tracker alone is uncertain by as much, and
robots repeat to some 20 µm."""

NOMINAL_SCALE, IN_BASE_SHARE = 0.3, 0.1
"""Prior scale below which a robot is as good as nominal, and share of the bounds of `is_in_base`, 0.2 mm and 0.2 mrad, within
which its frame is its own base. Of ten robots with 30 and 60 rows those whose nominal positions scatter by 0.02 to 0.1 mm had
scales of 0.17 at most in frames 0.1 mm from the base; those drawn from their tolerances 0.59 at least, and frames 0.6 mm off."""


def is_calculated(calibration: Calibration) -> bool:
    """Whether points are in the robot's own base as the nominal robot has them, but for some scatter."""
    scale = calibration.prior_scale
    nominal = scale is not None and len(calibration.estimated) > 0 and scale < NOMINAL_SCALE
    return nominal and is_in_base(calibration.layout.registration, IN_BASE_SHARE)


def _scatter_in_base(fit: Fit, *, nominal: bool) -> Iterator[Values]:
    calibration = fit.calibration
    rms = float(np.sqrt(np.nanmean(np.sum(calibration.residuals[..., :3] ** 2, axis=-1))))
    exact = rms < CALCULATED and is_in_base(calibration.layout.registration)
    if fit.campaign.tracked and is_calculated(calibration) == nominal and (nominal or exact):
        yield {"rms": rms * 1e3}


@safeguard(
    "remarks",
    "the nominal robot fits the points in a frame that is its own base, but for {rms:.2g} mm rms of scatter: so do positions "
    "that a controller or a simulation calculates, and no robot is so near to its drawing;",
    "give those of an instrument",
)
def calculated_nominal(fit: Fit) -> Iterator[Values]:
    yield from _scatter_in_base(fit, nominal=True)


@safeguard(
    "remarks",
    "the points fit to {rms:.1g} mm rms in a frame that is the robot's own base: so do positions that a controller or a "
    "simulation calculates, and measured ones do not",
)
def calculated_exactly(fit: Fit) -> Iterator[Values]:
    yield from _scatter_in_base(fit, nominal=False)


@safeguard("remarks", SCALE_IN_DOUBT + "{said}")
def other_scale(fit: Fit) -> Iterator[Values]:
    scale = find_length_scale(fit.calibration.model, fit.campaign)
    if scale is not None and scale.named:
        yield {"said": scale.said()}


@safeguard("remarks", SCALE_IN_DOUBT + "{said}")
def other_board(fit: Fit) -> Iterator[Values]:
    """Boards of another size than is stated, by the poses that the camera with most images of each has.

    As of a tracker's points by the nominal robot, whatever the fit has made of it: there the parameters follow a size as well, at a
    larger scale of their prior. What is stated of a size counts beside the robot's tolerances.
    """
    model, campaign = fit.calibration.model, fit.campaign
    kind, told = pictures_of(campaign.observations), set[int]()
    if kind is None or kind.pictures is None:
        return
    for pair in BoardPoses.each(kind, nominal_poses(model, campaign)):
        if pair.board in told or focus_drift(kind.pictures[pair.camera]) is not None:
            continue
        told.add(pair.board)
        one = replace(campaign.of_targets(campaign.targets[:1]), observations=(), uncertainty=None)
        scale, name = find_length_scale(model, pair.in_rows_of(one, kind)), kind.boards[pair.board]
        if scale is not None and scale.differs(kind.u_scale[pair.board]):
            board = Said("the board") if name == "board" else Said("board {name}", name=name)
            yield {"said": board_said(board, scale.value)}


@safeguard(
    "remarks",
    "rotations are {left:.2g} mrad rms off the fit, where the robot's tolerances let {expected:.2g} mrad expect:",
    "look whether they belong to these rows ('taskcal doctor'; in Python: diagnose), or leave their columns out",
)
def wrong_rotations(fit: Fit) -> Iterator[Values]:
    calibration = fit.calibration
    if not calibration.layout.pose:
        return
    by_tolerance = (
        calibration.tool_jacobian(calibration.q)[:, 3:, : len(calibration.model)] * calibration.model.tolerances
    )
    noise = fit.options.noise or TrackerNoise()
    expected = float(np.sqrt((by_tolerance**2).sum(axis=(1, 2)).mean() + 3.0 * noise.rotation**2))
    left = float(np.sqrt(np.nanmean(np.sum(calibration.residuals[..., 3:] ** 2, axis=-1))))
    if left > NAMED_SIGMAS * expected:
        yield {"left": left * 1e3, "expected": expected * 1e3}


@safeguard(
    "remarks",
    COURSE_IN_DOUBT + "{said}.",
    "Held-out rows contain it, too, so that their error and coverage flatter the fit",
)
def in_course(fit: Fit) -> Iterator[Values]:
    event = find_in_course(fit.calibration, fit.campaign, fit.options.noise)
    if event is not None:
        yield {"said": describe_event(event, fit.campaign, fit.calibration.model.robot)}


@safeguard(
    "remarks",
    "the {of} are written to {step}: this last digit is worth about {worth:.2g} mm of the {left:.2g} mm (rms) that a fit "
    "leaves:",
    "write more digits; no effect of the robot explains it",
)
def few_digits(fit: Fit) -> Iterator[Values]:
    found = few_digits_of(fit.calibration)
    if found is not None:
        yield {**found.values, "of": Said("joints") if found.of == "joints" else Said("points")}


@safeguard(
    "remarks",
    "{count} of {all} rows have the joint values and the points of others, to the last digit ({rows}): one reading was written "
    "several times, and counts as often, so that the stated uncertainty is too small:",
    "leave these rows out, or give all of one pose one id, so that they are averaged",
)
def copied_rows(fit: Fit) -> Iterator[Values]:
    campaign = fit.campaign
    seen = campaign.valid.any(axis=1)
    if not campaign.tracked or not seen.any():
        return
    numbers = np.concatenate([campaign.q, np.nan_to_num(campaign.points).reshape(len(campaign), -1)], axis=1)[seen]
    _, first, which = np.unique(numbers, axis=0, return_index=True, return_inverse=True)
    rows = np.flatnonzero(seen)
    copies = rows[rows != rows[first[which.ravel()]]].tolist()
    if copies:
        named = listed((campaign.row(row) for row in copies), MAX_NAMED_ROWS)
        yield {"count": len(copies), "all": len(campaign), "rows": named}


MAX_OVERSTATED = 5.0
"""Ratio, at least, of a stated uncertainty to what the fit leaves, from which on it is called wrong: instruments state two or three
times theirs at most (k = 2, 3), and by chance the residuals of eight rows are a fifth of it in one of 10⁹."""

MICRO = 1e-3
"""Of a millimetre: what a number in micrometres is worth where it is read as millimetres."""


@safeguard(
    "remarks",
    "column {column} states an uncertainty of {stated:.4g} mm, {times:.0f} times what the fit leaves of the points, "
    "{left:.2g} mm per axis, so that they count for too little:",
    "check its unit ({micro:.4g} µm are {meant:.4g} mm), or leave the column out",
)
def overstated(fit: Fit) -> Iterator[Values]:
    stated, campaign = fit.campaign.uncertainty, fit.campaign
    if stated is None or not campaign.tracked or stated.shape != fit.calibration.residuals.shape[:2]:
        return
    for t, name in enumerate(campaign.targets):
        left = fit.calibration.residuals[:, t, :3]
        seen = np.isfinite(left).all(axis=1)
        ratio = float(np.sqrt(np.mean((left[seen] / stated[seen, t, None]) ** 2))) if seen.any() else np.inf
        if ratio * MAX_OVERSTATED >= 1.0:
            continue
        typical, rms = float(np.median(stated[seen, t])) * 1e3, float(np.sqrt(np.mean(left[seen] ** 2))) * 1e3
        column = "u_mm" if len(campaign.targets) == 1 else Said("u_mm of {name}", name=name)
        yield {
            "column": column,
            "stated": typical,
            "times": 1.0 / ratio,
            "left": rms,
            "micro": typical,
            "meant": typical * MICRO,
        }


# Those that are asked together, in the order in which they are said.

UNUSED_SIBLING = (sibling_without_effects, sibling_with_effects)
OF_SIBLING = (other_joints, other_parameters, no_sizes, other_sizes)
OF_ONE_MODEL = (unusual_effects, sibling_not_taken, sibling_taken, sibling_taken_in_part)
"""Of geometry and effects with sizes of their own."""
OF_FIT = (
    rows_left_out,
    size_of_lengths,
    few_numbers,
    unsettled,
    untold_error,
    typical_error,
    *OF_ONE_MODEL,
    frames_alone,
)
"""Of geometry, and of effects that were asked for."""
OF_GEOMETRY = (
    far_from_tolerances,
    unexplained,
    wrong_length,
    better_variant,
    calculated_nominal,
    calculated_exactly,
    overstated,
    in_course,
    other_scale,
    other_board,
    wrong_rotations,
    few_digits,
    copied_rows,
)
"""Said before all others of a fit that is kept."""
