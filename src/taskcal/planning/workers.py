"""A function of many items, side by side: on the cores of this machine, or on a Dask cluster."""

import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from functools import cache, partial
from importlib.metadata import version
from itertools import islice
from operator import call
from pathlib import Path
from typing import Any, TypeVar, cast

from taskcal.errors import TaskcalError, UnknownName
from taskcal.estimation.matrices import ONE_BLAS_THREAD

Item = TypeVar("Item")
Result = TypeVar("Result")

ENGINES = ("loky", "threading", "sequential", "dask:ADDRESS")

POLL_S = 0.2
"""Interval at which a worker looks for its parent, and a client for the workers of a cluster, seconds: short beside what a person
waits for, and without effect on the load of a core."""


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

    if engine == "sequential":
        yield from map(function, items)
    elif engine in ("loky", "threading"):
        begin: dict[str, Any] = {"initializer": _end_with, "initargs": (os.getpid(),)} if engine == "loky" else {}
        parallel = Parallel(n_jobs=workers, backend=engine, return_as="generator_unordered", **begin)
        with ONE_BLAS_THREAD.held():  # as each of the processes has, for the same last digits
            with _interrupts_blocked():
                results = cast(Iterable[Result], parallel(delayed(function)(item) for item in items))
            yield from results
    elif engine.startswith("dask:"):
        yield from on_cluster(function, items, engine.removeprefix("dask:"), workers)
    else:
        raise UnknownName("engine", engine, ENGINES)


@contextmanager
def _interrupts_blocked() -> Generator[None, None, None]:
    """Processes that are started meanwhile do not hear Ctrl-C, which a terminal sends to them too: they end with their parent."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing.resource_tracker import ensure_running

    ensure_running()  # as it starts it lets interrupts through again, which it would do in between otherwise
    earlier = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, earlier)  # one that came meanwhile is heard now


def _end_with(parent: int) -> None:
    """Begin a worker process, which ends with its parent, even where that is killed."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(POLL_S)
        os._exit(1)

    if os.name == "posix":
        threading.Thread(target=watch, daemon=True).start()


# On the workers of a Dask cluster, which does again on another worker what was under way on one that died.

ITEMS_PER_THREAD = 4
"""Items under way for each thread of the workers: one that it is at, and some that wait, so that it need not wait for the next."""

SCHEDULER_TIMEOUT_S = 10.0
"""Seconds that are waited for the scheduler's answer, and for a first worker: both answer in milliseconds where they run; a
convention."""

NO_WORKERS_S = 60.0
"""Seconds without any worker after which none is expected to come back; a nanny starts one again in some seconds."""

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
        import cloudpickle
        from dask.distributed import CancelledError, Client, KilledWorker, wait  # pyright: ignore
        from distributed.comm import CommClosedError  # pyright: ignore
    except ImportError as error:
        raise TaskcalError("the dask engine needs dask[distributed]; install Taskcal with its extra: dask") from error
    whose = f"the Dask scheduler at '{address}'"
    try:
        client: Any = Client(address, timeout=SCHEDULER_TIMEOUT_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise TaskcalError(
            f"no Dask scheduler answers at '{address}': {error}; name one as 'dask scheduler' prints it: tcp://HOST:PORT"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=SCHEDULER_TIMEOUT_S)
        except TimeoutError as error:
            raise TaskcalError(f"{whose} has no workers; start some with 'dask worker {address}'") from error
        try:
            # Bytes, so that the scheduler needs no Taskcal; the result of a task, which Dask makes again where the workers
            # that held it died. Scattered data would be lost with them.
            work = client.submit(
                cloudpickle.loads, cloudpickle.dumps(partial(_here, _installed(), function)), pure=False
            )
            left, under_way, seen = iter(items), set[Any](), time.monotonic()
            while True:
                try:
                    threads = sum(client.nthreads().values())
                except (OSError, TimeoutError) as error:
                    raise CommClosedError(str(error)) from error
                seen = time.monotonic() if threads else seen
                if time.monotonic() - seen > NO_WORKERS_S:
                    raise TaskcalError(
                        f"{whose} has had no workers for {NO_WORKERS_S:.0f} s; see why they ended (memory?), and start some "
                        "with 'dask worker'"
                    )
                room = max(ITEMS_PER_THREAD * threads, 1)
                room = (room if workers < 1 else min(room, workers)) - len(under_way)
                for item in islice(left, max(room, 0)):
                    under_way.add(client.submit(call, work, cloudpickle.dumps(item), pure=False))
                if not under_way:
                    return
                try:
                    with client.as_current():
                        done, under_way = cast(Any, wait(under_way, timeout=POLL_S, return_when="FIRST_COMPLETED"))
                except TimeoutError:
                    continue
                yield from client.gather(list(done))
        except KilledWorker as error:
            raise TaskcalError(
                f"{error.allowed_failures + 1} workers of {whose} died at the same item; see their log (memory?)"
            ) from error
        except ImportError as error:
            raise TaskcalError(f"a worker cannot take part: {error}; install there what is imported here") from error
        except (CommClosedError, CancelledError) as error:
            raise TaskcalError(
                f"{whose} no longer answers ({type(error).__name__}: {error}); what was under way is lost"
            ) from error


def _here(installed: str, function: Callable[[Item], Result], item: bytes) -> Result:
    """The result, on a worker on which the same is installed.

    Raises:
        TaskcalError: it is not. Dask itself only warns of other versions, and workers may join later.
    """
    if _installed() != installed:
        from dask.distributed import get_worker  # pyright: ignore

        raise TaskcalError(
            f"the worker {get_worker().address} cannot take part: it has {_installed()}, here is {installed}; install the same "
            "on both"
        )
    import cloudpickle

    return function(cloudpickle.loads(item))


@cache
def _installed() -> str:
    """Versions of `RELEASE`, and a digest of Taskcal's sources, whose states one version does not tell apart."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(f"{source.relative_to(package).as_posix()}\n".encode())
        digest.update(source.read_bytes().replace(b"\r\n", b"\n"))
    return ", ".join(f"{name} {version(name)}" for name in RELEASE) + f", sources {digest.hexdigest()[:8]}"
