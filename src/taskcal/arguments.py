"""Arguments of the public functions: what their annotations do not allow is refused by name."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import fields, replace
from functools import cache, wraps
from inspect import signature
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Any, Literal, TypeVar, Union, cast, get_args, get_origin

from taskcal.errors import InputError, WrongKind, WrongValue, shown

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


Target = TypeVar("Target", bound=Callable[..., Any])
Options = TypeVar("Options", bound="DataclassInstance")

MADE_BY = {
    "Bounds": "Bounds(shift=5e-3) is one",
    "Calibration": 'load_calibration("cal.json") loads one, identify(model, campaign) makes one',
    "Campaign": 'read_campaign("campaign.csv", robot) reads one',
    "Cell": 'load_cell("cell.toml") loads one',
    "Conditions": "a campaign has one, campaign.conditions",
    "EffectSearch": "EffectSearch(field=True) is one",
    "ErrorModel": 'ErrorModel(load_robot("my-robot.toml")) is one; a calibration has one, calibration.model',
    "FitOptions": 'FitOptions(keep=("J2", "J3")) is one',
    "Frame": "Frame(name=…, T=…) is one",
    "Generator": "numpy.random.default_rng(0) is one",
    "Hyperparameters": "known_hyperparameters(calibration) are",
    "Program": 'read_program("part.mod") reads one',
    "Registration": "register(model, campaign) finds one",
    "Robot": 'load_robot("my-robot.toml") loads one',
    "Squared": "Squared(), Huber(1.5) and Cauchy() are losses",
    "Station": 'load_station("station.toml") loads one',
    "Task": 'load_task("task.toml") loads one',
    "TrackerNoise": "TrackerNoise(mpe_to_sigma=0.577) is one",
}
"""Of each kind, where one comes from."""


def checked(target: Target) -> Target:
    """See, at every call of a public function or class, that arguments are what their annotations say.

    Sequences and numbers of any kind become the arrays and tuples that the annotations name; masked arrays without masked
    entries, data frames, lists and single precision are plain numbers. Arrays have no NaN.

    Raises, at the call:
        WrongKind: an argument is something else; the message says what it is, and how to come by the right one.
        WrongValue: an array of another shape, or an entry that is masked or not finite; the message names its row.
    """
    return _checked(target, gaps=False)


def checked_with_gaps(target: Target) -> Target:
    """As `checked`, but arrays may have NaN, where something was not measured or is not known."""
    return _checked(target, gaps=True)


def _checked(target: Any, *, gaps: bool) -> Any:
    if isinstance(target, type):
        target.__init__ = _checked(target.__init__, gaps=gaps)
        return target
    parameters = [p for p in signature(target).parameters.values() if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    names = [p.name for p in parameters if p.kind is not p.KEYWORD_ONLY]
    kinds = {
        p.name: p.annotation for p in parameters if p.annotation is not p.empty and p.name != "out"
    }  # written into

    @wraps(target)
    def call(*args: Any, **kwargs: Any) -> Any:
        def fit(name: str, value: Any) -> Any:
            return as_kind(name, value, kinds[name], gaps=gaps) if name in kinds else value

        fitted = list(map(fit, names, args))
        return call.__wrapped__(*fitted, *args[len(fitted) :], **{name: fit(name, kwargs[name]) for name in kwargs})

    return call


def as_kind(name: str, value: Any, kind: Any, *, gaps: bool = False) -> Any:
    """An argument as its annotation has it.

    Args:
        name: of the argument, for messages.
        value: what was given.
        kind: an annotation; of kinds that are not known here, and names in quotes, everything is taken.
        gaps: whether arrays may have NaN.

    Raises:
        WrongKind, WrongValue: as `checked`.
    """
    choices, optional = _choices(kind)
    if value is None and optional:
        return None
    faults: list[InputError] = []
    for choice in choices:
        try:
            return _as_choice(name, value, choice, gaps)
        except (WrongKind, WrongValue) as fault:
            faults.append(fault)
    for fault in faults:
        if isinstance(fault, WrongValue) or len(choices) == 1:
            raise fault
    raise _wrong_kind(name, value, choices)


@cache
def _choices(kind: Any) -> tuple[tuple[Any, ...], bool]:
    """Alternatives that an annotation allows, and whether None is one beside them."""
    choices: tuple[Any, ...] = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    return tuple(choice for choice in choices if choice is not NoneType), NoneType in choices


def _as_choice(name: str, value: Any, kind: Any, gaps: bool) -> Any:
    """An argument as an annotation without alternatives has it; errors as of `as_kind`."""
    if hasattr(kind, "dim_str"):
        return _as_array(name, value, kind, gaps)
    origin = get_origin(kind)
    if origin is Literal:
        fits = isinstance(value, Hashable) and value in get_args(kind)
    elif origin is Mapping and isinstance(value, Mapping):
        entries = cast(Mapping[Any, Any], value)
        return {key: as_kind(f"{name}[{key!r}]", entry, get_args(kind)[1], gaps=gaps) for key, entry in entries.items()}
    elif origin in (tuple, Sequence) and _has_entries(value):
        return _as_entries(name, tuple(value), kind, gaps)
    elif kind is float or kind is int:
        fits = isinstance(value, Real if kind is float else Integral) and not isinstance(value, bool)
        if fits and value != value:
            raise WrongValue(f"{name} is nan; give a number")
    elif kind is Path:
        fits = isinstance(value, PathLike)
    elif origin is Callable:
        fits = callable(value)
    elif kind is bool:
        fits = isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")  # NumPy's
    else:
        fits = origin not in (tuple, Sequence, Mapping) and (not isinstance(kind, type) or isinstance(value, kind))
    if not fits:
        raise _wrong_kind(name, value, (kind,))
    return value


def _has_entries(value: Any) -> bool:
    """Whether a value has entries in order; an array of no dimensions says that it can be iterated, too."""
    return (
        isinstance(value, Iterable) and not isinstance(value, str | bytes | Mapping) and getattr(value, "ndim", 1) > 0
    )


def _as_entries(name: str, value: tuple[Any, ...], kind: Any, gaps: bool) -> tuple[Any, ...]:
    """A tuple as an annotation of a tuple or a sequence has it; errors as of `as_kind`."""
    kinds = get_args(kind)
    if get_origin(kind) is Sequence or kinds[1:] == (...,):
        if kinds[0] is str and all(isinstance(entry, str) for entry in value):  # names of rows, of which there are many
            return value
        kinds = kinds[:1] * len(value)
    if len(value) != len(kinds):
        raise WrongValue(f"{name} has {len(value)} entries; give {len(kinds)}")
    return tuple(as_kind(f"{name}[{i}]", entry, kinds[i], gaps=gaps) for i, entry in enumerate(value))


_NUMBERS = {"float": "iuf", "int": "iu", "bool": "b"}
"""Kinds of NumPy's types that do for an annotation's."""


@cache
def _wanted(kind: Any) -> tuple[str, tuple[int | None, ...] | None]:
    """Numbers that an annotation by shape wants, and its dimensions, None for those of any size; None where there may be more."""
    dims = kind.dim_str.split()
    sizes = tuple(int(dim) if dim.isdigit() else None for dim in dims)
    numbers = next(known for known in _NUMBERS if kind.dtypes[0].startswith(known))
    return numbers, None if any(dim[0] in "*." for dim in dims) else sizes


def _same_size(wanted: int | None, size: int) -> bool:
    return wanted is None or wanted == size


def _as_array(name: str, value: Any, kind: Any, gaps: bool) -> Any:
    """An array as an annotation by shape has it; errors as of `as_kind`."""
    import numpy as np

    wanted, dims = _wanted(kind)
    if type(value) is np.ndarray and value.dtype == float and wanted == "float" and value.flags.c_contiguous:
        fits = dims is None or (value.ndim == len(dims) and all(map(_same_size, dims, value.shape)))
        if fits and (not np.isinf(value).any() if gaps else np.isfinite(value).all()):
            return value  # as it is nearly always, in a few microseconds
    try:
        array = np.ma.asarray(value) if isinstance(value, np.ma.MaskedArray) else np.asarray(value)
    except (ValueError, TypeError) as error:  # rows of different lengths
        raise WrongValue(f"{name} is not an array ({shown(error)}); give {_describe(kind)}") from error
    if array.dtype == object and all(isinstance(entry, Real) for entry in array.flat):
        array = array.astype(float)
    if array.dtype.kind not in _NUMBERS[wanted] and array.size:
        raise _wrong_kind(name, value, (kind,))
    if dims is not None and (array.ndim != len(dims) or not all(map(_same_size, dims, array.shape))):
        raise WrongValue(f"{name} has shape {array.shape}; give {_describe(kind)}")
    bad, what = np.ma.getmaskarray(array) if isinstance(array, np.ma.MaskedArray) else np.zeros(0, dtype=bool), "masked"
    array = np.require(np.asarray(array), {"float": float, "int": np.intp, "bool": bool}[wanted], "C")
    if not bad.any() and wanted == "float":
        bad, what = np.isinf(array) if gaps else ~np.isfinite(array), "not finite"
    if bad.any():
        place = np.argwhere(bad)[0]
        at = f"row {place[0]}" if len(place) else "its value"
        raise WrongValue(f"{name}: {at} is {what}; {'give NaN where nothing was measured' if gaps else 'leave it out'}")
    return array


def _wrong_kind(name: str, value: object, kinds: tuple[Any, ...]) -> WrongKind:
    """The error of an argument that is none of some kinds."""
    given = shown(repr(value)) if isinstance(value, str | int | float) else _with_article(type(value))
    right = " or ".join(dict.fromkeys(map(_describe, kinds)))
    made = MADE_BY.get(getattr(kinds[0], "__name__", ""))
    return WrongKind(f"{name} is {given}, not {right}{f': {made}' if made else ''}")


def _describe(kind: Any) -> str:
    """An annotation in words."""
    if hasattr(kind, "dim_str"):
        dims = ", ".join(kind.dim_str.split())
        return f"an array of numbers of shape ({dims}{',' if ',' not in dims else ''})"
    origin = get_origin(kind)
    if origin is Literal:
        return " or ".join(map(repr, get_args(kind)))
    if origin is Mapping:
        return f"a dictionary, in which each value is {_describe(get_args(kind)[1])}"
    if origin in (tuple, Sequence):
        return f"a sequence, in which each entry is {_describe(get_args(kind)[0])}"
    return _WORDS.get(kind) or _with_article(origin or kind)


_WORDS: Mapping[Any, str] = {
    float: "a number", int: "a whole number", bool: "True or False", str: "text", Path: "a Path", Callable: "a function",
}  # fmt: skip


def _with_article(kind: type) -> str:
    return f"{'an' if kind.__name__[0] in 'AEIOU' else 'a'} {kind.__name__}"


def options_of(kind: type[Options], choices: Mapping[str, Any], what: str) -> Options:
    """Options by keywords, those not named as in ``options``, or as by default.

    Args:
        kind: of the options, all of which have a default.
        choices: values by name; ``options`` for all others at once.
        what: the options are of, for the message, such as ``a plan``.

    Raises:
        TypeError: an option that does not exist; the message names all.
    """
    named = {name: value for name, value in choices.items() if name != "options"}
    names = [f.name for f in fields(kind)]
    for name in named:
        if name not in names:
            raise TypeError(f"no option '{name}' of {what}; there are {', '.join(names)}")
    return replace(as_kind("options", choices.get("options"), kind | None) or kind(), **named)


# Names that stand several times where each must be one's own.

Item = TypeVar("Item")


def repeated(items: Iterable[Item]) -> list[Item]:
    """Items that occur twice or more, each once, in order of first occurrence."""
    return [item for item, times in Counter(items).items() if times > 1]
