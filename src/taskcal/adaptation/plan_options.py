"""How poses are chosen: one frozen value."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np
from jaxtyping import Float

from taskcal.adaptation.measuring_way import MeasuringWay
from taskcal.arguments import expect_kinds, with_choices
from taskcal.errors import UnknownName
from taskcal.estimation.experiment_design import CRITERIA, Criterion
from taskcal.identification.calibration import Calibration
from taskcal.measurement.campaign import Campaign
from taskcal.measurement.registration import Registration
from taskcal.measurement.station import Station
from taskcal.measurement.tracker import TrackerNoise
from taskcal.short_repr import short_repr

CANDIDATES = 10_000


class PlanChoices(TypedDict, total=False):
    """`PlanOptions` by keywords: all of them at once, some of them, or some that replace those of a whole."""

    options: "PlanOptions | None"
    seed: int
    station: Station | None
    criterion: Criterion
    campaign: Campaign | None
    calibration: Calibration | None
    candidates: int | Float[np.ndarray, "n joints"]
    refine: int
    registration: Registration | None
    noise: TrackerNoise | None
    model_error: float | None
    prior_scale: float
    progress: Callable[[str], None]
    observe: MeasuringWay | None


@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PlanOptions:
    """Options of a plan; `dataclasses.replace` gives others.

    Raises:
        UnknownName: a criterion that does not exist.
        ValueError: a campaign and a calibration.
    """

    seed: int = 0
    """Of the candidates and of the refinement; the same seed gives the same plan."""
    station: Station | None = None
    """Tracker, reflectors and keep-out boxes; without it one reflector at the tool point is always seen."""
    criterion: Criterion = "task"
    """``task`` for the expected task error, or D, A, E, O1–O5."""
    campaign: Campaign | None = None
    """Already measured, with points; the plan extends it, with its own model error and prior scale."""
    calibration: Calibration | None = None
    """Of the model, from points; the plan adds what lowers its uncertainty over the task the most, with its own model error
    and prior scale. It stands for its campaign, so that only one of the two is given."""
    candidates: int | Float[np.ndarray, "n joints"] = CANDIDATES
    """How many poses to choose among; or the joint positions themselves, radians, which are then not refined."""
    refine: int = 2
    """Rounds of continuous refinement after the exchange."""
    registration: Registration | None = None
    """Where tracker and targets are, if known; a campaign or a calibration brings its own."""
    noise: TrackerNoise | None = None
    """The tracker's; None for the default."""
    model_error: float | None = None
    """Standard deviation per axis of what geometry does not explain, metres; None for that of the robot's file, or of a typical
    robot (`model_error_of`). A campaign or a calibration brings its own."""
    prior_scale: float = 1.0
    """Factor of the tolerances."""
    progress: Callable[[str], None] = lambda _: None
    """Told what is being done."""
    observe: MeasuringWay | None = None
    """How to measure without a tracker, and what stands where; station, registration and noise are a tracker's."""

    def __post_init__(self) -> None:
        expect_kinds(
            {
                "campaign": Campaign | None,
                "calibration": Calibration | None,
                "station": Station | None,
                "registration": Registration | None,
                "noise": TrackerNoise | None,
                "observe": MeasuringWay | None,
            },
            campaign=self.campaign,
            calibration=self.calibration,
            station=self.station,
            registration=self.registration,
            noise=self.noise,
            observe=self.observe,
        )
        if self.campaign is not None and self.calibration is not None:
            raise ValueError("give the campaign or the calibration from it; together they would count it twice")
        if self.criterion not in CRITERIA:
            raise UnknownName("criterion", self.criterion, CRITERIA)

    @classmethod
    def of(cls, **choices: Unpack[PlanChoices]) -> "PlanOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        return with_choices(choices.pop("options", None) or cls(), choices, "a plan")
