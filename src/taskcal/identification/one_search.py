"""From a geometric calibration to the one model: which effects take part, the orders that are sharp, and what each is worth."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Int

from taskcal.identification.calibration import Calibration
from taskcal.identification.fit_options import FitOptions
from taskcal.identification.group_validation import LeftOutErrors, validate_groups
from taskcal.identification.observation_layout import layout_of, problem_of
from taskcal.identification.one_calibration import calibrate, log_evidence
from taskcal.identification.one_model import EMPTY, MOST_ROUNDS, OneFit, OneModel, assemble, fit_one_model
from taskcal.identification.problem import Problem
from taskcal.identification.row_errors import RowErrors
from taskcal.identification.sharp_orders import as_effects, find_clear_orders, find_sharp_orders
from taskcal.measurement.campaign import Campaign
from taskcal.robot.effects import SPECTRUM, Effect
from taskcal.robot.error_model import ErrorModel

TOGETHER = "geometry and all effects"
SHARPENING = "orders of gears and motors"
LEAVING_OUT = "cross-validation"

LARGE = 2.0
"""Log variance of every group to start from: from a size that is next to nothing the scoring would hardly come back."""

SHARPENINGS = 4
"""Times that sharp orders are looked for; each finds what stood behind the clearest ones."""

SHARPENING_ROUNDS = 2
"""Of a fit between, which need not be at its end."""

FEW = 1e-6
"""Least standard deviation of single poses to start from, metres and radians."""


@dataclass(frozen=True, eq=False, kw_only=True)
class OneModelFound:
    """The one model of a campaign."""

    fitted: OneFit
    calibration: Calibration
    errors: LeftOutErrors
    effects: tuple[Effect, ...]
    """All that take part, beside those of the model it started from."""


def find_one_model(
    base: Calibration,
    campaign: Campaign,
    competing: Sequence[Effect],
    instead: Sequence[Effect],
    parts: Sequence[Int[np.ndarray, " _"]],
    options: FitOptions,
    *,
    seed: int,
    progress: Callable[[str], None],
) -> OneModelFound:
    """Geometry and all effects at once.

    Args:
        base: a calibration of the geometry, and of effects that are certain.
        campaign: the measurements.
        competing: effects that take part, each as far as the data prove it.
        instead: effects that replace those with which they have parameters in common, where the evidence is for them.
        parts: rows of each fold of the cross-validation.
        options: of the fit; `keep` names geometric parameters.
        seed: of draws.
        progress: told what is being done.

    Raises:
        FitError: the fit ran away.
    """
    progress(TOGETHER)
    effects = tuple(competing)
    fitted = _fit(base, campaign, effects, options, None)
    for other in instead:
        progress(other.name)
        replaced = (*(effect for effect in effects if not _share(effect, other, base.model)), other)
        tried = _fit(base, campaign, replaced, options, None)
        if log_evidence(tried) > log_evidence(fitted):
            effects, fitted = replaced, tried
    competing = effects
    if SPECTRUM in effects:
        sharp: list[tuple[str, float]] = []
        clear: dict[str, tuple[str, float]] = {}
        for _ in range(SHARPENINGS):
            progress(SHARPENING)
            clearer = find_clear_orders(fitted, SPECTRUM.name)
            new = [order for order in find_sharp_orders(fitted, max(SPECTRUM.orders) + 0.5) if order not in sharp]
            if not new and not clearer:
                break
            sharp, clear = sharp + new, clear | clearer
            effects = (*competing, *as_effects(sharp))
            fitted = _fit(base, campaign, effects, options, fitted, SHARPENING_ROUNDS, clear)
        if sharp or clear:
            fitted = _fit(base, campaign, effects, options, fitted, apart=clear)
    progress(LEAVING_OUT)
    names = [effect.name for effect in (*base.model.effects, *effects)]
    errors = validate_groups(fitted, parts, names, np.random.default_rng(seed))
    calibration = calibrate(fitted, campaign, options, errors.stretch, np.random.default_rng(seed))
    return OneModelFound(fitted=fitted, calibration=calibration, errors=errors, effects=effects)


def _fit(
    base: Calibration,
    campaign: Campaign,
    effects: Sequence[Effect],
    options: FitOptions,
    before: OneFit | None,
    most_rounds: int = MOST_ROUNDS,
    apart: Mapping[str, tuple[str, float]] = EMPTY,
) -> OneFit:
    model = base.model
    for effect in effects:
        model = model + effect
    problem = _problem(base, model, campaign, options)
    one = assemble(problem, options.keep, options, apart)
    start, names = problem.frames.start(), problem.frames.names
    held = dict(zip(base.all_names, base.z, strict=True))
    if before is not None:
        held |= dict(zip(before.one.problem.frames.names, before.z, strict=True))
    for i, name in enumerate(names):
        start[i] = held.get(name, start[i])
    errors = _first_errors(base, options, len(model.robot.joints)) if before is None else before.errors
    weights = None if before is None else before.weights
    return fit_one_model(one, start, errors, options, _first_sizes(one, before), weights, most_rounds)


def _share(one: Effect, other: Effect, model: ErrorModel) -> bool:
    """Whether two effects have a parameter in common."""
    return bool(set(one.term(model.robot).names) & set(other.term(model.robot).names))


def _problem(base: Calibration, model: ErrorModel, campaign: Campaign, options: FitOptions) -> Problem:
    layout = layout_of(model, np.arange(len(model)), base.layout.registration, campaign, fixed=base.layout.fixed_frames)
    return problem_of(layout, campaign, options.noise)


def _first_sizes(one: OneModel, before: OneFit | None) -> np.ndarray:
    """Large ones, or those of the fit before."""
    known = {} if before is None else dict(zip(before.one.labels, before.found.evidence.log_variances, strict=True))
    return np.array([known.get(label, LARGE) for label in one.labels])


def _first_errors(base: Calibration, options: FitOptions, joints: int) -> RowErrors:
    """Half of what geometry alone left, of every kind; or what was given, and nothing else."""
    given = not isinstance(options.model_error, str)
    size = [max(error if given else 0.5 * error, 0.0 if given else FEW) for error in base.model_error]
    return RowErrors(
        position=max(size[0] ** 2, 1e-14),
        rotation=max(size[1] ** 2, 1e-14) if base.layout.block_size == 6 else None,
        joints=np.full(joints, 1e-14 if given else size[0] ** 2),
        searched=not given,
    )
