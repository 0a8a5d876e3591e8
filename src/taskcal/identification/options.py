"""How a fit is made, what is held out of it, and what is added to the geometry: frozen values, each option declared once."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from taskcal.arguments import checked
from taskcal.errors import TaskcalError
from taskcal.registration.options import TARGET_WITHIN, TargetWithin
from taskcal.short_repr import short_repr
from taskcal_groundwork.options import Option, OptionError, Seed, Written, check, options_of, split

if TYPE_CHECKING:
    import taskcal
    from taskcal.campaigns.campaign import Campaign
    from taskcal.robot.effects import Effect
    from taskcal.robot.error_model import ErrorModel

MIN_SCALE, MAX_SCALE = 1e-6, 1e6
"""Factors of the tolerances beyond which a prior holds a parameter at zero, or not at all, and its square leaves the range of
numbers."""

Estimate = Literal["estimate"]
Frames = Literal["fit", "fixed"]
GrossErrors = Literal["leave out", "keep"]
Grouping = Literal["neighbours", "blocks", "rows"]
"""What is held out together: neighbouring poses, rows that follow each other, or nothing but the row itself."""


@checked
@dataclass(frozen=True, eq=False, kw_only=True)
class FitOptions:
    """Options of a fit; `dataclasses.replace` gives others.

    Raises:
        WrongValue: a value that would silently mean something else, or that no campaign can have.
    """

    keep: Annotated[
        tuple[str, ...] | None,
        Option(
            metavar="NAME,…",
            help="Parameters to fit: names, symbols or frames (J2, tool); 'published', or 'none' for the frames alone.",
            kind=str,
            several=",",
            suggested=("published", "none"),
        ),
    ] = None
    """None for all. The others stay zero in the estimate. With the tolerances as prior, theirs stay in its covariance: the true
    robot varies in them all the same (`considered`). A prior that is given is taken for all that is believed."""
    prior: Annotated[
        "taskcal.GaussianPrior | Literal['tolerances'] | None",
        Option(help="Prior of the parameters.", kind=Literal["tolerances", "none"], words={"none": None}),
    ] = "tolerances"
    """``tolerances`` for the robot's own; a prior over the kept parameters; or None, when only Levenberg's damping holds
    undetermined directions, and the fit ends as soon as the objective falls by less than 10⁻⁶ of itself or the Newton decrement is
    below 10⁻²."""
    frames: Annotated[Frames, Option(help="Fit tracker frame and targets, or hold them as registered.")] = "fit"
    """``fit`` refines tracker frame and targets with the parameters, ``fixed`` holds them as registered."""
    registration: Annotated[
        "taskcal.registration.Registration | None",
        Option(
            metavar="poses|circles|REG.json",
            help="Start values of tracker frame and targets: all poses, axis circles, or a file of taskcal register.",
            kind=Path,
            words={"poses": None, "circles": "circles"},
            suggested=("poses", "circles"),
        ),
    ] = None
    """Tracker frame and targets to start from, or to hold; None to find them from the data."""
    model_error: Annotated[
        float | tuple[float, float] | Estimate,
        Option(
            metavar="MM",
            help="Model error, 1σ per axis; estimated by default.",
            kind=float,
            unit="mm",
            low=0.0,
            high=1e3,
        ),
    ] = "estimate"
    """Standard deviation of what the model cannot explain, metres (and radians, for poses); or estimated."""
    gross_errors: Annotated[
        GrossErrors, Option(help="Reject gross errors (at most 10 % of the rows) and list them, or keep them.")
    ] = "leave out"
    """``leave out`` rows that cannot be right beside all others (`gross_errors`), or ``keep`` them."""
    target_within: TargetWithin = TARGET_WITHIN
    """How far from the TCP a target may be found, metres. Where the poses do not locate it, it is taken to be at the TCP, uncertain
    by so much (1σ), and by 0.1 m at most."""
    prior_scale: Annotated[
        float | Estimate,
        Option(
            metavar="FACTOR",
            help="Factor of the tolerances; estimated by default.",
            kind=float,
            low=MIN_SCALE,
            high=MAX_SCALE,
        ),
    ] = "estimate"
    like: Annotated[
        "taskcal.Calibration | None",
        Option(
            metavar="OTHER.json",
            help="Calibration of a robot of the same make: its sizes and model error are expected of this one, unless this robot's "
            "rows contradict them.",
            kind=Path,
        ),
    ] = None
    """A remark of the calibration says what came of it."""
    noise: Annotated[
        "taskcal.TrackerNoise | None",
        Option(
            metavar="FACTOR",
            help="Tracker 1σ per maximum permissible error; 0.5 by default, 0.577 if rectangular.",
            named="mpe-to-sigma",
            kind=float,
            low=1e-3,
            high=1e3,
        ),
    ] = None
    """The tracker's, where the campaign does not state uncertainties; None for the default."""
    outlier_level: Annotated[
        float,
        Option(help="Chance of naming any outlier where there is none.", low=0.0, high=1.0, ends=False, alone=True),
    ] = 0.01

    def __post_init__(self) -> None:
        check(FitOptions, self)
        if self.prior is None and self.prior_scale != "estimate":
            raise OptionError("without a prior there is nothing to scale", "prior_scale", "prior")
        if self.prior is None and self.like is not None:
            raise OptionError("a sibling tells the size of the prior; keep the prior, or omit {like}", "like", "prior")

    def keeping(self, names: Iterable[str]) -> "FitOptions":
        """The options, with these parameters estimated too where not all are."""
        return self if self.keep is None else replace(self, keep=(*self.keep, *names))

    def without_exact(self, model: "ErrorModel") -> "FitOptions":
        """The options without the parameters whose tolerance says that they are exact, unless parameters are named."""
        from taskcal.robot.error_model import EXACT

        free = model.tolerances > EXACT
        if self.keep is not None or free.all():
            return self
        return replace(self, keep=tuple(name for name, is_free in zip(model.names, free, strict=True) if is_free))

    def described(self, model: "ErrorModel", campaign: "Campaign") -> dict[str, Any]:
        """Describe the options for a model and a campaign, as a file can hold them."""
        from taskcal.observations.base import TrackerNoise

        kept = range(len(model)) if self.keep is None else model.indices(self.keep)
        description = {
            "keep": "all" if len(kept) == len(model) else [model.names[i] for i in kept],
            "prior": self.prior if self.prior in (None, "tolerances") else "given",
            "noise": "stated" if campaign.uncertainty is not None else asdict(self.noise or TrackerNoise()),
            "frames": self.frames,
            "model_error": self.model_error,
            "prior_scale": self.prior_scale,
            "outlier_level": self.outlier_level,
            "gross_errors": self.gross_errors,
            "target_within": self.target_within,
        }
        if self.like is not None:
            description["like"] = self.like.origin
        return json.loads(json.dumps(description))  # lists for tuples


@dataclass(frozen=True, kw_only=True)
class GeometryOptions:
    """Which parameters a model has, before any of them is kept."""

    lengths_only: Annotated[
        bool, Option(help="Fit only the nominal lengths of the robot file, such as d2 and RL4.")
    ] = False


@checked
@dataclass(frozen=True, kw_only=True)
class Holdout:
    """What is held out: a share of the rows, once, or every row once, in folds; nothing by default.

    Raises:
        WrongValue: both a share and folds, or one of no meaning.
    """

    share: Annotated[
        float | None,
        Option(
            metavar="SHARE",
            help="Hold out about this share of the rows, and predict it.",
            named="holdout",
            shown="percent",
            low=0.0,
            high=1.0,
            ends=False,
        ),
    ] = None
    """The calibration is that of the other rows."""
    folds: Annotated[
        int | None,
        Option(metavar="K", help="Hold out each of K parts in turn, and predict it; then fit all rows.", low=2),
    ] = None
    """The calibration is that of all rows."""
    by: Annotated[
        Grouping,
        Option(
            help="Hold out groups of neighbouring poses, blocks of consecutive rows, or single rows at random (optimistic for "
            "clustered poses).",
            named="holdout-by",
        ),
    ] = "neighbours"
    seed: Seed = 0
    """Of the choice of groups."""

    def __post_init__(self) -> None:
        check(Holdout, self)
        if self.share is not None and self.folds is not None:
            raise OptionError("use {share} or {folds}, not both", "share", "folds")
        if self.share is None and self.folds is None and self.by != "neighbours":
            raise OptionError("nothing is held out; give {share} or {folds} too", "by", "share", "folds")

    @property
    def asked(self) -> bool:
        """Whether rows are to be held out."""
        return self.share is not None or self.folds is not None

    @property
    def fits(self) -> int:
        """Number of fits of the campaign."""
        return 1 + (self.folds or 0)


@checked
@short_repr
@dataclass(frozen=True, kw_only=True)
class EffectSearch:
    """What may be added to the geometry, and the criteria of acceptance."""

    effects: Annotated[
        "Sequence[taskcal.effects.Effect] | None",
        Option(
            metavar="auto|none|LIST",
            help="Non-geometric effects: 'auto' estimates all of them with their variances; a list adds the named effects without "
            "a significance test.",
            kind=str,
            words={"none": (), "auto": None},
            suggested=("none", "auto"),
        ),
    ] = None
    """Those to add without proof; None to try the candidates."""
    candidates: Annotated[
        "Sequence[taskcal.effects.Effect] | None",
        Option(
            help="Effects that compete; None for what every effect that is defined proposes for the robot.", alone=True
        ),
    ] = None
    """As `Effect.candidates` has them."""
    field: Annotated[bool, Option(help="Try a smooth function of all joints at each joint, which 'auto' includes.")] = (
        False
    )
    """Let the smooth field of all joints (`JointField`) take part, too."""
    folds: Annotated[int, Option(help="Parts of the cross-validation.", low=2, alone=True)] = 5
    seed: Annotated[int, Option(help="Seed of these parts.", low=0, alone=True)] = 0

    def __post_init__(self) -> None:
        check(EffectSearch, self)


# What was written of these groups.

NO_EFFECTS: Mapping[str, Any] = {"effects": ()}
"""That a search begins with where effects are asked for one by one."""


def check_together(search: Written[EffectSearch], geometry: GeometryOptions, fitting: Written[FitOptions]) -> None:
    """Check groups of a fit against one another.

    Raises:
        OptionError: two options contradict one another.
    """
    if search.effects is None and fitting.prior is None:
        raise OptionError(
            "'auto' weighs effects by their evidence, which needs a prior; list the effects, or keep the prior",
            "effects",
            "prior",
        )
    if geometry.lengths_only and fitting.keep == ("published",):
        raise OptionError("{keep} published selects geometric errors, not lengths; omit one", "lengths_only", "keep")


def read_effects(written: "str | Sequence[Effect] | None") -> "Sequence[Effect] | None":
    """Effects as a text names them with commas, or as one of its words stands for them; None to try the candidates.

    Raises:
        OptionError: there is no such effect, or one is named twice.
    """
    if not isinstance(written, str):
        return written
    words = next(one.option.words for one in options_of(EffectSearch) if one.field == "effects")
    return words[written] if written in words else tuple(map(_effect, split(written, "effects")))


def _effect(name: str) -> "Effect":
    if name in ("auto", "none"):
        raise OptionError("'{name}' cannot be combined; give it without other effects", "effects", name=name)
    from taskcal.robot.effects import parse_effect

    try:
        return parse_effect(name)
    except TaskcalError as error:
        raise OptionError("{error}; or auto, or none", "effects", error=str(error)) from error
