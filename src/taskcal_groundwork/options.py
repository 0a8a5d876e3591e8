"""An option, declared once: on the frozen dataclass that a function takes, in the annotation of its field.

The command line, the studio, the documents and Python's own help read it there. Nothing here imports NumPy, nor does a module of
options: an option that is wrong is refused before anything else is imported.
"""

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Generic, Literal, TypeVar, Union, cast, get_args, get_origin

from taskcal_groundwork.errors import WrongValue
from taskcal_groundwork.said import Said

UNITS = {"": 1.0, "mm": 1e-3, "mm_s": 1e-3, "deg": math.pi / 180.0, "s": 1.0, "percent": 1e-2}
"""SI units in each unit that options are written in, or shown in."""

SIGNS = {"mm_s": "mm/s", "deg": "°", "percent": "%"}
"""How a unit is said, where that is not its name."""

G = TypeVar("G")


@dataclass(frozen=True, kw_only=True, eq=False)
class Option:
    """What is declared of an option; its name, type and default are its field's."""

    help: str = ""
    """What it is. A number in it has its unit beside it, for it is read where lengths are metres, too."""
    metavar: str | None = None
    """How help shows its value; None for a flag or a choice."""
    also: str = ""
    """Another name, such as ``-o``."""
    named: str = ""
    """Its name, where that is not its field's."""
    unit: str = ""
    """That it is written in, and its name ends in; the field's value is in SI units."""
    shown: str = ""
    """That a page shows it in, where it is written in none: ``percent`` for a share."""
    low: float | None = None
    """The least, as it is written."""
    high: float | None = None
    ends: bool = True
    """Whether the bounds themselves are allowed."""
    rising: bool = False
    """Whether its two numbers are a lower and a higher one."""
    kind: Any = None
    """Type of what is written, where it is not the field's: a file's path for what the file holds."""
    several: Literal["", ",", " "] = ""
    """What stands between the names of a list; nothing where it is none."""
    words: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """Texts that stand for other values, such as ``none`` for None, or ``comma`` for a mark."""
    suggested: tuple[str, ...] = ()
    """Texts that are offered beside one's own."""
    argument: bool = False
    """Whether it is written without its name."""
    alone: bool = False
    """Whether it is Python's alone, and no text stands for it."""
    writes: Literal["", "new", "updated", "later"] = ""
    """Whether the file that it names is written, or gone on with, or tells the names of files that are; all else that an option
    names and that exists is read."""
    more: Mapping[str, Any] = field(default_factory=dict[str, Any])
    """For the command line's parser."""


class OptionError(WrongValue):
    """Options that cannot be, or not together.

    The template has their fields in braces, so that each surface names them in its own way.
    """

    def __init__(self, template: str, *names: str, **values: str | float):
        """Say it in Python's names.

        Args:
            template: what is wrong, with places for names and values.
            names: fields that it is about.
            values: by their places.
        """
        self.template, self.names, self.values = template, names, values
        super().__init__(f"{' / '.join(names)}: {self.said(str)}")

    def said(self, named: Callable[[str], str]) -> Said:
        """What is wrong, with the options as they are named."""
        return Said(self.template, **{name: named(name) for name in self.names}, **self.values)


@dataclass(frozen=True, kw_only=True)
class StatedOption:
    """An option where it stands."""

    field: str
    kind: Any
    """Type of what is written: bool, int, float, str or Path; a list of it; a choice (`Literal`); or a tuple of so many floats,
    with commas between them."""
    default: Any
    """Of the field; MISSING where it has to be given."""
    option: Option

    @property
    def name(self) -> str:
        """As it is written: with hyphens, and its unit at the end."""
        parts = [self.option.named or self.field, *filter(None, [self.option.unit])]
        return "-".join(parts).replace("_", "-")

    @property
    def choices(self) -> tuple[str, ...]:
        """Texts of which it is one; none where it is free."""
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()

    @property
    def names_file(self) -> bool:
        """Whether a file may be named."""
        return self.kind is Path

    @property
    def is_number(self) -> bool:
        """Whether a number is written."""
        return self.kind in (int, float)

    @property
    def always(self) -> bool:
        """Whether it has a value where nothing is written."""
        return self.written(self.default) is not None

    @property
    def numbers(self) -> int:
        """How many numbers are written with commas between them; none where it is something else."""
        return len(get_args(self.kind)) if get_origin(self.kind) is tuple else 0

    def value(self, written: Any) -> Any:
        """Value of the field by what is written, already of its kind; the default where nothing is."""
        if written is None:
            return self.default
        if isinstance(written, str | Path) and str(written) in self.option.words:
            return self.option.words[str(written)]
        if self.option.several and isinstance(written, str):
            return tuple(written.split()) if self.option.several == " " else split(written, self.field)
        if self.numbers and isinstance(written, str):
            return tuple(number * UNITS[self.option.unit] for number in self._numbers_of(written))
        if isinstance(written, float) and self.option.unit:
            return written * UNITS[self.option.unit]
        return cast(Any, written)

    def _numbers_of(self, text: str) -> list[float]:
        with suppress(ValueError):
            numbers = [float(part) for part in text.split(",")]
            if len(numbers) == self.numbers and all(map(math.isfinite, numbers)):
                return numbers
        said = {"text": text, "count": self.numbers}
        raise OptionError("'{text}' is not {count} numbers with commas between them", self.field, **said)

    def written(self, value: Any) -> Any:
        """What is written for a value; None for one that is not written, such as a default that is no number."""
        for word, of in self.option.words.items():
            if type(of) is type(value) and of == value:
                return word
        if self.option.several and isinstance(value, tuple):
            return self.option.several.join(cast("tuple[str, ...]", value))
        if self.numbers and isinstance(value, tuple):
            return ",".join(f"{self._number(one):g}" for one in cast("tuple[float, ...]", value))
        if self.is_number:
            return self._number(value)
        return value if isinstance(value, str | bool | Path | list) else None

    def _number(self, value: Any) -> Any:
        """A number as it is written; None for what is none."""
        if not isinstance(value, int | float) or isinstance(value, bool):
            return None
        return value if self.kind is int else float(f"{value / UNITS[self.option.unit]:.12g}")

    def read(self, text: str, *, shown: bool = False) -> Any:
        """Value of the field by a text.

        Args:
            text: as it is written.
            shown: whether a refusal has the unit that a page shows.

        Raises:
            OptionError: it is not of its kind, or beyond its bounds.
        """
        kinds: dict[Any, Callable[[str], Any]] = {bool: _TRUTHS.__getitem__, int: int, float: float, Path: Path}
        try:
            made = kinds.get(self.kind, str)(text)
        except (ValueError, KeyError) as error:
            raise OptionError("'{text}' is not a number, such as 1", self.field, text=text) from error
        if self.choices and made not in self.choices:
            raise OptionError("'{text}' is none of {known}", self.field, text=text, known=", ".join(self.choices))
        value = self.value(made)
        self.check(value, shown=shown)
        return value

    def check(self, value: Any, *, shown: bool = False) -> None:
        """Check a number, or each of several, against the bounds.

        Args:
            value: of the field; what is no number is not looked at.
            shown: whether a refusal has the unit that a page shows.

        Raises:
            OptionError: it is beyond.
        """
        own = self.option
        if own.low is None and own.high is None:
            return
        unit = own.shown if shown and own.shown else own.unit
        scale = UNITS[own.unit] / UNITS[unit] if own.unit else 1.0 / UNITS[unit]
        low, high = (own.low or 0.0) * scale, math.inf if own.high is None else own.high * scale
        for one in cast("tuple[Any, ...]", value) if isinstance(value, tuple) else (value,):
            number = self._number(one)
            if number is None or not (self.is_number or self.numbers):
                continue
            number = number * scale
            if not (low <= number <= high if own.ends else low < number < high) or math.isinf(number):
                said = {"value": quantity(number, unit), "low": quantity(low, unit), "high": quantity(high, unit)}
                raise OptionError(OUTSIDE[math.isinf(high), own.ends], self.field, **said)
        if own.rising and isinstance(value, tuple) and not value[0] < value[1]:
            low, high = (quantity(self._number(one), own.unit) for one in cast("tuple[float, ...]", value))
            raise OptionError("{low} is not below {high}; write the lower one first", self.field, low=low, high=high)


_TRUTHS = {"true": True, "false": False}

OUTSIDE = {
    (False, True): "{value} is not from {low} to {high}",
    (False, False): "{value} is not between {low} and {high}",
    (True, True): "{value} is not {low} or more",
    (True, False): "{value} is not above {low}",
}
"""What is wrong with a number, by whether it has no upper bound, and whether the bounds themselves are allowed."""


def quantity(number: float, unit: str) -> Said:
    """A number with its unit."""
    sign = SIGNS.get(unit, unit)
    if sign == "°":
        return Said("{number:g}°", number=number)
    return Said("{number:g} {sign}", number=number, sign=sign) if sign else Said("{number:g}", number=number)


def split(text: str, field: str) -> tuple[str, ...]:
    """Names from a list with commas.

    Raises:
        OptionError: one is empty, or stands twice.
    """
    names = [name.strip() for name in text.split(",")]
    if not all(names):
        raise OptionError("'{text}' has an empty name; write names with single commas between them", field, text=text)
    if twice := [name for name in names if names.count(name) > 1]:
        raise OptionError("'{name}' is listed twice", field, name=twice[0])
    return tuple(names)


@cache
def declared(group: type) -> tuple[StatedOption, ...]:
    """What is declared of a dataclass, in the order of its fields, Python's alone among it."""
    found = (stated(one.name, one.type, one.default, one.metadata.get(OPTION)) for one in fields(group))
    return tuple(one for one in found if one is not None)


@cache
def options_of(group: type) -> tuple[StatedOption, ...]:
    """Options of a dataclass that are written, in their order."""
    return tuple(one for one in declared(group) if not one.option.alone)


OPTION = "option"
"""Key of a field's metadata, where a command of the command line declares an option of its own."""


def stated(name: str, kind: Any, default: Any, option: Option | None = None) -> StatedOption | None:
    """An option by its field.

    Args:
        name: of the field, or of a function's parameter.
        kind: its type, which may be annotated with the option.
        default: MISSING where it has to be given.
        option: where its type is not annotated; None where nothing is declared.
    """
    if get_origin(kind) is Annotated:
        option = option or next((one for one in kind.__metadata__ if isinstance(one, Option)), None)
        kind = get_args(kind)[0]
    if option is None:
        return None
    alternatives = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    own = option.kind or next(one for one in alternatives if one is not NoneType)
    return StatedOption(field=name, kind=own, default=default, option=option)


def check(group: type, options: Any) -> None:
    """Check all numbers of a group against their bounds, for its ``__post_init__``.

    Args:
        group: whose options they are.
        options: a value of it, or what was written of one.

    Raises:
        OptionError: one is beyond.
    """
    for one in declared(group):
        one.check(getattr(options, one.field))


class Written(Generic[G]):
    """A group of options as they were written: some of them name a file, or what only a model or a campaign can tell.

    Its attributes are the group's fields, checked as the group's own values are: its ``__post_init__`` reads nothing else.
    """

    def __init__(self, group: type[G], **values: Any):
        """Take what was written.

        Args:
            group: whose options they are.
            values: of its fields; the others are as by default.

        Raises:
            OptionError: as the group's own.
        """
        self.group = group
        self.values = {one.name: values.get(one.name, one.default) for one in fields(cast(Any, group))}
        if verify := getattr(group, "__post_init__", None):
            verify(self)

    def __getattr__(self, name: str) -> Any:
        if name in vars(self).get("values", {}):
            return self.values[name]
        raise AttributeError(name)

    def made(self, **known: Any) -> G:
        """The group, with what some of the options stand for."""
        return self.group(**{**self.values, **known})


# Options as texts, by their names: as a project states them, and as a command is told them.


def arguments_of(groups: Iterable[type], texts: Mapping[str, str]) -> list[str]:
    """Arguments of the command line for what texts state; nothing for an empty one, or one of no option of these groups."""
    every = [one for group in groups for one in options_of(group) if texts.get(one.name)]
    flags = [f"--{one.name}" for one in every if one.kind is bool and texts[one.name] == "true"]
    return [*(f"--{one.name}={texts[one.name]}" for one in every if one.kind is not bool), *flags]


def read(group: type[G], texts: Mapping[str, str], *, shown: bool = False) -> Written[G]:
    """What texts state of a group of options; the others are as by default.

    Args:
        group: whose options they are.
        texts: as they are written, by the names of the options; an empty one states nothing.
        shown: whether a refusal has the units that a page shows.

    Raises:
        OptionError: one is not of its kind, or they do not go together.
    """
    given = [one for one in options_of(group) if texts.get(one.name)]
    return Written(group, **{one.field: one.read(texts[one.name], shown=shown) for one in given})


# Options that many have.

Seed = Annotated[int, Option(metavar="N", help="Seed of the random number generator.", low=0)]
