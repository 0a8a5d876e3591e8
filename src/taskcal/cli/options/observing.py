"""``--observe``: the instrument, and what its kind lets the user state of fixtures and of what the tool carries."""

from dataclasses import dataclass, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import taskcal
from taskcal.cli.command import option
from taskcal.cli.output import info, show
from taskcal.observations import Fixtures, Instrument, Setting, instrument_classes, load_fixtures
from taskcal.report.content import Column, Table

if TYPE_CHECKING:
    import numpy as np


STEM_MM = 100.0
"""How far before the flange the tool carries something, where the robot's file knows of no tool."""

TRACKER = "tracker"
"""The instrument where none is named."""


def _settings() -> dict[str, dict[str, Setting]]:
    """Settings of the instruments, by option and instrument."""
    out: dict[str, dict[str, Setting]] = {}
    for name, instrument in instrument_classes().items():
        for setting in instrument.settings:
            out.setdefault(setting.option, {})[name] = setting
    return out


SETTINGS = _settings()


@dataclass(frozen=True, kw_only=True)
class _Observing:
    """Common part of the options of all instruments.

    Raises:
        typer.BadParameter: an option of another instrument, or numbers that cannot be.
    """

    observe: str = option(TRACKER, "INSTRUMENT", f"Instrument: {', '.join(instrument_classes())}.")
    mounted_mm: str | None = option(
        None,
        "X,Y,Z",
        "Approximate position of ball, wire end or sensor in the tool frame; by default the TCP, or 100 mm before the "
        "flange of a robot without a tool.",
    )
    mounted_axis: str | None = option(
        None, "I,J,K", "Direction of the stem or the camera in the tool frame; by default its z axis."
    )

    def __post_init__(self) -> None:
        check_instruments(self.observe, several=False)
        for name in ("mounted_mm", "mounted_axis"):
            if getattr(self, name) is not None and not self.fixed:
                raise typer.BadParameter(f"this is not of --observe {TRACKER}", param_hint=_name(name))
        for name, by_instrument in SETTINGS.items():
            text = getattr(self, _field(name))
            if text is not None and self.observe not in by_instrument:
                raise typer.BadParameter(
                    f"this is of --observe {' or '.join(by_instrument)}; name that, or leave it out", param_hint=name
                )
            if text is not None:
                _values(by_instrument[self.observe], text)
        _vector(self.mounted_mm, "--mounted-mm")
        axis = _vector(self.mounted_axis, "--mounted-axis")
        if axis is not None and not any(axis):
            raise typer.BadParameter("0,0,0 is not a direction; write for example 0,0,1", param_hint="--mounted-axis")

    @property
    def instrument(self) -> type[Instrument]:
        """Instrument that measures."""
        return instrument_classes()[self.observe]

    @property
    def fixed(self) -> bool:
        """Whether a tracker does not measure."""
        return not self.instrument.kind.in_tracker

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that are read."""
        return () if self.stated is None else (self.stated,)

    @property
    def stated(self) -> Path | None:
        """File of fixtures."""
        return next(
            (
                getattr(self, _field(setting.option))
                for setting in self.instrument.settings
                if setting.fields == ("fixtures",)
            ),
            None,
        )

    def mounted(self, model: "taskcal.ErrorModel") -> "np.ndarray":
        """Pose of the mounted item in the tool frame."""
        import numpy as np

        from taskcal.geometry import se3
        from taskcal.task.orientation import towards

        given = _vector(self.mounted_mm, "--mounted-mm")
        bare = np.allclose(model.robot.T_flange_tool, np.eye(4))
        position = np.array(given or ((0.0, 0.0, STEM_MM) if bare else (0.0, 0.0, 0.0)), dtype=float) * 1e-3
        return se3.pose(
            towards(np.array(_vector(self.mounted_axis, "--mounted-axis") or (0.0, 0.0, 1.0), dtype=float)), position
        )

    def check(self, also: Any) -> None:
        """Check that an option of campaigns without a campaign is of the instrument.

        Raises:
            typer.BadParameter: it is not.
        """
        for name, instrument in instrument_classes().items():
            for shared in instrument.shares:
                if getattr(also, shared, None) and shared not in self.instrument.shares:
                    raise typer.BadParameter(
                        f"without a campaign this is of --observe {name}; name that, or leave it out",
                        param_hint=_name(shared),
                    )

    def load(
        self,
        model: "taskcal.ErrorModel",
        task: "taskcal.Task",
        keep_out: "tuple[taskcal.kinematics.Box, ...]",
        also: Any,
    ) -> Instrument | None:
        """The instrument in the task's cell; None for a tracker.

        Args:
            model: of the robot.
            task: what it has to do.
            keep_out: boxes.
            also: options of campaigns (`CampaignOptions`), some of which are of instruments, too.

        Raises:
            FileError: a file cannot be read.
            ReachError: no fixtures are stated, and the robot does not reach the task.
        """
        if not self.fixed:
            return None
        stated: dict[str, Any] = {"keep_out": keep_out}
        for setting in self.instrument.settings:
            if (text := getattr(self, _field(setting.option))) is not None:
                stated |= _values(setting, text)
        stated |= {option: value for option in self.instrument.shares if (value := getattr(also, option)) is not None}
        if isinstance(path := stated.pop("fixtures", None), Path):
            stated["fixtures"] = load_fixtures(path, self.observe)
        return self.instrument.set_up(model, task, self.mounted(model), **stated)


def _field(option: str) -> str:
    return option.removeprefix("--").replace("-", "_")


def _option(name: str, by_instrument: dict[str, Setting]) -> tuple[str, Any, Any]:
    """Name, type and declaration of an option that one or several instruments have."""
    first = next(iter(by_instrument.values()))
    texts = dict.fromkeys(setting.help for setting in by_instrument.values())
    told = "; ".join(texts)
    kind: Any = Path if first.fields == ("fixtures",) else str if len(first.fields) > 1 else float
    help_ = told if told.endswith(".") else f"{told[0].upper()}{told[1:]}."
    return _field(name), kind | None, option(None, first.metavar, help_)


if TYPE_CHECKING:
    ObservingOptions = _Observing
else:
    ObservingOptions = make_dataclass(
        "ObservingOptions",
        [_option(name, by_instrument) for name, by_instrument in SETTINGS.items()],
        bases=(_Observing,),
        frozen=True,
        kw_only=True,
    )


def _values(setting: Setting, text: Any) -> dict[str, Any]:
    """Fields of an instrument by what an option states.

    Raises:
        typer.BadParameter: numbers that cannot be.
    """
    if isinstance(text, Path):
        return {setting.fields[0]: text}
    if len(setting.fields) == 1:
        if not 0.0 < text < setting.below:
            bounds = "above zero" if setting.below == float("inf") else f"between 0 and {setting.below:g}"
            raise typer.BadParameter(f"{text:g} is not {bounds}", param_hint=setting.option)
        return {setting.fields[0]: text * setting.factor}
    low, high = _numbers(text, 2, setting.option)
    if not 0.0 <= low < high:
        raise typer.BadParameter(
            f"'{text}' is not a lower and a higher limit; write for example 100,2000", param_hint=setting.option
        )
    return dict(zip(setting.fields, (low * setting.factor, high * setting.factor), strict=True))


def _name(option: str) -> str:
    return f"--{option.replace('_', '-')}"


def _vector(text: str | None, option: str) -> tuple[float, ...] | None:
    return None if text is None else _numbers(text, 3, option)


def _numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    """Numbers parted by commas.

    Raises:
        typer.BadParameter: they are not so many finite numbers.
    """
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(abs(number) <= 1e6 for number in numbers):
        raise typer.BadParameter(f"'{text}' is not {count} numbers with commas between them", param_hint=option)
    return numbers


# What ``taskcal plan`` says of a plan without a tracker: fixtures, what to check, what to write down.

MAX_NAMED = 12
"""Poses that a message names."""


def describe_fixtures(fixtures: Fixtures) -> list[dict[str, Any]]:
    """Name, place in millimetres and direction of every fixture."""
    return [
        {"name": name, "position_mm": (position * 1e3).tolist(), "direction": direction.tolist()}
        for name, position, direction in zip(fixtures.names, fixtures.position, fixtures.direction, strict=True)
    ]


def tell_how_to_measure(plan: "taskcal.Plan", robot: "taskcal.Robot", *, stated: bool) -> None:
    """Show the fixtures with their numbers of poses, and say what to check and to write down.

    Args:
        plan: without a tracker.
        robot: the robot.
        stated: whether a file states the fixtures.
    """
    instrument = plan.instrument
    if instrument.label:
        _show_fixtures(plan, "as stated" if stated else "assumed")
    info(instrument.instructions)
    if instrument.label and not stated:
        info(f"default {instrument.label} positions assumed: place them as listed, or state theirs and plan again")
    x, y, z = instrument.T_tool_tip[:3, 3] * 1e3
    info(f"mounting on the tool assumed at {x:g}, {y:g}, {z:g} mm in the tool frame (--mounted-mm)")
    if robot.link_radii is None:
        info("collisions not checked: the robot file states no link_radii_mm; drive the plan slowly")
    else:
        info(
            "collisions of the links with each other, blocks and keep-out boxes were checked, between poses, too; cables, tool and "
            "cell were not: drive slowly"
        )
    round_about, none = (
        [one.pose for one in plan.blocked if (one.via is not None) == found] for found in (True, False)
    )
    if round_about:
        info(f"not clear from the previous pose by a joint motion: {_some(round_about)}; a program takes a way around")
    if none:
        info(
            f"not clear from the previous pose, and no way around found: {_some(none)}; drive there by hand, not by a program"
        )


def _show_fixtures(plan: "taskcal.Plan", whose: str) -> None:
    instrument, fixtures = plan.instrument, plan.instrument.fixtures
    turned = instrument.directed
    columns = (
        Column(instrument.label, fixtures.names.__getitem__),
        *(Column(f"{axis}_mm", lambda k, i=i: fixtures.position[k, i], ".0f", 1e3) for i, axis in enumerate("xyz")),
        *(Column(axis, lambda k, i=i: fixtures.direction[k, i], ".2f") for i, axis in enumerate("ijk") if turned),
        Column("poses", lambda k: plan.names.count(fixtures.names[k]), "d"),
    )
    title = f"Positions of the {instrument.label}s in the base frame, {whose}, mm{', and their directions' if turned else ''}"
    show(Table.of(title, columns, range(len(fixtures.names))))


def _some(poses: list[int]) -> str:
    return ", ".join(map(str, poses[:MAX_NAMED])) + (" …" if len(poses) > MAX_NAMED else "")


# Instruments that an option names.


def check_instruments(observe: str, *, several: bool = True) -> str:
    """The names of one instrument or several with a plus between, all of them known.

    Raises:
        typer.BadParameter: there is no such instrument.
    """
    from taskcal.errors import CampaignError, UnknownName
    from taskcal.observations import instrument_of

    try:
        if not several:
            instrument_of(observe)
            return observe
        return taskcal.virtual.SimulationOptions(observe=observe).observe
    except (UnknownName, CampaignError) as error:
        raise typer.BadParameter(str(error), param_hint="--observe") from error
