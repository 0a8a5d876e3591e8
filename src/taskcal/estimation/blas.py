"""One thread for the linear algebra: matrices of a hundred rows gain nothing from more, and threads contend for cores."""

from collections.abc import Callable
from functools import cache, wraps
from importlib import import_module
from typing import ParamSpec, TypeVar

from threadpoolctl import ThreadpoolController

P = ParamSpec("P")
R = TypeVar("R")


@cache
def _controller() -> ThreadpoolController:
    """Of the libraries that are loaded; SciPy brings a BLAS of its own, which would be loaded later and keep its threads."""
    import_module("scipy.linalg")
    return ThreadpoolController()


def single_threaded(function: Callable[P, R]) -> Callable[P, R]:
    """Run a function with BLAS held at one thread, and give the caller's setting back."""

    @wraps(function)
    def wrapped(*args: P.args, **kwargs: P.kwargs) -> R:
        with _controller().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return wrapped
