"""A function of many items, side by side: on the cores of this machine, or on a Dask cluster."""

import os
import threading
import time
from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar, cast

from taskcal.errors import TaskcalError, UnknownName

Item = TypeVar("Item")
Result = TypeVar("Result")

ENGINES = ("loky", "threading", "sequential", "dask:ADDRESS")
LOOK = 0.5
"""Seconds after which a worker looks for its parent again."""


def side_by_side(
    function: Callable[[Item], Result], items: Iterable[Item], engine: str, workers: int
) -> Generator[Result, None, None]:
    """Results as they are done, in no order.

    Args:
        function: of one item; it has to be picklable, but for threads.
        items: what it is called with.
        engine: ``loky`` for processes, ``threading``, ``sequential``, or ``dask:ADDRESS`` of a scheduler.
        workers: how many; −1 for one per core.

    Raises:
        UnknownName: an engine that does not exist.
        TaskcalError: the scheduler does not answer, or Dask is not installed.
    """
    from joblib import Parallel, delayed

    parallel: dict[str, Any] = {"n_jobs": workers, "return_as": "generator_unordered"}
    if engine == "sequential":
        yield from map(function, items)
    elif engine == "threading":
        yield from cast(Iterable[Result], Parallel(backend=engine, **parallel)(delayed(function)(i) for i in items))
    elif engine == "loky":
        parent = os.getpid()
        jobs = (delayed(_beside_parent)(parent, function, i) for i in items)
        yield from cast(Iterable[Result], Parallel(backend=engine, **parallel)(jobs))
    elif engine.startswith("dask:"):
        yield from _on_dask(function, items, engine.removeprefix("dask:"), parallel)
    else:
        raise UnknownName("engine", engine, ENGINES)


def _on_dask(
    function: Callable[[Item], Result], items: Iterable[Item], address: str, parallel: dict[str, Any]
) -> Generator[Result, None, None]:
    from joblib import Parallel, delayed, parallel_config

    try:
        from dask.distributed import Client  # pyright: ignore
    except ImportError as error:
        raise TaskcalError("the dask engine needs dask[distributed]; install Taskcal with its extra: dask") from error
    try:
        client: Any = Client(address, timeout="10s", set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise TaskcalError(
            f"no Dask scheduler answers at '{address}': {error}; name one as dask:tcp://HOST:PORT"
        ) from error
    with client, parallel_config(backend="dask", client=client):
        yield from cast(Iterable[Result], Parallel(**parallel)(delayed(function)(i) for i in items))


_watching = threading.Event()


def _beside_parent(parent: int, function: Callable[[Item], Result], item: Item) -> Result:
    """Call a function in a worker that ends with its parent, which may be killed and clean up nothing.

    A single worker is no process of its own: then the caller works itself, and watches nobody.
    """
    if os.name == "posix" and os.getpid() != parent and not _watching.is_set():
        _watching.set()
        threading.Thread(target=_end_with, args=(parent,), daemon=True).start()
    return function(item)


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK)
    os._exit(1)
