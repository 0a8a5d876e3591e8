"""``--observe``: the instrument, and what its kind lets the user state of fixtures and of what the tool carries."""

from collections.abc import Mapping
from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.observations import Fixtures, Instrument, instrument_classes, load_fixtures
from taskcal.observations.point import Tracker
from taskcal.planning.options import Mounting
from taskcal_groundwork.options import OptionError, StatedOption, options_of

if TYPE_CHECKING:
    import numpy as np


STEM_MM = 100.0
"""How far before the flange the tool carries something, where the robot's file knows of no tool."""

TRACKER = "tracker"
"""The instrument where none is named."""


def _stated() -> dict[str, dict[str, StatedOption]]:
    """Options of the instruments, by field of `ObservingOptions` and by instrument."""
    out: dict[str, dict[str, StatedOption]] = {}
    for name, instrument in instrument_classes().items():
        for one in options_of(instrument):
            out.setdefault(one.name.replace("-", "_"), {})[name] = one
    return out


STATED = _stated()


@dataclass(frozen=True, kw_only=True)
class _Observing(Mounting):
    """Common part of the options of all instruments.

    Raises:
        OptionError: an option of another instrument, or numbers that cannot be.
    """

    observe: str | None = option(
        None, "INSTRUMENT", f"Instrument: {', '.join(instrument_classes())}.", words={TRACKER: None}
    )
    """None for a tracker."""

    def __post_init__(self) -> None:
        super().__post_init__()
        check_instruments(self.observe or TRACKER, several=False)
        for name in ("mounted", "mounted_axis"):
            if getattr(self, name) is not None and not self.fixed:
                raise OptionError("this is not of {observe} tracker", name, "observe")
        for name, by_instrument in STATED.items():
            text = getattr(self, name)
            if text is not None and (self.observe or TRACKER) not in by_instrument:
                known = " or ".join(by_instrument)
                raise OptionError(
                    "this is of {observe} {known}; name that, or leave it out", name, "observe", known=known
                )
            if text is not None:
                _value(by_instrument[self.observe or TRACKER], name, text)

    @property
    def instrument(self) -> type[Instrument]:
        """Instrument that measures."""
        return instrument_classes()[self.observe or TRACKER]

    @property
    def fixed(self) -> bool:
        """Whether a tracker does not measure."""
        return not self.instrument.kind.in_tracker

    @property
    def own(self) -> Mapping[str, StatedOption]:
        """Options of the instrument, by field."""
        return {name: by[self.observe] for name, by in STATED.items() if self.observe in by}

    @property
    def stated(self) -> Path | None:
        """File of fixtures."""
        return next((getattr(self, name) for name, one in self.own.items() if one.field == "fixtures"), None)

    def on_tool(self, model: "taskcal.ErrorModel") -> "np.ndarray":
        """Pose of the mounted item in the tool frame."""
        import numpy as np

        from taskcal.geometry import se3
        from taskcal.task.orientation import towards

        bare = np.allclose(model.robot.T_flange_tool, np.eye(4))
        position = self.mounted or ((0.0, 0.0, STEM_MM * 1e-3) if bare else (0.0, 0.0, 0.0))
        return se3.pose(towards(np.array(self.mounted_axis or (0.0, 0.0, 1.0), dtype=float)), np.array(position))

    def check(self, also: Any) -> None:
        """Check that an option of campaigns without a campaign is of the instrument.

        Raises:
            OptionError: it is not.
        """
        for name, instrument in instrument_classes().items():
            for shared in instrument.shares:
                if getattr(also, shared, None) and shared not in self.instrument.shares:
                    raise OptionError(
                        "without a campaign this is of {observe} {known}; name that, or leave it out",
                        *(shared, "observe"),
                        known=name,
                    )

    def load(
        self,
        model: "taskcal.ErrorModel",
        task: "taskcal.Task",
        station: "taskcal.Station | None",
        also: Any,
    ) -> Instrument:
        """The instrument in the task's cell.

        Args:
            model: of the robot.
            task: what it has to do.
            station: of a tracker; of other instruments its boxes count.
            also: options of campaigns (`CampaignOptions`), some of which are of instruments, too.

        Raises:
            FileError: a file cannot be read.
            ReachError: no fixtures are stated, and the robot does not reach the task.
        """
        if not self.fixed:
            return Tracker(station=station)
        stated: dict[str, Any] = {"keep_out": () if station is None else station.keep_out}
        for name, one in self.own.items():
            if (text := getattr(self, name)) is not None:
                stated[one.field] = _value(one, name, text)
        stated |= {option: value for option in self.instrument.shares if (value := getattr(also, option)) is not None}
        if isinstance(path := stated.pop("fixtures", None), Path):
            stated["fixtures"] = load_fixtures(path, self.instrument.kind.instrument)
        return self.instrument.set_up(model, task, self.on_tool(model), **stated)


def _option(name: str, by_instrument: Mapping[str, StatedOption]) -> tuple[str, Any, Any]:
    """Name, type and declaration of an option that one or several instruments have; each has its own bounds."""
    first = next(iter(by_instrument.values()))
    told = "; ".join(dict.fromkeys(one.option.help for one in by_instrument.values()))
    help_ = told if told.endswith(".") else f"{told[0].upper()}{told[1:]}."
    kind: Any = str if first.numbers else first.kind
    return name, kind | None, option(None, first.option.metavar, help_)


if TYPE_CHECKING:
    ObservingOptions = _Observing
else:
    ObservingOptions = make_dataclass(
        "ObservingOptions",
        [_option(name, by_instrument) for name, by_instrument in STATED.items()],
        bases=(_Observing,),
        frozen=True,
        kw_only=True,
    )


def _value(one: StatedOption, name: str, text: Any) -> Any:
    """Value of an instrument's field by what is written.

    Raises:
        OptionError: it cannot be.
    """
    try:
        value = one.value(text)
        one.check(value)
    except OptionError as wrong:
        raise OptionError(wrong.template, name, **wrong.values) from wrong
    return value


def describe_fixtures(fixtures: Fixtures) -> list[dict[str, Any]]:
    """Name, place in millimetres and direction of every fixture."""
    return [
        {"name": name, "position_mm": (position * 1e3).tolist(), "direction": direction.tolist()}
        for name, position, direction in zip(fixtures.names, fixtures.position, fixtures.direction, strict=True)
    ]


# Instruments that an option names.


def check_instruments(observe: str, *, several: bool = True) -> str:
    """The names of one instrument or several with a plus between, all of them known.

    Raises:
        typer.BadParameter: there is no such instrument, or there are several where one is asked for.
    """
    from taskcal.errors import CampaignError, UnknownName
    from taskcal.observations import instrument_of

    if not several and "+" in observe:
        raise typer.BadParameter(
            f"'{observe}' names several instruments; name one, or simulate what several give by taskcal study",
            param_hint="--observe",
        )
    try:
        if not several:
            instrument_of(observe)
            return observe
        return taskcal.virtual.SimulationOptions(observe=observe).observe
    except (UnknownName, CampaignError) as error:
        raise typer.BadParameter(str(error), param_hint="--observe") from error
