"""Selection of the parameters that a task needs: expected task error by model size, and a choice with its reasons."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from taskcal.analysis.identifiability import Identifiability, describe_combination, identifiability, published_kept
from taskcal.arguments import Named, by_name, checked, chosen_options
from taskcal.campaigns.campaign import Campaign
from taskcal.errors import CampaignError, shortened
from taskcal.estimation.matrices import pseudo_invert_scaled, single_threaded
from taskcal.estimation.noisy_rows import PoseNoise
from taskcal.estimation.prior import GaussianPrior
from taskcal.identification.calibration import Calibration
from taskcal.identification.group_model import in_units
from taskcal.identification.holdout import mean_over_rows, split_postures
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.identify import attempt
from taskcal.identification.layout import frame_precision
from taskcal.identification.options import FitOptions
from taskcal.identification.problem import problem_of
from taskcal.observations.base import TrackerNoise
from taskcal.planning.expected_error import (
    Design,
    ParameterGroup,
    assumed_hyperparameters,
    design,
    known_hyperparameters,
    parameter_groups,
)
from taskcal.planning.options import SelectionOptions
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, TaskPoses, measuring_task, reach_task
from taskcal.virtual.cell import simulate

# Why parameters are not in a model that was chosen.


def reasons_of(
    by: Design,
    gone: Sequence[ParameterGroup],
    expected: Float[np.ndarray, " sizes"],
    elimination: Identifiability,
    kept: list[int],
) -> dict[str, str]:
    """Why each dropped parameter is not in the model, by its name.

    Args:
        by: the design by which it was chosen.
        gone: groups in the order in which they were dropped.
        expected: error before each went and after the last, metres.
        elimination: what the poses tell apart.
        kept: numbers of the parameters that are in the model.
    """
    names, out = by.model.names, dict[str, str]()
    variance = np.maximum(np.diag(by.influence), 0.0) * by.prior**2
    relations = _relations(by, [int(group.members[0]) for group in gone if len(group.members) == 1], kept)
    for step, group in enumerate(gone):
        own = [names[i] for i in group.members]
        alone = float(np.sqrt(variance[group.members].sum()))
        relation = relations.get(int(group.members[0]), {})
        whose = "its tolerance moves" if len(own) == 1 else f"{group.name} moves"
        if all(name in elimination.zero for name in own):
            reason = "no effect on the position at any of these poses"
        elif alone <= MAX_SHARE_OF_NOTHING * expected[0]:
            reason = "its effect on the task is absorbed by tracker frame and targets"
        elif relation:
            reason = f"equal to {describe_combination(relation, {})}"
        elif alone <= MAX_SHARE_OF_LITTLE * expected[0]:
            reason = f"{whose} the task by {alone * 1e3:.2g} mm rms, once tracker frame and targets are fitted"
        else:
            cost = (expected[step + 1] / expected[step] - 1.0) * 100
            without = "it" if len(own) == 1 else group.name
            reason = (
                f"not worth its variance: without {without} the expected error of {expected[step] * 1e3:.3f} mm changes by "
                f"{cost:+.2f} %"
            )
        out |= dict.fromkeys(own, reason)
    return out


def _relations(by: Design, gone: list[int], kept: list[int]) -> dict[int, dict[str, float]]:
    """The combination of kept parameters that each dropped one equals, for campaign and task together, where there is one."""
    if not kept or not gone:
        return {}
    both = by.information / np.trace(by.information) + by.influence / np.trace(by.influence)
    inner = both[np.ix_(kept, kept)]
    combined = pseudo_invert_scaled(inner, rcond=MIN_RELATION_EIGENVALUE_RATIO) @ both[np.ix_(kept, gone)]
    out: dict[int, dict[str, float]] = {}
    for j, c in zip(gone, combined.T, strict=True):
        left = both[j, j] - 2.0 * c @ both[kept, j] + c @ inner @ c
        if both[j, j] <= 0.0 or left > MAX_RELATION_REMAINDER * both[j, j]:
            continue
        weight = np.abs(c) * np.sqrt(np.diag(inner))
        out[j] = {
            by.model.names[kept[i]]: float(c[i]) for i in np.flatnonzero(weight > MIN_RELATION_WEIGHT * weight.max())
        }
    return out


# Errors of nested models on rows that they were not fitted to.
#
# The rows are linearised once, about a fit of the whole model; the rows of a fold are taken out of the normal
# equations, and each nested model is a solve of its own. A parameter that is dropped is held at zero.


def left_out_errors(
    whole: Calibration,
    campaign: Campaign,
    nested: Sequence[Int[np.ndarray, " _"]],
    prior: Float[np.ndarray, " p"],
    parts: Sequence[Int[np.ndarray, " _"]],
    noise: TrackerNoise | None,
) -> list[Float[np.ndarray, "n targets"]]:
    """Errors of position where a row was not fitted, metres, for each nested model; NaN where a beam was lost.

    Args:
        whole: a fit of the whole model to the campaign; rows that it left out are predicted, and not fitted.
        campaign: the measurements.
        nested: parameters that each model keeps.
        prior: standard deviation of every parameter.
        parts: rows of each fold.
        noise: the tracker's.
    """
    problem = problem_of(whole.layout, campaign, noise)
    at = problem.linearise(whole.z, joints=bool(whole.joint_error))
    p = len(whole.model)
    scale = np.concatenate([prior, np.full(len(whole.z) - p, FRAME_DEVIATION_M)])
    rows = in_units(problem, scale).rows(whole.z, at)
    W = rows.whiteners(PoseNoise.of_deviations(whole.model_error, whole.joint_error))
    J, y = rows.A, rows.y
    A, b = rows.whitened(W), np.einsum("nij,nj->ni", W, y)
    wrong = np.isin(campaign.ids, [row.id for row in whole.left_out])
    from scipy.linalg import cho_factor, cho_solve

    A[wrong], b[wrong] = 0.0, 0.0
    precision = np.eye(len(scale))
    if len(scale) > p:
        precision[p:, p:] = frame_precision(problem.layout) * FRAME_DEVIATION_M**2
    H, h = np.tensordot(A, A, ((0, 1), (0, 1))) + precision, np.tensordot(A, b, ((0, 1), (0, 1)))
    out = [np.full(problem.seen.valid.shape, np.nan) for _ in nested]
    frames, targets = np.arange(p, len(scale)), len(whole.targets)
    for part in parts:
        rest_H = H - np.tensordot(A[part], A[part], ((0, 1), (0, 1)))
        rest_h = h - np.tensordot(A[part], b[part], ((0, 1), (0, 1)))
        for errors, kept in zip(out, nested, strict=True):
            own = np.concatenate([kept, frames]).astype(np.int64)
            x = cho_solve(cho_factor(rest_H[np.ix_(own, own)]), rest_h[own])
            left = y[part] - J[part][:, :, own] @ x
            errors[part] = np.linalg.norm(left.reshape(len(part), targets, -1)[:, :, :3], axis=2)
    for errors in out:
        errors[~problem.seen.valid] = np.nan
    return out


MAX_ERROR_RATIO = 1.02
"""Expected task error of a sufficient model over the full model's. A convention, far below the uncertainty of the model error
that both start from: 8 % where 25 poses told it, 1/√(2·75)."""

ASSUMED_POSES = 60
"""Measured poses assumed where there is no campaign yet, as many as `plan` chooses by default, of the task's own workspace."""

FRAME_DEVIATION_M = 1e-3
"""Scale of tracker frame and targets beside parameters in units of their tolerances, metres and radians; it cancels, and keeps
the normal equations well scaled."""

MAX_SHARE_OF_NOTHING, MAX_SHARE_OF_LITTLE = 1e-6, 0.1
"""Effect of a tolerance on the task over the error of the full model, below which it counts as none (rounding), and below which
it alone is the reason: in squares, a hundredth."""

MIN_RELATION_EIGENVALUE_RATIO = 1e-12
"""Eigenvalue of the kept parameters' scaled information over the largest, under which they do not determine a combination."""

MAX_RELATION_REMAINDER = 1e-9
"""Share of a parameter's information that a combination of others leaves where it equals them, to rounding."""

MIN_RELATION_WEIGHT = 1e-4
"""Weight of a parameter over the largest, from which on it is named in a combination: four digits are shown."""


REACHING, DESIGNING = "joints that reach the task's poses", "what the measured poses tell over the task"
SHRINKING, VALIDATING = "what each size of the model leaves", "cross-validation"
ELIMINATING = "which parameters the poses tell apart"


def selection_steps(campaign: Campaign | None) -> tuple[str, ...]:
    """Steps that `select` reports to its `progress` one after another, with a campaign or without."""
    return REACHING, DESIGNING, SHRINKING, *(() if campaign is None else (VALIDATING,)), ELIMINATING


@dataclass(frozen=True, kw_only=True)
class NestedModel:
    """One size of the model; each larger one contains it."""

    size: int
    dropped_next: str
    """The parameter, or the effect of a joint, that goes on the step down from here; empty for the smallest."""
    expected: float
    """Expected rms error in space over the task, metres."""
    cross_validated: float | None
    """Mean error in space on left-out rows of the campaign, metres."""
    standard_error: float | None
    """Of the cross-validated error."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Selection:
    """The model chosen, and why each other parameter is not in it."""

    kept: tuple[str, ...]
    dropped: Mapping[str, str]
    """Reason by name."""
    ladder: tuple[NestedModel, ...]
    """From the full model down to none."""
    why: str
    """The rule that decided."""
    before: float
    """Expected rms error over the task with the nominal robot, frames fitted, metres."""
    references: Mapping[str, tuple[int, float]]
    """Size and expected error of the published and the identifiable set."""
    unreachable: float
    """Share of the task's poses that the robot does not reach."""
    design: Design | None = field(default=None, repr=False)
    """By which it was chosen: what the measured or assumed poses say over the task. None if the selection was put together
    by hand."""
    groups: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    """Parameters that were kept or dropped together, by the name of what they are: of single ones their own."""
    model_error: float = 0.0
    """Standard deviation per axis of what the complete model does not explain, with which it was chosen, metres."""
    model_error_rotation: float | None = None
    """The same of rotation, radians; None where points were measured, or nothing."""
    model_error_origin: str = ""
    """Where that comes from, in words."""

    def __repr__(self) -> str:
        return (
            f"Selection({len(self.kept)} of {len(self.kept) + len(self.dropped)} parameters kept: "
            f"{shortened(', '.join(self.kept), 120)}; {shortened(self.why, 120)})"
        )

    @property
    def kept_groups(self) -> tuple[str, ...]:
        """Names of what was kept: of single parameters, and of effects of a joint that go together."""
        return tuple(name for name, own in self.groups.items() if own[0] in self.kept) if self.groups else self.kept

    def summary(self) -> dict[str, Any]:
        """The report, in millimetres."""
        return {
            "kept": list(self.kept),
            "dropped": dict(self.dropped),
            "why": self.why,
            "before_mm": self.before * 1e3,
            "model_error_mm": self.model_error * 1e3,
            **({} if self.model_error_rotation is None else {"model_error_mrad": self.model_error_rotation * 1e3}),
            "model_error_origin": self.model_error_origin,
            "unreachable": self.unreachable,
            "references": {name: {"size": size, "expected_mm": e * 1e3} for name, (size, e) in self.references.items()},
            "ladder": [
                {
                    "size": nested.size,
                    "expected_mm": nested.expected * 1e3,
                    "cross_validated_mm": None if nested.cross_validated is None else nested.cross_validated * 1e3,
                }
                for nested in self.ladder
            ],
        }


@by_name(SelectionOptions)
@checked
@single_threaded
def select(
    _kind: Callable[Named, SelectionOptions],
    model: ErrorModel,
    task: Task,
    campaign: Campaign | None = None,
    accuracy: float | None = None,
    options: SelectionOptions | None = None,
    *_args: Named.args,
    **_named: Named.kwargs,
) -> Selection:
    """Choose the smallest model that serves the task.

    Without an accuracy it is the smallest within 2 % of the full model's expected error, and with a campaign also within
    one standard error of the best cross-validated one; with an accuracy, the smallest expected to meet it.

    Args:
        model: the over-complete model.
        task: what the robot has to do.
        campaign: measurements, from which model error and prior scale are taken, and which cross-validate every size.
        accuracy: error in space (rms) that is enough, metres.
        options: all at once; those that are named replace what is in them.

    Raises:
        ReachError: the robot does not reach the task.
        CampaignError: the accuracy is below what even the full model is expected to reach, or too few rows.
    """
    chosen = chosen_options(_kind, options, *_args, **_named)
    chosen.progress(REACHING)
    reached = reach_task(model, task, chosen.count, chosen.seed)
    chosen.progress(DESIGNING)
    by, hyper, whole = design_for(model, reached, task, campaign, chosen)
    groups = parameter_groups(model)
    chosen.progress(SHRINKING)
    order, expected = by.ladder([group.members for group in groups])
    order = [groups[g] for g in order]
    crossed = None if campaign is None or whole is None else _cross_validate(whole, campaign, order, hyper, chosen)
    ladder = _ladder(model, order, expected, crossed)
    k, why = _choose(ladder, accuracy)
    kept = _kept(model, order[:k])
    poses = reached.q if campaign is None else np.concatenate([reached.q, campaign.q])
    chosen.progress(ELIMINATING)
    elimination = identifiability(model, poses)
    return Selection(
        kept=tuple(model.names[i] for i in kept),
        dropped=reasons_of(by, order[:k], expected, elimination, kept),
        groups={group.name: tuple(model.names[i] for i in group.members) for group in groups},
        ladder=ladder,
        why=why,
        before=by.before,
        references=_references(model, by, elimination),
        unreachable=float(reached.unreachable.mean()),
        design=by,
        model_error=hyper.model_error[0],
        model_error_rotation=hyper.model_error[1] if campaign is not None and campaign.rotations is not None else None,
        model_error_origin=hyper.origin,
    )


def design_for(
    model: ErrorModel,
    reached: TaskPoses,
    task: Task,
    campaign: Campaign | None = None,
    options: SelectionOptions | None = None,
) -> tuple[Design, Hyperparameters, Calibration | None]:
    """The design of a campaign for a task, with the hyperparameters that it shows, and its fit; of assumed poses without one."""
    chosen = options or SelectionOptions()
    known = chosen.hyperparameters
    if campaign is None:
        assumed = reach_task(model, measuring_task(model, task), ASSUMED_POSES, chosen.seed + 1)
        rng, x = np.random.default_rng(chosen.seed), np.zeros(len(model))
        measured, _ = simulate(model, assumed.q, rng=rng, x=x, noise=chosen.noise)
        whole, hyper = None, known or assumed_hyperparameters(model, chosen.model_error)
    else:
        measured = campaign
        sizes = None if known is None else known.own
        fit = FitOptions(noise=chosen.noise)
        if sizes is not None:
            fit = replace(fit, prior=GaussianPrior.of_deviations(sizes), prior_scale=1.0)
        whole = attempt(model, campaign, fit).learnt().calibration
        hyper = replace(known_hyperparameters(whole, "what the campaign shows"), own=sizes)
    by = design(
        model,
        measured,
        reached,
        noise=chosen.noise,
        model_error=hyper.model_error,
        joint_error=hyper.joint_error,
        prior=hyper.deviations(model),
    )
    return by, hyper, whole


def _kept(model: ErrorModel, gone: Sequence[ParameterGroup]) -> list[int]:
    """Parameters that remain without some groups."""
    return sorted(set(range(len(model))) - {int(i) for group in gone for i in group.members})


def _ladder(
    model: ErrorModel,
    order: Sequence[ParameterGroup],
    expected: Float[np.ndarray, " sizes"],
    crossed: list[tuple[float, float]] | None,
) -> tuple[NestedModel, ...]:
    """Every size from the full model down to none, with its expected and its cross-validated error."""
    return tuple(
        NestedModel(
            size=len(_kept(model, order[:k])),
            dropped_next=order[k].name if k < len(order) else "",
            expected=float(expected[k]),
            cross_validated=None if crossed is None else crossed[k][0],
            standard_error=None if crossed is None else crossed[k][1],
        )
        for k in range(len(order) + 1)
    )


def _cross_validate(
    whole: Calibration,
    campaign: Campaign,
    order: Sequence[ParameterGroup],
    hyper: Hyperparameters,
    options: SelectionOptions,
) -> list[tuple[float, float]]:
    """Mean error on left-out rows for every nested model, with its standard error over the rows."""
    n, model = len(campaign), whole.model
    if n < 2 * options.folds:
        raise CampaignError(
            f"{n} rows are too few for cross-validation in {options.folds} folds; measure more, or select without it"
        )
    parts = split_postures(campaign.q, options.folds, options.seed)
    options.progress(VALIDATING)
    nested = [np.array(_kept(model, order[:k]), dtype=np.int64) for k in range(len(order) + 1)]
    errors = left_out_errors(whole, campaign, nested, hyper.deviations(model), parts, options.noise)
    return [mean_over_rows(of_one) for of_one in errors]


def _choose(ladder: tuple[NestedModel, ...], accuracy: float | None) -> tuple[int, str]:
    """Number of parameters to drop, and the rule that says so."""
    full = ladder[0].expected
    if accuracy is not None:
        if full > accuracy:
            raise CampaignError(
                f"an accuracy of {accuracy * 1e3:.3f} mm is out of reach: even the full model is expected to leave "
                f"{full * 1e3:.3f} mm rms over the task; measure more poses, nearer to the task, or allow more"
            )
        k = max(k for k, nested in enumerate(ladder) if nested.expected <= accuracy)
        return k, f"the smallest model expected to leave at most {accuracy * 1e3:g} mm rms over the task"
    enough = [k for k, nested in enumerate(ladder) if nested.expected <= MAX_ERROR_RATIO * full]
    why = "the smallest model within 2 % of the full one's expected task error"
    crossed = [
        (nested.cross_validated, nested.standard_error or 0.0)
        for nested in ladder
        if nested.cross_validated is not None
    ]
    if crossed:
        best, error = min(crossed)
        within = {k for k, nested in enumerate(ladder) if (nested.cross_validated or 0.0) <= best + error}
        enough = [k for k in enough if k in within] or [min(within)]
        why += f" whose cross-validated error is within one standard error ({error * 1e3:.3f} mm) of the best ({best * 1e3:.3f} mm)"
    return max(enough), why


def _references(model: ErrorModel, by: Design, elimination: Identifiability) -> dict[str, tuple[int, float]]:
    """The published and the identifiable set in the same terms."""
    sets: dict[str, Int[np.ndarray, " k"]] = {"identifiable": model.indices(elimination.kept)}
    if model.robot.published.dropped:
        sets["published"] = model.indices(published_kept(model))
    return {name: (len(kept), by.expected_error(kept)) for name, kept in sets.items()}


# What each part of a calibrated model is worth on held-out rows: from the nominal robot to all
# parameters.

MIN_ROWS = 20
"""Rows of a ladder, of which five folds leave 16: 48 coordinates for the 40 unknowns of a robot of six joints, its frame and a
target, which their priors hold besides."""


@dataclass(frozen=True, kw_only=True)
class Rung:
    """A nested model."""

    name: str
    parameters: int
    mean: float
    """Error in space on rows left out, metres."""
    p95: float
    """That 95 % of the points stay below, metres."""


def climb(calibration: Calibration, campaign: Campaign, *, folds: int = 5, seed: int = 0) -> tuple[Rung, ...]:
    """Errors of nested models on rows left out: frames alone, joint zeros, geometry, and each kind of effect on top.

    Args:
        calibration: with the whole model.
        campaign: measurements of its targets.
        folds: of neighbouring poses.
        seed: of the folds.

    Raises:
        CampaignError: too few rows, or other targets than the calibration's.
    """
    campaign.refuse_kinds("a ladder")
    if campaign.targets != calibration.targets:
        raise CampaignError("a ladder needs a campaign of the calibration's own targets")
    if len(campaign) < MIN_ROWS:
        raise CampaignError(f"{len(campaign)} rows are too few for a ladder; at least {MIN_ROWS}")
    names, sizes = list[str](), list[np.ndarray]()
    for name, kept in _nested(calibration):
        names.append(name)
        sizes.append(kept)
    scale = calibration.prior_scale
    prior = calibration.group_deviations
    if prior is None:
        prior = (1.0 if scale is None else scale) * calibration.model.tolerances
    parts = split_postures(campaign.q, folds, seed)
    errors = left_out_errors(calibration, campaign, sizes, prior, parts, None)
    return tuple(
        Rung(
            name=name,
            parameters=len(kept),
            mean=float(np.nanmean(error)),
            p95=float(np.nanpercentile(error, 95)),
        )
        for name, kept, error in zip(names, sizes, errors, strict=True)
    )


def _nested(calibration: Calibration) -> list[tuple[str, np.ndarray]]:
    """Names of nested models, and the parameters that each has."""
    model, estimated = calibration.model, calibration.estimated
    robot = model.robot
    geometry = set(ErrorModel(robot, lengths_only=model.lengths_only).names)
    turns = {f"{joint.name}.{'tz' if joint.kind == 'prismatic' else 'rz'}" for joint in robot.joints}
    zeros = np.array([i for i in estimated if model.names[i] in turns], dtype=int)
    whole = np.array([i for i in estimated if model.names[i] in geometry], dtype=int)
    out = [("nominal (registered)", np.zeros(0, dtype=int))]
    if len(zeros):
        out.append(("joint zeros", zeros))
    if len(whole) > len(zeros):
        out.append(("all geometry", whole))
    present = whole
    for effect in model.effects:
        own = {name for name in model.effect_names if name in set(_names(calibration, effect))}
        more = np.array([i for i in estimated if model.names[i] in own and i not in set(present.tolist())], dtype=int)
        if len(more):
            present = np.sort(np.concatenate([present, more]))
            out.append((f"with {effect.name}", present))
    return out


def _names(calibration: Calibration, effect: object) -> tuple[str, ...]:
    alone = ErrorModel(calibration.model.robot, effects=(effect,))  # pyright: ignore[reportArgumentType]
    return alone.effect_names
