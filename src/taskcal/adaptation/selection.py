"""How many parameters a task needs, and which: the ladder of expected task error, and a choice with its reasons."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Unpack

import numpy as np
from jaxtyping import Float, Int

from taskcal.adaptation.candidates import measuring_task
from taskcal.adaptation.expected_error import Design, design
from taskcal.adaptation.hyperparameters import assumed_hyperparameters, known_hyperparameters
from taskcal.adaptation.selection_options import SelectionChoices, SelectionOptions
from taskcal.analysis.elimination_table import describe_combination, published_kept
from taskcal.analysis.identifiability import Identifiability, identifiability
from taskcal.arguments import expect_kinds, renamed_arguments
from taskcal.errors import CampaignError, shortened
from taskcal.estimation.blas import single_threaded
from taskcal.estimation.scaled import pseudo_invert_scaled
from taskcal.identification.cross_validation import mean_over_rows, predict_left_out, split_postures
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.identify import identify
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.virtual_cell import simulate
from taskcal.public_names import FormerName
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, TaskPoses, reach_task

SUFFICIENT = 1.02
"""A model is sufficient if its expected task error is within 2 % of the full model's."""

ASSUMED_POSES = 60
"""Measured poses assumed where there is no campaign yet: so many of the task's own workspace."""


@dataclass(frozen=True, kw_only=True)
class NestedModel:
    """One size of the model; each larger one contains it."""

    size: int
    dropped_next: str
    """The parameter that goes on the step down from here; empty for the smallest."""
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

    to_json = FormerName("summary")


@renamed_arguments(scales="hyperparameters")
@single_threaded
def select(
    model: ErrorModel,
    task: Task,
    campaign: Campaign | None = None,
    accuracy: float | None = None,
    **options: Unpack[SelectionChoices],
) -> Selection:
    """Choose the smallest model that serves the task.

    Without an accuracy it is the smallest within 2 % of the full model's expected error, and with a campaign also within
    one standard error of the best cross-validated one; with an accuracy, the smallest expected to meet it.

    Args:
        model: the over-complete model.
        task: what the robot has to do.
        campaign: measurements, from which model error and prior scale are taken, and which cross-validate every size.
        accuracy: error in space (rms) that is enough, metres.
        **options: those of `SelectionOptions`, each by its name, and all at once as ``options``; names replace what is in those.

            ``count``: poses spread over the task.

            ``seed``: of that spread, and of the folds.

            ``folds``: of the cross-validation.

            ``noise``: the tracker's.

            ``hyperparameters``: what is known of model error and prior scale without a campaign.

            ``model_error``: standard deviation per axis of what the complete model does not explain, metres, without a campaign
            and hyperparameters; by default that of the robot's file, or of a typical robot (`model_error_of`).

    Raises:
        ReachError: the robot does not reach the task.
        CampaignError: the accuracy is below what even the full model is expected to reach, or too few rows.
    """
    expect_kinds(
        {"model": ErrorModel, "task": Task, "campaign": Campaign | None}, model=model, task=task, campaign=campaign
    )
    chosen = SelectionOptions.of(**options)
    reached = reach_task(model, task, chosen.count, chosen.seed)
    by, hyper = design_for(model, reached, task, campaign, chosen)
    order, expected = by.ladder()
    ladder = _ladder(model, order, expected, _cross_validate(model, campaign, order, hyper, chosen))
    k, why = _choose(ladder, accuracy)
    kept = sorted(set(range(len(model))) - set(order[:k]))
    poses = reached.q if campaign is None else np.concatenate([reached.q, campaign.q])
    elimination = identifiability(model, poses)
    return Selection(
        kept=tuple(model.names[i] for i in kept),
        dropped=_reasons(by, order[:k], expected, elimination, kept),
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
) -> tuple[Design, Hyperparameters]:
    """The design of a campaign for a task, with the hyperparameters that it shows; of assumed poses where there is none."""
    chosen = options or SelectionOptions()
    if campaign is None:
        assumed = reach_task(model, measuring_task(model, task), ASSUMED_POSES, chosen.seed + 1)
        rng, x = np.random.default_rng(chosen.seed), np.zeros(len(model))
        measured, _ = simulate(model, assumed.q, rng=rng, x=x, noise=chosen.noise)
        hyper = chosen.hyperparameters or assumed_hyperparameters(model, chosen.model_error)
    else:
        measured = campaign
        hyper = known_hyperparameters(identify(model, campaign, noise=chosen.noise), "what the campaign shows")
    by = design(
        model, measured, reached, noise=chosen.noise, model_error=hyper.model_error, prior_scale=hyper.prior_scale
    )
    return by, hyper


def _ladder(
    model: ErrorModel,
    order: list[int],
    expected: Float[np.ndarray, " sizes"],
    crossed: list[tuple[float, float]] | None,
) -> tuple[NestedModel, ...]:
    """Every size from the full model down to none, with its expected and its cross-validated error."""
    p = len(model)
    return tuple(
        NestedModel(
            size=p - k,
            dropped_next=model.names[order[k]] if k < p else "",
            expected=float(expected[k]),
            cross_validated=None if crossed is None else crossed[k][0],
            standard_error=None if crossed is None else crossed[k][1],
        )
        for k in range(p + 1)
    )


def _cross_validate(
    model: ErrorModel, campaign: Campaign | None, order: list[int], hyper: Hyperparameters, options: SelectionOptions
) -> list[tuple[float, float]] | None:
    """Mean error on left-out rows for every nested model, with its standard error over the rows; None without a campaign."""
    if campaign is None:
        return None
    n, p = len(campaign), len(model)
    if n < 2 * options.folds:
        raise CampaignError(
            f"{n} rows are too few for cross-validation in {options.folds} folds; measure more, or select without it"
        )
    parts = split_postures(campaign.q, options.folds, options.seed)
    held = hyper.held(FitOptions(noise=options.noise))
    out: list[tuple[float, float]] = []
    for k in range(p + 1):
        keep = tuple(model.names[i] for i in sorted(set(range(p)) - set(order[:k])))
        fit = partial(identify, model, options=replace(held, keep=keep))
        out.append(mean_over_rows(predict_left_out(fit, campaign, parts)))
    return out


def _choose(ladder: tuple[NestedModel, ...], accuracy: float | None) -> tuple[int, str]:
    """How many parameters go, and the rule that says so."""
    full = ladder[0].expected
    if accuracy is not None:
        if full > accuracy:
            raise CampaignError(
                f"an accuracy of {accuracy * 1e3:.3f} mm is out of reach: even the full model is expected to leave "
                f"{full * 1e3:.3f} mm rms over the task; measure more poses, nearer to the task, or allow more"
            )
        k = max(k for k, nested in enumerate(ladder) if nested.expected <= accuracy)
        return k, f"the smallest model expected to leave at most {accuracy * 1e3:g} mm rms over the task"
    enough = [k for k, nested in enumerate(ladder) if nested.expected <= SUFFICIENT * full]
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


def _reasons(
    by: Design,
    gone: list[int],
    expected: Float[np.ndarray, " sizes"],
    elimination: Identifiability,
    kept: list[int],
) -> dict[str, str]:
    """Why each dropped parameter is not in the model."""
    names, out = by.model.names, dict[str, str]()
    alone = np.sqrt(np.maximum(np.diag(by.influence), 0.0)) * by.prior
    for step, j in enumerate(gone):
        name = names[j]
        relation = _relation(by, j, kept)
        if name in elimination.zero:
            out[name] = "no effect on the position at any of these poses"
        elif alone[j] <= 1e-6 * expected[0]:
            out[name] = "moves the task only as tracker frame and targets do, which are fitted in any case"
        elif relation:
            out[name] = f"repeats {describe_combination(relation, {})}"
        elif alone[j] <= 0.1 * expected[0]:
            out[name] = (
                f"its tolerance moves the task by {alone[j] * 1e6:.1f} µm rms, once tracker frame and targets are fitted"
            )
        else:
            cost = (expected[step + 1] / expected[step] - 1.0) * 100
            out[name] = (
                f"not worth its variance: without it the expected error of {expected[step] * 1e6:.1f} µm changes by {cost:+.2f} %"
            )
    return out


def _relation(by: Design, j: int, kept: list[int]) -> dict[str, float]:
    """The combination of kept parameters that a dropped one equals, for campaign and task together; empty if none."""
    both = by.information / np.trace(by.information) + by.influence / np.trace(by.influence)
    if not kept or both[j, j] <= 0.0:
        return {}
    inner = both[np.ix_(kept, kept)]
    c = pseudo_invert_scaled(inner, rcond=1e-12) @ both[kept, j]
    left = both[j, j] - 2.0 * c @ both[kept, j] + c @ inner @ c
    if left > 1e-9 * both[j, j]:
        return {}
    weight = np.abs(c) * np.sqrt(np.diag(inner))
    return {by.model.names[kept[i]]: float(c[i]) for i in np.flatnonzero(weight > 1e-4 * weight.max())}


def _references(model: ErrorModel, by: Design, elimination: Identifiability) -> dict[str, tuple[int, float]]:
    """The published and the identifiable set in the same terms."""
    sets: dict[str, Int[np.ndarray, " k"]] = {"identifiable": model.indices(elimination.kept)}
    if model.robot.published.dropped:
        sets["published"] = model.indices(published_kept(model))
    return {name: (len(kept), by.expected_error(kept)) for name, kept in sets.items()}
