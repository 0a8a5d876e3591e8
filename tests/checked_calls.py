"""Shapes and types in annotations are checked at a function's first calls in every test, and not at all later ones.

A check takes longer than most functions do: an experiment over a hundred robots would spend three quarters of its time on
checks that say no more than the first ones did. A function within another is new at every call of the outer one, and preparing
its check takes longer still; as it has the same code each time, its calls are counted together.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from functools import wraps
from inspect import isclass
from types import CodeType
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype

CALLS = 50
"""Of one function that are checked in one test; more than the examples that Hypothesis draws."""

_counted: Counter[CodeType] = Counter()
_check_each_call: Any = jaxtyping.jaxtyped
_check_types = beartype(conf=BeartypeConf(is_pep484_tower=True))  # a whole number does for any number


def install_checks(modules: Sequence[str]) -> None:
    """Check the first calls of all functions in modules that are yet to be imported."""
    jaxtyping.jaxtyped = _decorator  # under this name the import hook decorates every function and class
    jaxtyping.install_import_hook(modules, "beartype.beartype")


def count_anew() -> None:
    """Begin a test."""
    _counted.clear()


def _decorator(*, typechecker: Any) -> Callable[[Any], Any]:
    """What the import hook asks for, with the name of a type checker in place of its settings."""
    return check_first_calls


def check_first_calls(function: Any) -> Any:
    """Check the first calls of a function, or every construction of a dataclass."""
    if isclass(function):
        return _check_each_call(function, typechecker=_check_types)
    code = function.__code__
    if _counted[code] >= CALLS:
        return function
    checked: Callable[..., Any] | None = None

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        nonlocal checked
        __tracebackhide__ = True
        if _counted[code] >= CALLS:
            return function(*args, **kwargs)
        _counted[code] += 1
        if checked is None:  # not sooner, for most functions of the package are not called in a few tests
            checked = _check_each_call(function, typechecker=_check_types)
        return checked(*args, **kwargs)

    return call
