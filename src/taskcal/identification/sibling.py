"""What the calibration of a robot of the same make tells beforehand: sizes of groups, and errors of single poses.

The log variances θ of this robot have the prior N(μ, Ω) of `group_model`. Those of its sibling, θ̂, are taken for a measurement:

    θ̂ = θ + δ,   δ ~ N(0, Λ),   Λ_g = SPECIMEN_WIDTH² + 1/F_g

with F_g the Fisher information that the sibling's own rows had of θ̂_g: a group that they did not determine tells nothing. Prior and
measurement together are the prior with the sibling, N(m, C) with C⁻¹ = Ω⁻¹ + Λ⁻¹ and m = C·(Ω⁻¹μ + Λ⁻¹θ̂).

A robot may be called a sibling and be none. Both priors are therefore integrated over, and the sibling's is taken where
this robot's rows are more probable under it, beyond doubt (`MIN_GAIN`).
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from taskcal.estimation.group_variances import Groups
from taskcal.estimation.noisy_rows import FLAT, MIN_VARIANCE, TYPICAL, NoisyFit, PoseNoise
from taskcal.identification.calibration import Calibration
from taskcal.identification.group_model import (
    JOINT_WIDTH,
    GroupModel,
)
from taskcal.identification.problem import Linearisation, Problem

SPECIMEN_WIDTH = JOINT_WIDTH
"""Standard deviation of a log variance of one robot about its sibling's: a factor of 1.6 in size. A convention: two robots of one
make differ as two joints of one robot do."""

MIN_INFORMATION = 1e-6
"""Information of a log variance under which there is none."""

MIN_GAIN = 1.0
"""Gain of log evidence from which on a sibling's sizes are taken. Kass and Raftery (1995), Journal of the American Statistical
Association 90, find less not worth more than a bare mention; what is ambiguous stays as without."""


def has_own_sizes(like: Calibration) -> bool:
    """Whether geometry and effects were fitted together, so that each group has a size of its own."""
    return like.group_deviations is not None


def expecting(one: GroupModel, like: Calibration) -> GroupModel:
    """The model with a sibling's sizes expected of its groups."""
    groups = one.groups
    s = groups.searched
    if not len(s):
        return one
    theirs, information = _sizes_of(one, like)
    told = 1.0 / (SPECIMEN_WIDTH**2 + 1.0 / np.maximum(information[s], MIN_INFORMATION))
    precision = groups.precision + np.diag(told)
    location, spread = groups.location.copy(), np.zeros_like(groups.spread)
    location[s] = np.linalg.solve(precision, groups.precision @ groups.location[s] + told * theirs[s])
    spread[np.ix_(s, s)] = np.linalg.inv(precision)
    return replace(one, groups=replace(groups, location=location, spread=spread))


def untold_effects(one: GroupModel, like: Calibration) -> tuple[str, ...]:
    """Effects of which the sibling has no parameter."""
    missing = [name not in like.kept for name in one.problem.layout.model.names]
    number = one.groups.group[: len(missing)]
    alone = [g for g in range(len(one.labels)) if all(np.array(missing)[number == g])]
    return tuple(dict.fromkeys(one.labels[g].effect for g in alone))


def _sizes_of(one: GroupModel, like: Calibration) -> tuple[Float[np.ndarray, " groups"], Float[np.ndarray, " groups"]]:
    """A sibling's log variances of the groups, and their Fisher information of its own rows, zero where it has none.

    With r_i the variance of its estimate over that of its prior, ½ Σ (1 − r_i)² is the information of a group without the
    correlations of its parameters, which a calibration does not keep apart.
    """
    deviations = like.group_deviations
    if deviations is None:
        deviations = (like.prior_scale or 1.0) * like.model.tolerances
    index = {name: i for i, name in enumerate(like.names)}
    estimated = set(like.kept)
    total, weight, information = (np.zeros(len(one.labels)) for _ in range(3))
    for i, name in enumerate(one.problem.layout.model.names):
        g = one.groups.group[i] if i < len(one.groups.group) else -1
        if g < 0 or name not in estimated:
            continue
        k = index[name]
        total[g] += 2.0 * np.log(deviations[k] / one.scale[i])
        weight[g] += 1.0
        information[g] += 0.5 * max(1.0 - (like.standard_errors[k] / deviations[k]) ** 2, 0.0) ** 2
    return total / np.maximum(weight, 1.0), information


def expecting_errors(errors: PoseNoise, like: Calibration, at: Linearisation, problem: Problem) -> PoseNoise:
    """What single poses add, with a sibling's expected: as of groups, with 1/F of a variance from its share of that of a pose.

    A share s of a variance that m numbers tell has a relative standard error of √(2/m)/s at best.

    Args:
        errors: without it.
        like: the sibling.
        at: rows of this robot.
        problem: of these rows.
    """
    if not errors.searched:
        return errors
    theirs, told = [like.model_error[0] ** 2], [True]
    if errors.rotation is not None:
        theirs, told = theirs + [e**2 for e in like.model_error[1:]], [True, len(like.model_error) > 1]
    theirs += [e**2 for e in like.joint_error][: len(errors.joints)]
    told += [bool(like.joint_error)] * len(errors.joints)
    expected = np.full(len(told), TYPICAL**2)
    expected[told] = np.maximum(theirs, MIN_VARIANCE)
    whole = np.einsum("nii->ni", at.covariance(errors.with_variances(expected), problem.noise))
    shares = [
        np.where(at.seen, variance * np.einsum("nii->ni", part) / whole, 0.0).sum() / at.seen.sum()
        for variance, part in zip(expected, at.units_of_noise, strict=True)
    ]
    numbers = max(int(np.isfinite(like.residuals).sum()), 1)
    information = 0.5 * numbers * np.square(shares)
    precision = np.where(told, 1.0 / (SPECIMEN_WIDTH**2 + 1.0 / np.maximum(information, MIN_INFORMATION)), 0.0)
    without = np.broadcast_to(np.square(1.0 / np.asarray(errors.width)), precision.shape)
    location = without * np.log(errors.expected) + precision * np.log(expected)
    both = np.maximum(without + precision, 1.0 / FLAT)
    return replace(errors, expected=np.exp(location / both), width=1.0 / np.sqrt(both))


def evidence_under(fitted: NoisyFit, groups: Groups, errors: PoseNoise) -> float:
    """Log marginal likelihood of a fit, sizes and what single poses add integrated out under these priors.

    By Laplace's approximation about what the fit found.

    Args:
        fitted: the fit.
        groups: what is expected of the sizes.
        errors: what is expected of the errors of single poses.
    """
    found = replace(fitted.found, equations=replace(fitted.found.equations, groups=groups))
    log = replace(fitted, found=found).log_evidence
    if not errors.searched:
        return log
    off = np.log(fitted.errors.variances / errors.expected)
    prior = np.broadcast_to(np.square(1.0 / np.asarray(errors.width)), off.shape)
    information = fitted.noise_information
    narrowed = np.linalg.slogdet(information + np.diag(prior))[1] - np.log(prior).sum()
    return log - 0.5 * float(prior @ off**2) - 0.5 * float(narrowed)


@dataclass(frozen=True, kw_only=True)
class Help:
    """What came of a sibling."""

    like: Calibration
    gain: float
    """Log marginal likelihood of this robot's rows with the sibling's sizes less that without."""
    untold: tuple[str, ...] = ()
    """Effects that the sibling does not have."""

    @property
    def taken(self) -> bool:
        """Whether its sizes are expected of this robot."""
        return self.gain > MIN_GAIN


def described_with(help: Help | None, options: dict[str, Any]) -> dict[str, Any]:
    """Described options of a fit, with what came of a sibling."""
    if help is None:
        return options
    return {**options, "like": {**options["like"], "taken": help.taken, "log_evidence_gain": help.gain}}
