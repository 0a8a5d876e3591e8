"""How poses and parameters are chosen for a task, and what a study simulates: frozen values, each option declared once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from taskcal.arguments import checked
from taskcal.errors import TaskcalError, UnknownName
from taskcal.estimation.criteria import Criterion
from taskcal.identification.options import MAX_SCALE, MIN_SCALE
from taskcal.registration.options import TARGET_WITHIN, TargetWithin
from taskcal.short_repr import short_repr
from taskcal.virtual.options import SimulationOptions
from taskcal_groundwork.options import Option, OptionError, Seed, check

if TYPE_CHECKING:
    import numpy as np
    from jaxtyping import Float

    import taskcal
    from taskcal.observations.instrument import Instrument

# Of the figures below, the experiment is of 30 poses for a machining robot of 1.9 m with a parallelogram: the expected error by
# which poses are chosen, micrometres.

CANDIDATES = 10_000
"""Poses to choose among: 20.5 of 1000 or 3000, 20.4 of 10 000, which take a second."""

REFINEMENTS = 2
"""Rounds of refinement: 21.0 without, 20.7 after one, 20.4 after two, 20.0 after four, each 0.1 s."""

Stations = Annotated[
    int, Option(metavar="N", help="Places that the tracker is moved to, as many poses at each.", low=1)
]

ModelError = Annotated[
    float | None,
    Option(
        metavar="MM",
        help="Model error, 1σ per axis; by default the robot file's, or a typical robot's.",
        unit="mm",
        low=0.0,
    ),
]
"""Where no measurements tell it."""


def check_one_model_error(model_error: float | None, campaign: object, calibration: object) -> None:
    """See that what is known of the model error comes from one place.

    Raises:
        OptionError: a campaign or a calibration provides it, too.
    """
    if model_error is not None and campaign is not None:
        raise OptionError(
            "{model_error} conflicts with {campaign}, which already provides it; omit one", "campaign", "model_error"
        )
    if model_error is not None and calibration is not None:
        raise OptionError(
            "{model_error} conflicts with {calibration}, which already provides it; omit one",
            "calibration",
            "model_error",
        )


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class PlanOptions:
    """Options of a plan; `dataclasses.replace` gives others.

    Raises:
        WrongKind: a criterion that does not exist.
        WrongValue: options that cannot be, or not together.
    """

    seed: Seed = 0
    """Of the candidates and of the refinement; the same seed gives the same plan."""
    station: Annotated[
        "taskcal.Station | None",
        Option(
            metavar="STATION.toml",
            help="Tracker, reflectors and obstacles; by default one reflector at the TCP, always visible. Without a tracker "
            "only its obstacles count.",
            kind=Path,
        ),
    ] = None
    criterion: Annotated[Criterion, Option(help="Expected error over the task, or a classical criterion.")] = "task"
    campaign: Annotated[
        "taskcal.Campaign | None",
        Option(
            help="Already measured, with points; the plan extends it, with its own model error and prior scale.",
            alone=True,
        ),
    ] = None
    calibration: Annotated[
        "taskcal.Calibration | None",
        Option(
            help="Of the model, from points; the plan adds what lowers its uncertainty over the task the most, with its own model "
            "error and prior scale. It stands for its campaign, so that only one of the two is given.",
            alone=True,
        ),
    ] = None
    candidates: Annotated[
        "int | Float[np.ndarray, 'n joints']", Option(metavar="N", help="Candidate poses.", kind=int, low=1)
    ] = CANDIDATES
    """How many poses to choose among; or the joint positions themselves, radians, which are then not refined."""
    refine: Annotated[int, Option(help="Rounds of continuous refinement after the exchange.", low=0, alone=True)] = (
        REFINEMENTS
    )
    registration: Annotated[
        "taskcal.registration.Registration | None",
        Option(help="Where tracker and targets are, if known; a campaign or a calibration brings its own.", alone=True),
    ] = None
    noise: Annotated["taskcal.TrackerNoise | None", Option(help="The tracker's; None for the default.", alone=True)] = (
        None
    )
    model_error: ModelError = None
    """Of what geometry does not explain, metres (`model_error_of`). A campaign or a calibration brings its own."""
    prior_scale: Annotated[
        float, Option(help="Factor of the tolerances.", low=MIN_SCALE, high=MAX_SCALE, alone=True)
    ] = 1.0
    progress: Annotated[Callable[[str], None], Option(help="Told what is being done.", alone=True)] = lambda _: None
    observe: Annotated[
        "taskcal.observations.Instrument | None",
        Option(
            help="The instrument and its fixtures, not a tracker; station, registration and noise are a tracker's.",
            alone=True,
        ),
    ] = None
    stations: Stations = 1
    """The frame of each counts as unknown; poses are chosen as for one."""
    target_within: TargetWithin = TARGET_WITHIN
    """As of the fit that will follow: how far a target may be from where it is stated, metres; 0.1 m (1σ) counts at most. A
    calibration brings its own."""

    def __post_init__(self) -> None:
        check(PlanOptions, self)
        if self.campaign is not None and self.calibration is not None:
            raise OptionError(
                "give the campaign or the calibration from it; together they would count it twice",
                "campaign",
                "calibration",
            )
        check_one_model_error(self.model_error, self.campaign, self.calibration)
        if getattr(self.candidates, "shape", ())[:1] == (0,):
            raise OptionError("has no rows; give one or more", "candidates")
        if self.target_within != TARGET_WITHIN and self.calibration is not None:
            raise OptionError("the calibration has its own; omit it", "target_within", "calibration")
        if self.stations > 1 and (self.observe or self.campaign or self.calibration):
            raise OptionError(
                "stations are those of a tracker and of a plan that begins anew; leave out {observe}, {campaign} and {calibration}",
                *("stations", "observe", "campaign", "calibration"),
            )

    @property
    def instrument(self) -> "Instrument":
        """Instrument that measures."""
        from taskcal.observations.point import Tracker

        return self.observe or Tracker(station=self.station)


@dataclass(frozen=True, kw_only=True)
class PlannedPoses:
    """How many poses are planned, and kept out of what is fitted."""

    count: Annotated[int, Option(metavar="N", help="Poses to measure.", also="-n", low=1)] = 60
    kept_out: Annotated[
        int | None,
        Option(
            metavar="N",
            help="Random poses of the task in addition, which judge the calibration and are not fitted; every tenth pose "
            "repeats the first. For taskcal measure --program, which needs 6 or more to prove a tolerance.",
            low=1,
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class Mounting:
    """Where the tool carries what a plan without a tracker is for."""

    mounted: Annotated[
        tuple[float, float, float] | None,
        Option(
            metavar="X,Y,Z",
            help="Approximate position of ball, wire end or sensor in the tool frame; by default the TCP, or 100 mm before the "
            "flange of a robot without a tool.",
            unit="mm",
            low=-1e6,
            high=1e6,
        ),
    ] = None
    mounted_axis: Annotated[
        tuple[float, float, float] | None,
        Option(
            metavar="I,J,K",
            help="Direction of the stem or the camera in the tool frame; by default its z axis.",
            low=-1e6,
            high=1e6,
        ),
    ] = None

    def __post_init__(self) -> None:
        check(Mounting, self)
        if self.mounted_axis is not None and not any(self.mounted_axis):
            raise OptionError("0,0,0 is not a direction; write for example 0,0,1", "mounted_axis")


@checked
@dataclass(frozen=True, eq=False, kw_only=True)
class SelectionOptions:
    """Options of a choice of parameters; `dataclasses.replace` gives others."""

    count: Annotated[int, Option(help="Poses spread over the task.", low=1, alone=True)] = 200
    seed: Seed = 0
    """Of that spread, and of the folds."""
    folds: Annotated[int, Option(help="Parts of the cross-validation.", low=2, alone=True)] = 5
    noise: Annotated["taskcal.TrackerNoise | None", Option(help="The tracker's; None for the default.", alone=True)] = (
        None
    )
    hyperparameters: Annotated[
        "taskcal.identification.Hyperparameters | None",
        Option(help="What is known of model error and prior scale without a campaign.", alone=True),
    ] = None
    model_error: ModelError = None
    """Of what the complete model does not explain, metres, without a campaign and hyperparameters (`model_error_of`)."""
    progress: Annotated[Callable[[str], None], Option(help="Told what is being done.", alone=True)] = lambda _: None

    def __post_init__(self) -> None:
        check(SelectionOptions, self)


# What a study simulates.

PlanKind = Literal["planned", "random", "grid"]
PLANS: tuple[PlanKind, ...] = ("planned", "random", "grid")
MODELS = ("all", "selected", "published", "published-damped", "geometry", "auto")


@checked
@short_repr
@dataclass(frozen=True, eq=False, kw_only=True)
class StudyOptions:
    """Options of a study; `dataclasses.replace` gives others.

    Raises:
        UnknownName: a model that does not exist.
        WrongValue: options that cannot be, or not together.
    """

    robots: Annotated[int, Option(metavar="N", help="Virtual robots to draw.", low=1)] = 200
    counts: Annotated[Sequence[int], Option(help="Numbers of measured poses.", kind=int, low=1, alone=True)] = (30, 60)
    plans: Annotated[
        Sequence[PlanKind],
        Option(help="'planned' by a plan, 'random' or 'grid' in the task's own workspace.", alone=True),
    ] = ("planned", "random")
    models: Annotated[
        Sequence[str],
        Option(
            help="'all' parameters, those 'selected' for the task, the 'published' ones, or 'published-damped' without prior; "
            "'geometry' without the model's effects, or 'auto' with those that the data prove.",
            alone=True,
        ),
    ] = ("all",)
    stations: Stations = 1
    noise: Annotated["taskcal.TrackerNoise | None", Option(help="The tracker's; None for the default.", alone=True)] = (
        None
    )
    model_error: ModelError = None
    """Of what no parameter explains, metres, which every robot has at every pose (`model_error_of`)."""
    calibration: Annotated[
        "taskcal.Calibration | None",
        Option(
            help="Robots like this one, with defects and effects of the sizes that were found, and its model error, in place of "
            "the tolerances.",
            alone=True,
        ),
    ] = None
    observe: Annotated[
        Sequence[str],
        Option(
            help="How the robots are measured, each way as a simulation has it; 'socket+wire' shares the rows.",
            alone=True,
        ),
    ] = ("tracker",)
    """Where it is not by a tracker alone, errors are those that are left once the work's frame and the TCP were taught with the
    calibrated robot, and postures are drawn from the room that measuring may take about the task."""
    seed: Seed = 0
    """Of everything."""

    def __post_init__(self) -> None:
        check(StudyOptions, self)
        for name in ("counts", "plans", "models", "observe"):
            if not len(getattr(self, name)):
                raise OptionError("names nothing; give one or more", name)
        for name in self.models:
            if name not in MODELS:
                raise UnknownName("model", name, MODELS)
        from taskcal.observations.base import check_lengths

        for observe in self.observe:
            check_lengths(SimulationOptions(observe=observe, stations=self.stations).kinds.values())
        if not tracked(self.observe) and "planned" in self.plans:
            raise TaskcalError(
                "a study plans for a tracker alone; with other instruments give the plans random or grid, and see what to expect "
                "of a plan for one of them by plan(observe=…)"
            )

    @property
    def aligned(self) -> bool:
        """Whether errors are those of the shape alone, the same for all instruments."""
        return not tracked(self.observe)


def tracked(ways: Sequence[str]) -> bool:
    """Whether a tracker alone measures, each way."""
    return all(SimulationOptions(observe=observe).tracked for observe in ways)
