"""What a study simulates: one frozen value."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, TypedDict, Unpack

from taskcal.arguments import expect_kinds, with_choices
from taskcal.errors import TaskcalError, UnknownName
from taskcal.identification.calibration import Calibration
from taskcal.measurement.tracker import TrackerNoise
from taskcal.measurement.virtual_cell import SimulationOptions

PlanKind = Literal["planned", "random", "grid"]
PLANS: tuple[PlanKind, ...] = ("planned", "random", "grid")
MODELS = ("all", "selected", "published", "published-damped", "geometry", "auto")


class StudyChoices(TypedDict, total=False):
    """`StudyOptions` by keywords: all of them at once, some of them, or some that replace those of a whole."""

    options: "StudyOptions | None"
    robots: int
    counts: Iterable[int]
    plans: Iterable[PlanKind]
    models: Iterable[str]
    seed: int
    noise: TrackerNoise | None
    model_error: float | None
    calibration: Calibration | None
    observe: Iterable[str]


@dataclass(frozen=True, eq=False, kw_only=True)
class StudyOptions:
    """Options of a study; `dataclasses.replace` gives others.

    Raises:
        UnknownName: a plan or a model that does not exist.
    """

    robots: int = 200
    """How many true robots."""
    counts: tuple[int, ...] = (30, 60)
    """Numbers of measured poses."""
    plans: tuple[PlanKind, ...] = ("planned", "random")
    """``planned`` by `plan`, ``random`` or ``grid`` in the task's own workspace."""
    models: tuple[str, ...] = ("all",)
    """``all`` parameters, those ``selected`` for the task, the ``published`` ones, or ``published-damped`` without prior;
    ``geometry`` without the model's effects, or ``auto`` with those that the data prove."""
    seed: int = 0
    """Of everything."""
    noise: TrackerNoise | None = None
    """The tracker's; None for the default."""
    model_error: float | None = None
    """Standard deviation per axis of what no parameter explains, metres, which every robot has at every pose; None for that of
    the robot's file, or of a typical robot (`model_error_of`)."""
    calibration: Calibration | None = None
    """Robots like this one, with defects and effects of the sizes that were found, and its model error."""
    observe: tuple[str, ...] = ("tracker",)
    """How the robots are measured, each way as `simulate` has it: ``tracker``, ``socket``, ``socket+wire`` … Where it is not by a
    tracker alone, errors are those that are left once the work's frame and the tool point were taught with the calibrated robot,
    and postures are drawn from the room that measuring may take about the task."""

    def __post_init__(self) -> None:
        kinds = {"noise": TrackerNoise | None, "calibration": Calibration | None}
        expect_kinds(kinds, noise=self.noise, calibration=self.calibration)
        for kind in self.plans:
            if kind not in PLANS:
                raise UnknownName("plan", kind, PLANS)
        for name in self.models:
            if name not in MODELS:
                raise UnknownName("model", name, MODELS)
        for way in self.observe:
            SimulationOptions(observe=way)
        if self.aligned and "planned" in self.plans:
            raise TaskcalError(
                "a study plans for a tracker alone; with other ways to measure give the plans random or grid, and see what to "
                "expect of a plan for one of them by plan(observe=…)"
            )

    @property
    def aligned(self) -> bool:
        """Whether errors are those of the shape alone, the same for all ways to measure."""
        return self.observe != ("tracker",)

    @classmethod
    def of(cls, **choices: Unpack[StudyChoices]) -> "StudyOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        if "observe" in choices:
            choices["observe"] = tuple(choices["observe"])
        if "counts" in choices:
            choices["counts"] = tuple(choices["counts"])
        if "plans" in choices:
            choices["plans"] = tuple(choices["plans"])
        if "models" in choices:
            choices["models"] = tuple(choices["models"])
        return with_choices(choices.pop("options", None) or cls(), choices, "a study")
