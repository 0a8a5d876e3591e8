"""What the fit of the geometry is looked at for before it is believed: each check is a condition, its words and the remedy.

The checks are of the geometry, also where effects follow: those would explain away what is wrong with robot or rows.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from taskcal.campaigns.campaign import Campaign
from taskcal.errors import TaskcalError
from taskcal.identification.calibration import Calibration
from taskcal.identification.checks.course import describe_event, find_in_course
from taskcal.identification.checks.digits import few_digits_of
from taskcal.identification.options import FitOptions
from taskcal.observations import TrackerNoise, pictures_of
from taskcal.reading.pictures import BoardPoses, focus_drift
from taskcal.registration.length_scale import NAMED_SIGMAS, board_said, find_length_scale
from taskcal.registration.plausibility import is_in_base
from taskcal.registration.registration import nominal_poses, register
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.error_model import EXACT, ErrorModel
from taskcal_groundwork.said import Said


@dataclass(frozen=True, eq=False, kw_only=True)
class Checked:
    """A fit of the geometry, and what it was made of."""

    calibration: Calibration
    campaign: Campaign
    """The rows that were fitted, those that cannot be right left out."""
    options: FitOptions


Check = Callable[[Checked], Iterator[str]]
"""Yields what is to be said, in words that name the remedy; nothing of a healthy fit."""


JUDGED_ROWS = 100
"""Rows, at most, evenly among all, that a check computes poses at. A convention that bounds the time."""


def _some(n: int) -> np.ndarray:
    return np.unique(np.linspace(0, n - 1, min(n, JUDGED_ROWS)).astype(int))


def error_by_tolerances(calibration: Calibration) -> float:
    """Error of the nominal robot's tool point that its tolerances let expect at the fitted rows, rms in space, metres."""
    q, p = calibration.q, len(calibration.model)
    moved = calibration.tool_jacobian(q[_some(len(q))])[:, :3, :p] * calibration.model.tolerances
    return float(np.sqrt((moved**2).sum(axis=2).mean()))


def _is_whole(fit: Checked) -> bool:
    """Whether nothing but the tolerances holds a parameter of the geometry, so that none stands for another's error."""
    return fit.options.keep is None and fit.options.prior == "tolerances" and not fit.calibration.model.lengths_only


# Whether the robot file, and the joints as it counts them, are those of this robot.

WIDE_SCALE = 5.0
"""Prior scale beyond which a look at the robot file is advised. A convention: five times the tolerances on average are no
scatter of one robot."""

DOCTOR = Said("'taskcal doctor' (in Python: diagnose) tries what is usually wrong, and says which")


def _far_from_tolerances(fit: Checked) -> Iterator[str]:
    scale = fit.calibration.prior_scale
    if scale is not None and len(fit.calibration.estimated) and scale > WIDE_SCALE:
        yield Said(
            "the robot deviates {scale:.0f} times as much as its tolerances say: check the joints' order, signs and zero positions "
            "and the lengths in the robot file ({doctor}), or state wider tolerances",
            scale=scale,
            doctor=DOCTOR,
        )


UNEXPLAINED_SHARE = 1.0
"""Model error per axis over the error in space that the tolerances let expect of the tool, beyond which joints or robot file are in
doubt: what no parameter explains is more than all of them let the robot be off. The last joint of eight simulated robots turned the
other way, or coupled to the one before, left 1.4 to 2.1 with a target 10 mm off its axis; effects of usual size 0.02 to 0.5."""


def _unexplained(fit: Checked) -> Iterator[str]:
    error = fit.calibration.model_error[0]
    if not _is_whole(fit) or (fit.calibration.model.tolerances <= EXACT).any():
        return
    expected = error_by_tolerances(fit.calibration)
    if error > UNEXPLAINED_SHARE * expected:
        yield Said(
            "geometry leaves {error:.2f} mm per axis (1σ) that no parameter explains, more than the {expected:.2f} mm in space "
            "that all tolerances together let expect: a joint that turns the other way, or is coupled to another, leaves as much "
            "({doctor})",
            error=error * 1e3,
            expected=expected * 1e3,
            doctor=DOCTOR,
        )


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


def _off_lengths(fit: Checked) -> list[_OffLength]:
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


def _wrong_length(fit: Checked) -> Iterator[str]:
    whole = _is_whole(fit) and len(fit.calibration.estimated)
    for length in _off_lengths(fit)[:1] if whole else ():
        u = Said("u {size:.2f} mm", size=length.u * 1e3)
        if length.others:
            u = Said("{u}; these poses do not tell it from {others}", u=u, others=", ".join(length.others))
        yield Said(
            "{name} is {off:+.2f} mm ({u}), where the tolerance is {tolerance:g} mm: compare this length of the robot file with "
            "the maker's, correct it and identify again. The controller computes with its own lengths, and a program that is "
            "corrected by wrong ones gets worse",
            name=length.name,
            off=length.off * 1e3,
            u=u,
            tolerance=length.tolerance * 1e3,
        )


BETTER_SHARE = 0.5
"""Residual of another nominal robot over that of the own, below which it is said. A convention: robots of one make deviate from
their nominal geometry alike."""

FEW_ROWS, SAME_ROTATION = 5, 1e-6
"""Rows at which robots of the same joints turn their tools alike, to rounding: those of the catalogue that do are variants in
length, and any other robot is too far off to be fitted at all."""


def _better_variant(fit: Checked) -> Iterator[str]:
    """The robot of the catalogue that fits best as it is, of those with the same joints and other lengths, if it fits better."""
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
        yield Said(
            "{name} of the catalogue fits better as it is, to {least:.2f} mm rms in place of {before:.2f} mm: if that is the "
            "robot, identify with --robot {again}",
            name=name,
            again=name,
            least=least * 1e3,
            before=before * 1e3,
        )


def _doubts(fit: Checked) -> Iterator[str]:
    said = [words for check in (_far_from_tolerances, _unexplained, _wrong_length) for words in check(fit)]
    yield from (
        Said("robot file in doubt: {words}", words=words) for words in [*said, *(_better_variant(fit) if said else ())]
    )


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


def _calculated(fit: Checked) -> Iterator[str]:
    calibration = fit.calibration
    rms = float(np.sqrt(np.nanmean(np.sum(calibration.residuals[..., :3] ** 2, axis=-1))))
    if not fit.campaign.tracked:
        return
    if is_calculated(calibration):
        yield Said(
            "the nominal robot fits the points in a frame that is its own base, but for {rms:.2g} mm rms of scatter: so do "
            "positions that a controller or a simulation calculates, and no robot is so near to its drawing; give those of an "
            "instrument",
            rms=rms * 1e3,
        )
    elif rms < CALCULATED and is_in_base(calibration.layout.registration):
        yield Said(
            "the points fit to {rms:.1g} mm rms in a frame that is the robot's own base: so do positions that a controller or a "
            "simulation calculates, and measured ones do not",
            rms=rms * 1e3,
        )


def _other_scale(fit: Checked) -> Iterator[str]:
    scale = find_length_scale(fit.calibration.model, fit.campaign)
    if scale is not None and scale.named:
        yield Said("scale in doubt: {said}", said=scale.said())


def _other_board(fit: Checked) -> Iterator[str]:
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
            board = "the board" if name == "board" else f"board {name}"
            yield Said("scale in doubt: {said}", said=board_said(board, scale.value))


def _wrong_rotations(fit: Checked) -> Iterator[str]:
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
        yield Said(
            "rotations are {left:.2g} mrad rms off the fit, where the robot's tolerances let {expected:.2g} mrad expect: look "
            "whether they belong to these rows ('taskcal doctor'; in Python: diagnose), or leave their columns out",
            left=left * 1e3,
            expected=expected * 1e3,
        )


def _in_course(fit: Checked) -> Iterator[str]:
    event = find_in_course(fit.calibration, fit.campaign, fit.options.noise)
    if event is not None:
        said = describe_event(event, fit.campaign, fit.calibration.model.robot)
        yield Said(
            "course in doubt: {said}. Rows that are held out went through the same, so that their error and coverage flatter the "
            "fit",
            said=said,
        )


def _few_digits(fit: Checked) -> Iterator[str]:
    found = few_digits_of(fit.calibration)
    if found is not None:
        yield str(found)


MAX_OVERSTATED = 5.0
"""Ratio, at least, of a stated uncertainty to what the fit leaves, from which on it is called wrong: instruments state two or three
times theirs at most (k = 2, 3), and by chance the residuals of eight rows are a fifth of it in one of 10⁹."""

MICRO = 1e-3
"""Of a millimetre: what a number in micrometres is worth where it is read as millimetres."""


def _overstated(fit: Checked) -> Iterator[str]:
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
        column = "u_mm" if len(campaign.targets) == 1 else f"u_mm of {name}"
        yield (
            f"column {column} states an uncertainty of {typical:.4g} mm, {1.0 / ratio:.0f} times what the fit leaves of the "
            f"points, {rms:.2g} mm per axis, so that they count for too little: check its unit ({typical:.4g} µm are "
            f"{typical * MICRO:.4g} mm), or leave the column out"
        )


CHECKS: tuple[Check, ...] = (
    _doubts,
    _calculated,
    _overstated,
    _in_course,
    _other_scale,
    _other_board,
    _wrong_rotations,
    _few_digits,
)
"""In the order in which they are said."""


def with_checks(calibration: Calibration, campaign: Campaign, options: FitOptions) -> Calibration:
    """A calibration whose remarks begin with what the checks say of it.

    Args:
        calibration: of the geometry.
        campaign: the measurements, which may have rows that the fit left out.
        options: of the fit.
    """
    right = campaign.without(np.isin(campaign.ids, [row.id for row in calibration.left_out]))
    fit = Checked(calibration=calibration, campaign=right, options=options)
    said = tuple(words for check in CHECKS for words in check(fit))
    return replace(calibration, remarks=(*said, *calibration.remarks))
