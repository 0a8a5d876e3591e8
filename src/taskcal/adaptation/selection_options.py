"""How parameters are chosen for a task: one frozen value."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict, Unpack

from taskcal.arguments import expect_kinds, with_choices
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.measurement.tracker import TrackerNoise


class SelectionChoices(TypedDict, total=False):
    """`SelectionOptions` by keywords: all of them at once, some of them, or some that replace those of a whole."""

    options: "SelectionOptions | None"
    count: int
    seed: int
    folds: int
    noise: TrackerNoise | None
    hyperparameters: Hyperparameters | None
    model_error: float | None
    progress: Callable[[str], None]


@dataclass(frozen=True, eq=False, kw_only=True)
class SelectionOptions:
    """Options of a choice of parameters; `dataclasses.replace` gives others."""

    count: int = 200
    """Poses spread over the task."""
    seed: int = 0
    """Of that spread, and of the folds."""
    folds: int = 5
    """Of the cross-validation."""
    noise: TrackerNoise | None = None
    """The tracker's; None for the default."""
    hyperparameters: Hyperparameters | None = None
    """What is known of model error and prior scale without a campaign."""
    model_error: float | None = None
    """Standard deviation per axis of what the complete model does not explain, metres, without a campaign and hyperparameters;
    None for that of the robot's file, or of a typical robot (`model_error_of`)."""
    progress: Callable[[str], None] = lambda _: None
    """Told what is being done."""

    def __post_init__(self) -> None:
        expect_kinds(
            {"noise": TrackerNoise | None, "hyperparameters": Hyperparameters | None},
            noise=self.noise,
            hyperparameters=self.hyperparameters,
        )

    @classmethod
    def of(cls, **choices: Unpack[SelectionChoices]) -> "SelectionOptions":
        """Options by keywords, those not named as in ``options``, or as by default.

        Raises:
            TypeError: an option that does not exist; the message names all.
        """
        return with_choices(choices.pop("options", None) or cls(), choices, "a selection")
