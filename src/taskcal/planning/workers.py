"""A function of many items, side by side: on the cores of this machine, or on a Dask cluster."""

import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from functools import cache, partial
from itertools import islice
from operator import call
from pathlib import Path
from typing import Any, TypeVar, cast

from taskcal.errors import TaskcalError, UnknownName

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


# A function of many items on the workers of a Dask cluster: results as they are done, few items under way.
#
# Dask does again on another worker what was under way on one that died.

AHEAD = 4
"""Items under way for each thread of the workers: one that it is at, and some that wait, so that it need not wait for the next."""

PATIENCE = 10.0
"""Seconds that are waited for the scheduler's answer, and for a first worker."""

LOST = 60.0
"""Seconds without any worker, in the midst of it, after which none is expected to come back."""

CLUSTER_POLL_S = 0.5
"""Seconds after which the workers are counted again."""

RELEASE = ("taskcal", "numpy", "scipy", "numba")
"""Packages on which results depend, to the last digit."""


def on_cluster(
    function: Callable[[Item], Result], items: Iterable[Item], address: str, workers: int = -1
) -> Generator[Result, None, None]:
    """Results as they are done, in no order.

    Args:
        function: of one item; its result may depend on the item alone, since it may be called again after a worker died.
        items: what it is called with, taken as room becomes free.
        address: of the scheduler.
        workers: items under way at most; −1 for four for each thread of the workers.

    Raises:
        TaskcalError: Dask is not installed, the scheduler does not answer or is gone, there are no workers, or another
            Taskcal is installed there; besides, whatever the function raises.
    """
    try:
        from dask.distributed import CancelledError, Client, KilledWorker  # pyright: ignore
        from distributed.comm import CommClosedError  # pyright: ignore
    except ImportError as error:
        raise TaskcalError("the dask engine needs dask[distributed]; install Taskcal with its extra: dask") from error
    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise TaskcalError(
            f"no Dask scheduler answers at '{address}': {error}; name one as 'dask scheduler' prints it: tcp://HOST:PORT"
        ) from error
    with client:
        try:
            _check_cluster(client, address)
            yield from _results(client, address, function, iter(items), workers)
        except KilledWorker as error:
            raise TaskcalError(
                f"{error.allowed_failures + 1} workers of the Dask scheduler at '{address}' died at the same item; see their "
                "log (memory?)"
            ) from error
        except ImportError as error:
            raise TaskcalError(f"a worker cannot take part: {error}; install there what is imported here") from error
        except (CommClosedError, CancelledError) as error:
            raise TaskcalError(
                f"the Dask scheduler at '{address}' no longer answers ({type(error).__name__}: {error}); what was under way is lost"
            ) from error


def _check_cluster(client: Any, address: str) -> None:
    """See that there is a worker, and that the same is installed on all of them; the scheduler needs no Taskcal.

    Raises:
        TaskcalError: no worker comes, or one has another release.
    """
    try:
        client.wait_for_workers(1, timeout=PATIENCE)
    except TimeoutError as error:
        raise TaskcalError(
            f"the Dask scheduler at '{address}' has no workers; start some with 'dask worker {address}'"
        ) from error
    versions = client.get_versions(packages=RELEASE)
    here = _installed(versions["client"])
    for worker, said in versions["workers"].items():
        if (there := _installed(said)) != here:
            raise TaskcalError(
                f"the worker {worker} cannot take part: it has {there}, here is {here}; install the same on both"
            )


def _installed(versions: Any) -> str:
    return ", ".join(f"{name} {versions['packages'][name] or 'not at all'}" for name in RELEASE)


def _results(
    client: Any, address: str, function: Callable[[Item], Result], left: Iterator[Item], most: int
) -> Generator[Result, None, None]:
    """Results, with as many items under way as the workers that are there have room for.

    Raises:
        TaskcalError: there has been no worker for long.
    """
    import cloudpickle
    from dask.distributed import wait  # pyright: ignore

    # Bytes, so that the scheduler needs no Taskcal. A task's result is made again where the workers that held it died;
    # scattered data are lost with them.
    work = client.submit(cloudpickle.loads, cloudpickle.dumps(partial(_on_worker, _sources(), function)), pure=False)
    client.replicate(work)
    under_way: set[Any] = set()
    threads, counted, seen = 0, float("-inf"), time.monotonic()
    while True:
        now = time.monotonic()
        if now - counted >= CLUSTER_POLL_S:
            counted, threads = now, sum(client.nthreads().values())
        if threads:
            seen = now
        elif now - seen > LOST:
            raise TaskcalError(
                f"the Dask scheduler at '{address}' has had no workers for {LOST:.0f} s; "
                "see why they ended (memory?), and start some with 'dask worker'"
            )
        room = max(AHEAD * threads, 1) if most < 1 else min(max(AHEAD * threads, 1), most)
        for item in islice(left, max(room - len(under_way), 0)):
            under_way.add(client.submit(call, work, cloudpickle.dumps(item), pure=False))
        if not under_way:
            return
        try:
            with client.as_current():
                done, under_way = cast(Any, wait(under_way, timeout=CLUSTER_POLL_S, return_when="FIRST_COMPLETED"))
        except TimeoutError:
            continue
        yield from client.gather(list(done))


def _on_worker(sources: str, function: Callable[[Item], Result], item: bytes) -> Result:
    """The result, on a worker that has the same sources.

    Raises:
        TaskcalError: it has others; the version alone does not tell them apart.
    """
    if _sources() != sources:
        from dask.distributed import get_worker  # pyright: ignore

        raise TaskcalError(
            f"the worker {get_worker().address} cannot take part: its sources of Taskcal are {_sources()}, here they are "
            f"{sources}; install the same on both"
        )
    import cloudpickle

    return function(cloudpickle.loads(item))


@cache
def _sources() -> str:
    """Digest of Taskcal's sources."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(f"{source.relative_to(package).as_posix()}\n".encode())
        digest.update(source.read_bytes().replace(b"\r\n", b"\n"))
    return digest.hexdigest()[:8]
