"""Arguments of the public functions: what their annotations do not allow is refused by name."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass, replace
from functools import cache, wraps
from inspect import Parameter, isfunction, signature
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Concatenate,
    ForwardRef,
    Literal,
    ParamSpec,
    TypeVar,
    Union,
    cast,
    get_args,
    get_origin,
    get_type_hints,
)

from taskcal.errors import InputError, WrongKind, WrongValue, shown
from taskcal_groundwork.options import declared

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
    "Station": 'load_station("station.toml") loads one',
    "Task": 'load_task("task.toml") loads one',
    "TrackerNoise": "TrackerNoise(mpe_to_sigma=0.577) is one",
}
"""Of each kind, where one comes from."""


def checked(target: Target) -> Target:
    """See, at every call of a public function or class, that arguments are what their annotations say.

    Sequences and numbers of any kind become the arrays and tuples that the annotations name; masked arrays without masked
    entries, data frames without names of columns, lists and single precision are plain numbers. Arrays have no NaN.

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


def joints_checked(target: Target) -> Target:
    """See, at every call of a function or of a class's public methods, that joint values stand in the order of the joints.

    They are the arguments whose annotations are arrays with the last dimension ``joints``. Arrays are taken as they are, at no
    cost where poses are computed; of anything else numbers are made as `checked` makes them.

    Raises, at the call:
        WrongKind, WrongValue: as `checked`; of a data frame whose columns have names, which may stand in another order.
    """
    return _joints_checked(target)


def _joints_checked(target: Any) -> Any:
    if not isinstance(target, type):
        return _with_joints_checked(target)
    for name, member in [*vars(target).items()]:
        if isinstance(member, classmethod | staticmethod) and not name.startswith("_"):
            kind: Any = type(cast(Any, member))
            setattr(target, name, kind(_with_joints_checked(member.__func__)))
        elif isfunction(member) and not name.startswith("_"):
            setattr(target, name, _with_joints_checked(member))
    return target


def _with_joints_checked(function: Any) -> Any:
    import numpy as np

    parameters = enumerate(signature(function).parameters.values())
    kinds = [(place, p.name, p.annotation) for place, p in parameters if _of_joints(p.annotation)]
    if not kinds:
        return function

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        for place, name, kind in kinds:
            if place < len(args):
                if type(args[place]) is not np.ndarray:
                    args = (*args[:place], as_kind(name, args[place], kind), *args[place + 1 :])
            elif name in kwargs and type(kwargs[name]) is not np.ndarray:
                kwargs[name] = as_kind(name, kwargs[name], kind)
        return call.__wrapped__(*args, **kwargs)

    return call


def _of_joints(kind: Any) -> bool:
    """Whether an annotation is of an array with one column for each joint, or may be."""
    choices = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    return any(getattr(choice, "dim_str", "").split()[-1:] == ["joints"] for choice in choices)


def as_kind(name: str, value: Any, kind: Any, *, gaps: bool = False) -> Any:
    """An argument as its annotation has it.

    Args:
        name: of the argument, for messages.
        value: what was given.
        kind: an annotation; of kinds that are not known here, and names in quotes that are not public ones, everything is taken.
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
    if get_origin(kind) is Annotated:
        return _choices(get_args(kind)[0])
    if isinstance(kind, ForwardRef | str) and any(name in str(kind) for name in ("taskcal", "np.")):
        return _choices(_public(kind))
    choices: tuple[Any, ...] = get_args(kind) if get_origin(kind) in (Union, UnionType) else (kind,)
    return tuple(choice for choice in choices if choice is not NoneType), NoneType in choices


def _public(kind: ForwardRef | str) -> Any:
    """An annotation in quotes of public names and arrays, which are loaded when they are first needed."""
    import numpy as np
    from jaxtyping import Float

    import taskcal

    known = {"taskcal": taskcal, "np": np, "Float": Float, "Literal": Literal, "Sequence": Sequence, "Mapping": Mapping}
    return get_type_hints(type("Holder", (), {"__annotations__": {"kind": kind}}), known)["kind"]


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
    stated = kind.dtypes[0] if isinstance(kind.dtypes, Sequence) else "float"  # of any kind: numbers as any other's
    numbers = next(known for known in _NUMBERS if stated.startswith(known))
    return numbers, None if any(dim[0] in "*." for dim in dims) else sizes


def _same_size(wanted: int | None, size: int) -> bool:
    return wanted is None or wanted == size


def _column_names(value: Any) -> list[str]:
    """What the columns of a table are called, whosever it is; none of those that are only numbered."""
    return _named(value.column_names if hasattr(type(value), "column_names") else getattr(value, "columns", ()))


def _entry_names(value: Any) -> list[str]:
    """What the entries of a series are called, or of the first of several; none of those that are only numbered."""
    first = next(iter(cast(Iterable[Any], value)), None) if isinstance(value, list | tuple) else value
    return _named(getattr(first, "index", ()))


def _named(labels: Any) -> list[str]:
    every = cast(Iterable[Any], labels) if isinstance(labels, Iterable) else ()
    return [str(one) for one in every if not isinstance(one, Integral) and not str(one).isdigit()]


def _as_array(name: str, value: Any, kind: Any, gaps: bool) -> Any:
    """An array as an annotation by shape has it; errors as of `as_kind`."""
    import numpy as np

    wanted, dims = _wanted(kind)
    if type(value) is np.ndarray and value.dtype == float and wanted == "float" and value.flags.c_contiguous:
        fits = dims is None or (value.ndim == len(dims) and all(map(_same_size, dims, value.shape)))
        if fits and (not np.isinf(value).any() if gaps else np.isfinite(value).all()):
            return value  # as it is nearly always, in a few microseconds
    if names := _column_names(value):
        raise WrongValue(
            f"{name} is a data frame with the columns {shown(', '.join(names))}, and would be taken by their places, whatever "
            f"they are called; choose them in their order and unit, and give {_describe(kind)}: frame[[…]].to_numpy()"
        )
    if kind.dim_str.split()[-1:] == ["joints"] and (names := _entry_names(value)):
        raise WrongValue(
            f"{name} is a series with the labels {shown(', '.join(names))}, and would be taken by their places, whatever they are "
            f"called; choose them in their order and unit, and give {_describe(kind)}: series[[…]].to_numpy()"
        )
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


# Options by keywords.

K = TypeVar("K")
O = TypeVar("O")
R = TypeVar("R")
Own = ParamSpec("Own")
Named = ParamSpec("Named")
"""Names and types of options, as the class that they make takes them."""


def by_name(kind: K) -> Callable[[Callable[Concatenate[K, Own], R]], Callable[Own, R]]:
    """Let a function take its options by their names: all of them at once as ``options``, or some that replace those of a whole.

    The function itself is told the kind first, and has `chosen_options` make the options of what else it is told. So a type
    checker knows each by its name and type, and ``help`` shows it with its default and what it is.

    Args:
        kind: the options; all of them have a default.
    """
    group = cast("type[Any]", kind)

    def decorate(function: Any) -> Any:
        _, *every = signature(function).parameters.values()
        own = [one for one in every if one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)]
        named = {one.name: one for one in fields(group)}

        @wraps(function)
        def call(*args: Any, **given: Any) -> Any:
            if unknown := given.keys() - named.keys() - {one.name for one in own}:
                known = ", ".join(named)
                raise TypeError(f"no option '{min(unknown)}' of {function.__name__}; there are {known}")
            return function(kind, *args, **given)

        keywords = [
            Parameter(name, Parameter.KEYWORD_ONLY, default=one.default, annotation=_plain(one.type))
            for name, one in named.items()
        ]
        cast(Any, call).__signature__ = signature(function).replace(parameters=[*own, *keywords])
        del cast(Any, call).__wrapped__  # whose source, where documents look for defaults, has none of the options
        helps = "\n".join(f"        {one.field}: {one.option.help}" for one in declared(group))
        call.__doc__ = f"{function.__doc__}\n\n    Options, as `{group.__name__}` has them:\n{helps}\n    "
        return call

    return decorate


def _plain(kind: Any) -> Any:
    """An annotation without what is declared in it; one in quotes as it is written."""
    kind = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    return kind.__forward_arg__ if isinstance(kind, ForwardRef) else kind


def chosen_options(kind: Callable[Named, O], options: object, /, *args: Named.args, **named: Named.kwargs) -> O:
    """All options: those that are named, the others as they were given at once, or as by default.

    Args:
        kind: of the options.
        options: of the kind, or of one that is part of it; None where none were given at once.
        args: none.
        named: options by their names.
    """
    given = _at_once(kind, options)
    return cast(O, replace(given, **named)) if named else given


def _at_once(group: Any, options: Any) -> Any:
    """All options, by those that were given at once: of the group, or of one that is part of it."""
    if options is None:
        return group()
    part = type(options)
    if part is not group and is_dataclass(options) and part in group.__mro__:
        return converted(group, options)
    return as_kind("options", options, group)


def converted(group: type[Options], options: Any) -> Options:
    """Options of a group, of whose fields a value of another has some, or more."""
    given = {one.name for one in fields(options)}
    return group(**{one.name: getattr(options, one.name) for one in fields(group) if one.name in given})


# Names that stand several times where each must be one's own.

Item = TypeVar("Item")


def repeated(items: Iterable[Item]) -> list[Item]:
    """Items that occur twice or more, each once, in order of first occurrence."""
    return [item for item, times in Counter(items).items() if times > 1]
