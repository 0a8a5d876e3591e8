"""How a fit is made: one frozen value that is handed on."""

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Literal, TypedDict, Unpack

import numpy as np

from taskcal.arguments import checked, options_of
from taskcal.campaigns.campaign import Campaign
from taskcal.estimation.prior import GaussianPrior, Loss, Squared
from taskcal.identification.calibration import Calibration
from taskcal.observations.base import TrackerNoise
from taskcal.registration.plausibility import TARGET_WITHIN
from taskcal.registration.registration import Registration
from taskcal.robot.error_model import ErrorModel

Estimate = Literal["estimate"]
Prior = GaussianPrior | Literal["tolerances"] | None
Frames = Literal["fit", "fixed"]

EXACT = 2e-9
"""Tolerance, metres or radians, up to which a parameter is taken for exact: those of a wrist whose pose is given have 1 nm."""

GrossErrors = Literal["leave out", "keep"]

LARGEST_MODEL_ERROR = 1.0
"""Metres (and radians, for poses): more is no calibration's concern."""

LARGEST_TARGET_WITHIN = 100.0
"""Metres from the TCP: no robot carries a tool that is longer."""

SMALLEST_PRIOR_SCALE, LARGEST_PRIOR_SCALE = 1e-6, 1e6
"""Beyond, the prior holds a parameter at zero, or not at all, and its square leaves the range of numbers."""


def check_target_within(metres: float) -> None:
    """Check a limit of targets' distances from the TCP.

    Raises:
        ValueError: no limit that a robot can have.
    """
    if not _within(metres, 0.0, LARGEST_TARGET_WITHIN):
        raise ValueError(f"target_within is {metres!r}; give metres from 0 to {LARGEST_TARGET_WITHIN:g}")


class FitChoices(TypedDict, total=False):
    """`FitOptions` by keywords: all of them at once, some of them, or some that replace those of a whole."""

    options: "FitOptions | None"
    keep: Iterable[str] | None
    prior: Prior
    loss: Loss | None
    noise: TrackerNoise | None
    registration: Registration | None
    frames: Frames
    model_error: float | tuple[float, float] | Estimate
    prior_scale: float | Estimate
    outlier_level: float
    gross_errors: GrossErrors
    target_within: float
    like: Calibration | None


@checked
@dataclass(frozen=True, eq=False, kw_only=True)
class FitOptions:
    """Options of a fit; `dataclasses.replace` gives others.

    Raises:
        ValueError: a value that would silently mean something else, or that no campaign can have.
    """

    keep: tuple[str, ...] | None = None
    """Names of the parameters to estimate; None for all."""
    prior: Prior = "tolerances"
    """``tolerances`` for the robot's own; a prior over the kept parameters; or None."""
    loss: Loss = field(default_factory=Squared)
    """How much a large residual counts."""
    noise: TrackerNoise | None = None
    """The tracker's, where the campaign does not state uncertainties; None for the default."""
    registration: Registration | None = None
    """Tracker frame and targets to start from, or to hold; None to find them from the data."""
    frames: Frames = "fit"
    """``fit`` refines tracker frame and targets with the parameters, ``fixed`` holds them as registered."""
    model_error: float | tuple[float, float] | Estimate = "estimate"
    """Standard deviation of what the model cannot explain, metres (and radians, for poses); or estimated."""
    prior_scale: float | Estimate = "estimate"
    """Common factor of the prior's standard deviations; or estimated."""
    outlier_level: float = 0.01
    """Chance of naming any outlier where there is none."""
    gross_errors: GrossErrors = "leave out"
    """``leave out`` rows that cannot be right beside all others, up to a tenth of them, or ``keep`` them."""
    target_within: float = TARGET_WITHIN
    """How far from the TCP a target may be found, metres; where the poses do not locate it, its uncertainty (1σ), 0.1 at most."""
    like: Calibration | None = None
    """Calibration of a robot of the same make, whose sizes of groups and errors of poses are expected of this one; None to expect
    what is expected of any robot."""

    def __post_init__(self) -> None:
        check_target_within(self.target_within)
        errors = self.model_error if isinstance(self.model_error, tuple) else (self.model_error,)
        if self.model_error != "estimate" and not all(_within(e, 0.0, LARGEST_MODEL_ERROR) for e in errors):
            raise ValueError(
                f"model_error is {self.model_error!r}; give 'estimate', or metres from 0 to {LARGEST_MODEL_ERROR:g}"
            )
        if self.prior_scale != "estimate" and not _within(self.prior_scale, SMALLEST_PRIOR_SCALE, LARGEST_PRIOR_SCALE):
            raise ValueError(
                f"prior_scale is {self.prior_scale!r}; give 'estimate', or a factor from {SMALLEST_PRIOR_SCALE:g} to "
                f"{LARGEST_PRIOR_SCALE:g}"
            )
        if self.like is not None and self.prior is None:
            raise ValueError("like needs a prior, whose size it tells; keep the prior, or leave out like")
        if not (_within(self.outlier_level, 0.0, 1.0) and 0.0 < self.outlier_level < 1.0):
            raise ValueError(f"outlier_level is {self.outlier_level!r}; give a chance between 0 and 1, such as 0.01")

    @classmethod
    def of(cls, **choices: Unpack[FitChoices]) -> "FitOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        if "loss" in choices and choices["loss"] is None:
            choices["loss"] = Squared()
        return options_of(cls, choices, "a fit")

    def keeping(self, names: Iterable[str]) -> "FitOptions":
        """The options, with these parameters estimated too where not all are."""
        return self if self.keep is None else replace(self, keep=(*self.keep, *names))

    def without_exact(self, model: ErrorModel) -> "FitOptions":
        """The options without the parameters whose tolerance says that they are exact, unless parameters are named."""
        free = model.tolerances > EXACT
        return (
            self
            if self.keep is not None or free.all()
            else replace(self, keep=tuple(np.array(model.names)[free].tolist()))
        )

    def described(self, model: ErrorModel, campaign: Campaign) -> dict[str, Any]:
        """Describe the options for a model and a campaign, as a file can hold them."""
        kept = range(len(model)) if self.keep is None else model.indices(self.keep)
        loss = {"kind": type(self.loss).__name__.lower()}
        model_error = list(self.model_error) if isinstance(self.model_error, tuple) else self.model_error
        description = {
            "keep": "all" if len(kept) == len(model) else [model.names[i] for i in kept],
            "prior": "given" if isinstance(self.prior, GaussianPrior) else self.prior,
            "loss": loss if isinstance(self.loss, Squared) else {**loss, **asdict(self.loss)},
            "noise": "stated" if campaign.uncertainty is not None else asdict(self.noise or TrackerNoise()),
            "frames": self.frames,
            "model_error": model_error,
            "prior_scale": self.prior_scale,
            "outlier_level": self.outlier_level,
            "gross_errors": self.gross_errors,
            "target_within": self.target_within,
        }
        if self.like is not None:
            description["like"] = self.like.origin
        return json.loads(json.dumps(description))  # lists for tuples


def _within(value: object, least: float, most: float) -> bool:
    """Whether it is a number in these bounds; what is not a number (NaN) is not."""
    return isinstance(value, int | float) and least <= value <= most
