"""Shapes and types in annotations are checked at a function's first call in a file of tests, and where the arguments are new.

A check takes longer than most functions do: an experiment over a hundred robots would spend three quarters of its time on
checks that say no more than the first ones did. So a call whose arguments have the types and shapes of one that was right is not
checked again, but for the first one in every file of tests, whose result may differ. (The first one in every test took 11 % of
the processor time of tests of fits and plans, and one in a file takes next to nothing.)

A function within another is new at every call of the outer one, and preparing
its check takes longer still; as it has the same code each time, its calls are counted together, and its check is prepared once.
"""

import threading
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, is_dataclass
from functools import wraps
from inspect import CO_NESTED, isclass, isgeneratorfunction
from types import CodeType
from typing import Any, ForwardRef, Literal, get_args, get_origin

import jaxtyping
import numpy as np
from beartype import BeartypeConf, beartype

CALLS = 30
"""Of one function that may be checked in one test, the first ones; more than the examples that Hypothesis draws."""

MAX_TUPLE = 8
"""Members of a tuple whose shapes are told apart: of a long one, such as names, the checks look at one member too."""

Signature = tuple[Any, ...]

_jaxtyped: Any = jaxtyping.jaxtyped
_shapes: AbstractContextManager[None] = _jaxtyped("context")  # lengths that names in annotations stand for, of one call
_check_types = beartype(
    conf=BeartypeConf(
        is_pep484_tower=True, violation_type=jaxtyping.TypeCheckError
    )  # a whole number does for any number
)


@dataclass(slots=True)
class _Calls:
    """Of all functions of one code."""

    test: int = 0
    number: int = 0
    """Of those in this test."""
    file: object = None
    """Of tests, in which one was right."""
    right: set[Signature] = field(default_factory=set)
    """Types and shapes of calls that were right, in any test."""
    checked: Callable[..., Any] | None = None


class _Running(threading.local):
    """Functions within others whose calls are being checked, the innermost last."""

    def __init__(self) -> None:
        self.functions: list[Callable[..., Any]] = []


_test, _file = 0, object()
_calls: dict[CodeType, _Calls] = {}
_running = _Running()


def install_checks(modules: Sequence[str]) -> None:
    """Check the first calls of all functions in modules that are yet to be imported."""
    jaxtyping.jaxtyped = _decorator  # under this name the import hook decorates every function and class
    jaxtyping.install_import_hook(modules, "beartype.beartype")


def begin_test(file: object) -> None:
    """Count the calls of a test of a file from its beginning."""
    global _test, _file
    _test, _file = _test + 1, file


def _decorator(*, typechecker: Any) -> Callable[[Any], Any]:
    """What the import hook asks for, with the name of a type checker in place of its settings."""
    return check_first_calls


def _signature(args: tuple[Any, ...], kwargs: dict[str, Any]) -> Signature:
    """Types of arguments, and shapes and types of arrays, also of those in tuples."""
    return (*map(_kind, args), *map(_kind, kwargs.values()), *kwargs)


def _kind(argument: Any) -> Any:
    cls = type(argument)
    if cls is np.ndarray:
        return argument.shape, argument.dtype
    return tuple(map(_kind, argument)) if cls is tuple and len(argument) <= MAX_TUPLE else cls


def _check_new_signatures(function: Callable[..., Any]) -> Callable[..., Any]:
    """Check every call whose arguments have other types or shapes than those of calls that were right."""
    checked, right = _check_each_call(function), set[Signature]()
    if checked is function:
        return function

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        signature = _signature(args, kwargs)
        if signature in right:
            return function(*args, **kwargs)
        result = checked(*args, **kwargs)
        right.add(signature)
        return result

    return call


def check_first_calls(function: Any) -> Any:
    """Check calls of a function, or constructions of a dataclass, as far as they tell something new."""
    if isclass(function):
        if is_dataclass(function) and "__init__" in vars(function):
            init = function.__init__
            if hasattr(init, "__wrapped__"):  # of a class that makes arguments what its annotations say
                init.__wrapped__ = _check_new_signatures(init.__wrapped__)
            else:
                function.__init__ = _check_new_signatures(init)
        return function
    calls = _calls.setdefault(function.__code__, _Calls())
    if calls.test == _test and calls.number >= CALLS:
        return function
    nested = bool(function.__code__.co_flags & CO_NESTED)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        if calls.test != _test:
            calls.test, calls.number = _test, 0
        if calls.number >= CALLS:
            return function(*args, **kwargs)
        calls.number += 1
        signature = _signature(args, kwargs)
        if calls.file == _file and signature in calls.right:
            return function(*args, **kwargs)
        if calls.checked is None:  # not sooner, for most functions of the package are not called in a few tests
            calls.checked = _check_each_call(_innermost_running(function) if nested else function)
        if nested:
            _running.functions.append(function)
        try:
            result = calls.checked(*args, **kwargs)
        finally:
            if nested:
                _running.functions.pop()
        calls.file = _file
        calls.right.add(signature)
        return result

    return call


def _innermost_running(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of the same arguments, which calls that one of its code that is running."""

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        return _running.functions[-1](*args, **kwargs)

    return call


def _check_each_call(function: Callable[..., Any]) -> Callable[..., Any]:
    """The types are checked as they come, the shapes of arguments and result by the same names."""
    if isgeneratorfunction(function) or any(map(_is_quoted, function.__annotations__.values())):
        return _jaxtyped(function, typechecker=_check_types)  # slower, but not of what is yielded or not yet defined
    checked = _check_types(function)
    if checked is function:  # it has no annotations
        return function

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        __tracebackhide__ = True
        with _shapes:
            return checked(*args, **kwargs)

    return call


def _is_quoted(annotation: Any) -> bool:
    """Whether an annotation names in quotes a type that may be defined later, or for the type checker alone."""
    if get_origin(annotation) is Literal:
        return False
    parts = annotation if isinstance(annotation, list) else get_args(annotation)
    return isinstance(annotation, str | ForwardRef) or any(map(_is_quoted, parts))
