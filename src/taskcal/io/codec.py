"""A value and its file: each field of a dataclass is stated once, and by its type it is written, checked and read.

Inside, numbers are in SI units; a field says in its annotation in which other unit its file has them, and its key ends with that.
A file of JSON states every field. A file of TOML is brief: what is as by default may be left out, and is not written.
"""

import math
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, Field, dataclass, fields, is_dataclass
from functools import cache
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

import numpy as np
from jaxtyping import Float
from pydantic import ValidationError, create_model, model_validator

from taskcal.errors import FileError, TaskcalError
from taskcal.io.json_file import SealedFile
from taskcal.io.toml_file import Count, FileSection, Finite, Flag, explain, toml_of
from taskcal_groundwork.options import UNITS

T = TypeVar("T")
Base = TypeVar("Base", bound=FileSection)


@dataclass(frozen=True, kw_only=True)
class InFile:
    """How a file has a field, where the field's name and type do not say it."""

    key: str = ""
    """Its key, where that is not its name and its unit."""
    unit: str = ""
    """Of its numbers in the file, with which its key ends."""
    entry: Any = None
    """Type of each number of an array in the file: ``Finite | None`` where NaN stands for gaps, with limits, or of truths."""
    kind: Any = None
    """Type of what the file has in its place, where it is not that of the field."""
    write: Callable[[Any], Any] | None = None
    """Makes that of the field's value."""
    read: Callable[[str, Any], Any] | None = None
    """Makes the field's value of the key and what was read, or refuses it."""
    counts: str = ""
    """Name of the dimension whose size its number of entries is."""
    lacks: bool = False
    """Whether its key may lack in any file, where it is as by default; it is always written."""
    blank: bool = True
    """Whether it is written where it is None."""
    absent: bool = False
    """Whether no file has it."""


NOT_IN_FILE = InFile(absent=True)
LACKS = InFile(lacks=True)
ONLY_WHERE_KNOWN = InFile(lacks=True, blank=False)
GAPS = InFile(entry=Finite | None)
"""Of an array with NaN where nothing was measured, which is ``null`` in the file."""
TRUTHS = InFile(entry=bool | None, lacks=True)
"""Of an array of ones and zeros, with NaN where it is not known; it may lack."""

_PLAIN = InFile()
_STRICT: Mapping[Any, Any] = {float: Finite, int: Count, bool: Flag}


@dataclass(frozen=True)
class _Filed:
    """A field, and how its file has it."""

    field: Field[Any]
    kind: Any
    how: InFile

    @property
    def key(self) -> str:
        """Its key in the file."""
        return self.how.key or "_".join(filter(None, [self.field.name, self.how.unit]))

    @property
    def default(self) -> Any:
        """By default; MISSING where it has to be given."""
        made = self.field.default_factory
        return self.field.default if made is MISSING else made()

    def may_lack(self, brief: bool) -> bool:
        """Whether a file need not have it."""
        return self.how.lacks or (brief and self.default is not MISSING)

    def is_left_out(self, value: Any, brief: bool) -> bool:
        """Whether a file is written without it."""
        if value is None and not self.how.blank:
            return True
        return brief and not self.how.lacks and not isinstance(value, np.ndarray) and value == self.default


@cache
def _filed(kind: type) -> tuple[_Filed, ...]:
    hints = get_type_hints(kind, include_extras=True)
    every = [_Filed(one, hints[one.name], _how(hints[one.name])) for one in fields(cast(Any, kind))]
    return tuple(one for one in every if not one.how.absent)


def _how(kind: Any) -> InFile:
    """How a file has what an annotation says, or one of its alternatives."""
    if get_origin(kind) in (Union, UnionType):
        return next((how for one in get_args(kind) if (how := _how(one)) is not _PLAIN), _PLAIN)
    return next((one for one in getattr(kind, "__metadata__", ()) if isinstance(one, InFile)), _PLAIN)


def _inner(kind: Any, how: InFile) -> tuple[Any, InFile, InFile]:
    """The type under an annotation, how a file has what is in it, and how it has the whole."""
    own = _how(kind)
    how = how if own is _PLAIN else own
    return how.kind or get_args(kind)[0], InFile(unit=how.unit, entry=how.entry), how


def _alternative(kind: Any) -> Any:
    """The type of a value that may be None."""
    return next(one for one in get_args(kind) if one is not NoneType)


def _kinds(kind: Any, entries: Sequence[Any]) -> tuple[Any, ...]:
    """Types of a tuple's entries."""
    inner = get_args(kind)
    return inner[:1] * len(entries) if inner[1:] == (...,) else inner


# What a file may have: a section of the schema, which explains what is wrong.


@cache
def schema_of(kind: type, *, brief: bool = False, base: type[Base] = FileSection) -> type[Base]:
    """The section that a dataclass's fields are in a file, behind those of a base.

    Where the dataclass has a static method ``check_stated``, it is told what a file states, by key, and raises a ValueError where
    that does not go together.
    """
    found: dict[str, Any] = {
        one.key: (_in_file(one.kind, one.how, brief), None if one.may_lack(brief) else ...) for one in _filed(kind)
    }
    check = getattr(kind, "check_stated", None)

    def see(section: FileSection) -> FileSection:
        cast(Any, check)({key: getattr(section, key) for key in section.model_fields_set})
        return section

    rules: dict[str, Any] = {} if check is None else {"check_stated": model_validator(mode="after")(see)}
    return create_model(f"{kind.__name__}Section", __base__=base, __validators__=rules, **found)


def _in_file(kind: Any, how: InFile, brief: bool) -> Any:
    """Type in a file of a field's type."""
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        limits = tuple(one for one in inner[1:] if not isinstance(one, InFile))
        under, within, _ = _inner(kind, how)
        made = under if limits and under in _STRICT else _in_file(under, within, brief)
        return Annotated[(made, *limits)] if limits else made
    if origin in (Union, UnionType):
        words = [text for one in inner if get_origin(one) is Literal for text in get_args(one)]
        kinds = [_in_file(one, how, brief) for one in inner if get_origin(one) is not Literal]
        if len(kinds) - kinds.count(NoneType) + bool(words) > 1:
            raise TypeError(f"no file has a field of several types: {kind}")
        return Union[tuple([Literal[tuple(words)]] * bool(words) + kinds)]  # noqa: UP007, RUF100  of types that are computed
    if hasattr(kind, "dim_str"):
        made = how.entry or _STRICT[next(one for one in _STRICT if kind.dtypes[0].startswith(one.__name__))]
        for dim in reversed(kind.dim_str.split()):
            made = tuple[(made,) * int(dim)] if dim.isdigit() else list[made]
        return made
    if is_dataclass(kind):
        return schema_of(cast(type, kind), brief=brief)
    if origin is tuple:
        kinds = [_in_file(one, how, brief) for one in inner if one is not ...]
        return list[kinds[0]] if inner[1:] == (...,) else tuple[tuple(kinds)]
    if origin is Mapping:
        return dict[str, _in_file(inner[1], how, brief)]
    return _STRICT.get(kind, kind)


# Writing.


def describe(value: Any, *, brief: bool = False) -> dict[str, Any]:
    """What a file holds of a dataclass's value."""
    return {
        one.key: _plain(one.kind, one.how, own, brief)
        for one in _filed(type(value))
        if not one.is_left_out(own := getattr(value, one.field.name), brief)
    }


def _plain(kind: Any, how: InFile, value: Any, brief: bool) -> Any:
    """A field's value as a file has it."""
    if value is None:
        return None
    origin = get_origin(kind)
    if origin is Annotated:
        under, within, whole = _inner(kind, how)
        return _plain(under, within, value if whole.write is None else whole.write(value), brief)
    if origin in (Union, UnionType):
        return _plain(_alternative(kind), how, value, brief)
    if hasattr(kind, "dim_str"):
        return _listed(_shown(value, how), get_args(how.entry))
    if is_dataclass(kind):
        return describe(value, brief=brief)
    if origin is tuple:
        return [_plain(each, how, one, brief) for each, one in zip(_kinds(kind, value), value, strict=True)]
    if origin is Mapping:
        return {name: _plain(get_args(kind)[1], how, one, brief) for name, one in value.items()}
    return _shown(value, how)


def _shown(value: Any, how: InFile) -> Any:
    """A number, or an array, in the unit of the file."""
    return value * (1.0 / UNITS[how.unit]) if how.unit else value


def _listed(array: np.ndarray, entries: tuple[Any, ...]) -> Any:
    """An array as lists: with ``null`` where its entries may be None, and truths where they may be."""
    if NoneType not in entries:
        return array.tolist()
    out = array.astype(bool if bool in entries else float).astype(object)
    out[np.isnan(array)] = None
    return out.tolist()


# Reading.


def read_brief(path: Path, kind: type[T]) -> T:
    """Read the value of a file of TOML.

    Raises:
        FileError: it is missing, no TOML, or does not describe one; the message names the place and the value.
    """
    content = toml_of(path)
    try:
        return decode(kind, content, brief=True)
    except TaskcalError as error:
        raise FileError(path, str(error)) from error


def decode(kind: type[T], content: object, *, brief: bool = False) -> T:
    """The value that the content of a file describes.

    Raises:
        TaskcalError: it does not describe one; the message names the place and the value.
    """
    schema = schema_of(kind, brief=brief)
    try:
        return value_of(kind, schema.model_validate(content))
    except ValidationError as error:
        raise TaskcalError(explain(error, schema)) from error


def read_sealed(
    path: str | Path, file: SealedFile, kind: type[T], *, accept: bool = False
) -> tuple[T, tuple[str, ...]]:
    """Read the value of a file of JSON, and the keys that were edited since it was written.

    Args:
        path: of the file.
        file: its kind.
        kind: of the value.
        accept: whether an edited one is read all the same.

    Raises:
        FileError: it cannot be read, is something else, was edited, or is inconsistent; the message names the key.
    """
    data, edited = file.read(path, accept=accept)
    try:
        with consistent(file, schema := schema_of(kind, base=Marked)):
            return value_of(kind, schema.model_validate(data)), edited
    except TaskcalError as error:
        raise FileError(path, str(error)) from error


class Marked(FileSection):
    """What a sealed file begins with."""

    format: str
    format_version: int


@contextmanager
def consistent(file: SealedFile, schema: type[FileSection]) -> Generator[None]:
    """See that what a sealed file holds is as the schema wants it and goes together.

    Raises:
        TaskcalError: it does not; the message names the key and its value.
    """
    remedy = f"it may have been edited: {file.command} again"
    try:
        yield
    except ValidationError as error:
        raise TaskcalError(f"{explain(error, schema)}; {remedy}") from error
    except TaskcalError as error:
        raise TaskcalError(f"is inconsistent: {error}; {remedy}") from error


def value_of(kind: type[T], section: FileSection, sizes: Mapping[str, int] | None = None, key: str = "") -> T:
    """The value of a dataclass by its section in a file; arguments and errors as of `values_of`."""
    return kind(**values_of(kind, section, sizes, key))


def values_of(
    kind: type, section: FileSection, sizes: Mapping[str, int] | None = None, key: str = ""
) -> dict[str, Any]:
    """The fields of a dataclass that a file has, by their section in it.

    Args:
        kind: the dataclass.
        section: of its schema.
        sizes: of dimensions that its arrays name; one that is not known is that of the first array, or list, that has it.
        key: of the section, for messages.

    Raises:
        TaskcalError: an array has another shape, or a value is refused; the message names the key.
    """
    read, known = vars(section), dict(sizes or {})
    return {
        one.field.name: _value(one.kind, one.how, read[one.key], known, ", ".join(filter(None, [key, one.key])))
        for one in _filed(kind)
        if one.key in section.model_fields_set
    }


def _value(kind: Any, how: InFile, read: Any, sizes: dict[str, int], key: str) -> Any:
    """A field's value by what a file has."""
    if read is None:
        return None
    origin = get_origin(kind)
    if origin is Annotated:
        under, within, whole = _inner(kind, how)
        if whole.counts:
            sizes[whole.counts] = len(read)
        made = _value(under, within, read, sizes, key)
        if whole.read is None:
            return made
        made, own = whole.read(key, made), get_args(kind)[0]
        return shaped(key, made, own.dim_str, sizes) if hasattr(own, "dim_str") else made
    if origin in (Union, UnionType):
        return _value(_alternative(kind), how, read, sizes, key)
    if hasattr(kind, "dim_str"):
        made = array_of(key, read, kind.dim_str, sizes)
        return made.astype(int) if kind.dtypes[0].startswith("int") else _si(made, how)
    if is_dataclass(kind):
        return value_of(cast(type, kind), read, sizes, key)
    if origin is tuple:
        numbered = enumerate(zip(_kinds(kind, read), read, strict=True), start=1)
        return tuple(_value(each, how, one, sizes, f"{key} {number}") for number, (each, one) in numbered)
    if origin is Mapping:
        return {name: _value(get_args(kind)[1], how, one, sizes, f"{key}, {name}") for name, one in read.items()}
    return _si(read, how)


def _si(read: Any, how: InFile) -> Any:
    """A number, or an array, in SI units."""
    return read * UNITS[how.unit] if how.unit else read


def array_of(key: str, values: Any, dims: str, sizes: dict[str, int]) -> Float[np.ndarray, "..."]:
    """Nested lists of numbers as an array; NaN for null.

    Args:
        key: for messages.
        values: the lists.
        dims: names or sizes of the dimensions, as in an annotation; ``3*targets`` is a size, too.
        sizes: of those that are known; others are added.

    Raises:
        TaskcalError: they have another shape, or none; the message names the key.
    """
    try:
        array = np.array(values, dtype=float)
    except ValueError as error:
        raise TaskcalError(f"the rows of '{key}' differ in length") from error
    return shaped(key, array, dims, sizes)


def shaped(key: str, array: np.ndarray, dims: str, sizes: dict[str, int]) -> np.ndarray:
    """An array, where its dimensions have their sizes; arguments and errors as of `array_of`."""
    for dim, size in zip(dims.split(), array.shape, strict=False):
        if dim.isidentifier():
            sizes.setdefault(dim, size)
    shape = tuple(
        math.prod(int(part) if part.isdigit() else sizes.get(part, 0) for part in dim.split("*"))
        for dim in dims.split()
    )
    if array.size == 0 and 0 in shape:  # nothing was estimated: JSON has no empty matrix
        array = np.zeros(shape)
    if array.shape != shape:
        raise TaskcalError(f"'{key}' has shape {array.shape}, not {shape}")
    return array
