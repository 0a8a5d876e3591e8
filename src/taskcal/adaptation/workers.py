"""A function of many items, side by side: on the cores of this machine, or on a Dask cluster."""

import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from typing import Any, TypeVar, cast

from taskcal.errors import UnknownName

Item = TypeVar("Item")
Result = TypeVar("Result")

ENGINES = ("loky", "threading", "sequential", "dask:ADDRESS")
WARNINGS, CLEARED_UP = "PYTHONWARNINGS", "ignore:resource_tracker:UserWarning"

LOOK = 0.2
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
        TaskcalError: of `on_cluster`.
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
        with _deaf_children():
            results = cast(Iterable[Result], Parallel(backend=engine, **parallel)(jobs))
        yield from results
    elif engine.startswith("dask:"):
        from taskcal.adaptation.cluster import on_cluster

        yield from on_cluster(function, items, engine.removeprefix("dask:"), workers)
    else:
        raise UnknownName("engine", engine, ENGINES)


@contextmanager
def _deaf_children() -> Generator[None, None, None]:
    """Processes that are started meanwhile do not hear Ctrl-C, which a terminal sends to them too: they end with their parent.

    The one that clears up after the others then does so without a word: that they ended in the middle is what was asked for.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing.resource_tracker import ensure_running

    warned = os.environ.get(WARNINGS)
    os.environ[WARNINGS] = f"{warned},{CLEARED_UP}" if warned else CLEARED_UP
    ensure_running()  # as it starts it lets interrupts through again, which it would do in between otherwise
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)  # one that came meanwhile is heard now
        if warned is None:
            del os.environ[WARNINGS]
        else:
            os.environ[WARNINGS] = warned


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
