"""A function of many items, side by side: on the cores of this machine, or on a Dask cluster."""

import hashlib
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.metadata import version
from inspect import unwrap
from itertools import islice
from pathlib import Path
from queue import Empty, SimpleQueue
from types import FunctionType
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
# Function, items and results are bytes to the scheduler, which needs no Taskcal. A worker that dies takes nothing
# with it: the scheduler gives what it was at, and what it alone held, to another.

AHEAD = 4
"""Items under way for each thread of the workers: one that it is at, and some that wait, so that it need not wait for the next."""

PATIENCE = 10.0
"""Seconds that are waited for the scheduler's answer, and for a first worker."""

LOST = 60.0
"""Seconds without any worker, in the midst of it, after which none is expected to come back."""

CLUSTER_POLL_S = 0.5
"""Seconds after which the workers are counted again."""

DONE, RAISED, UNKNOWN = "done", "raised", "unknown"
"""Answers of a worker: the result, or an error; it has not seen the function yet. Any other says why it cannot take part."""


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
        TaskcalError: Dask is not installed, the scheduler does not answer or is gone, there are no workers, or one of them has
            another Taskcal; besides, whatever the function raises.
    """
    client = _connect(address)
    with client, _lost_scheduler_named(address):
        cluster = _Cluster(client, address, workers)
        cluster.await_workers()
        yield from _results(cluster, function, iter(items))


def _connect(address: str) -> Any:
    try:
        from dask.distributed import Client  # pyright: ignore
    except ImportError as error:
        raise TaskcalError("the dask engine needs dask[distributed]; install Taskcal with its extra: dask") from error
    try:
        return Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise TaskcalError(
            f"no Dask scheduler answers at '{address}': {error}; name one as 'dask scheduler' prints it: tcp://HOST:PORT"
        ) from error


@contextmanager
def _lost_scheduler_named(address: str) -> Generator[None, None, None]:
    """What Dask raises where the scheduler is gone, in words.

    Raises:
        TaskcalError: that it is gone.
    """
    from dask.distributed import CancelledError  # pyright: ignore
    from distributed.comm import CommClosedError  # pyright: ignore

    try:
        yield
    except (CommClosedError, CancelledError) as error:
        raise TaskcalError(
            f"the Dask scheduler at '{address}' no longer answers ({type(error).__name__}: {error}); what was under way is lost"
        ) from error


class _Cluster:
    """The workers of a scheduler, counted from time to time."""

    def __init__(self, client: Any, address: str, most: int):
        self.client, self.address, self.most = client, address, most
        self.threads, self.counted, self.seen = 0, float("-inf"), time.monotonic()

    def room(self) -> int:
        """How many items may be under way.

        Raises:
            TaskcalError: there has been no worker for long.
        """
        now = time.monotonic()
        if now - self.counted >= CLUSTER_POLL_S:
            self.counted, self.threads = now, sum(self.client.nthreads().values())
        if self.threads:
            self.seen = now
        elif now - self.seen > LOST:
            raise TaskcalError(
                f"the Dask scheduler at '{self.address}' has had no workers for {LOST:.0f} s; "
                "see why they ended (memory?), and start some with 'dask worker'"
            )
        room = max(AHEAD * self.threads, 1)
        return room if self.most < 1 else min(room, self.most)

    def await_workers(self) -> None:
        """Wait for a first worker.

        Raises:
            TaskcalError: none comes.
        """
        try:
            self.client.wait_for_workers(1, timeout=PATIENCE)
        except TimeoutError as error:
            raise TaskcalError(
                f"the Dask scheduler at '{self.address}' has no workers; start some with 'dask worker {self.address}'"
            ) from error


def _results(
    cluster: _Cluster, function: Callable[[Item], Result], left: Iterator[Item]
) -> Generator[Result, None, None]:
    import cloudpickle

    carry_out, own, work = _by_value(_carry_out), release(), cloudpickle.dumps(function)
    name = hashlib.sha256(work).hexdigest()
    done: SimpleQueue[Any] = SimpleQueue()
    under_way: dict[str, bytes] = {}

    def send(item: bytes, work: bytes = b"") -> None:
        future = cluster.client.submit(carry_out, own, name, work, item, pure=False)
        under_way[future.key] = item
        future.add_done_callback(done.put)

    while True:
        for item in islice(left, max(cluster.room() - len(under_way), 0)):
            send(cloudpickle.dumps(item))
        if not under_way:
            return
        futures = _drained(done)
        for future, (answer, result) in zip(futures, _fetched(futures, cluster), strict=True):
            item = under_way.pop(future.key)
            if answer == DONE:
                yield cast(Result, cloudpickle.loads(result))
            elif answer == RAISED:
                raise cloudpickle.loads(result)
            elif (
                answer == UNKNOWN
            ):  # each worker is sent it once, so that no item weighs as much and the scheduler keeps none
                send(item, work)
            else:
                raise TaskcalError(answer)


def _drained(done: "SimpleQueue[Any]") -> list[Any]:
    """All that are done, waited for a little where none is: a journey fetches many results as fast as one."""
    out: list[Any] = []
    try:
        out.append(done.get(timeout=CLUSTER_POLL_S))
        while True:
            out.append(done.get_nowait())
    except Empty:
        return out


def _fetched(futures: list[Any], cluster: _Cluster) -> list[tuple[str, bytes]]:
    """What tasks gave, waited for where one has to be done again since the worker that held it has died.

    Raises:
        TaskcalError: the workers that were at it died, one after another; or there are none any more.
    """
    from dask.distributed import KilledWorker  # pyright: ignore

    client = cluster.client

    async def gather() -> list[tuple[str, bytes]]:
        return await client.gather(futures, asynchronous=True)

    while futures:
        try:
            return client.sync(gather, callback_timeout=LOST)
        except KilledWorker as error:
            raise TaskcalError(
                f"{error.allowed_failures + 1} workers of the Dask scheduler at '{cluster.address}' died at the same item; "
                "see their log (memory?)"
            ) from error
        except TimeoutError:
            cluster.room()
    return []


def _by_value(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function, to be sent as code and not by name: scheduler and workers may have no Taskcal, or another one."""
    return FunctionType(unwrap(function).__code__, {"__name__": "__main__"}, function.__name__)


def _carry_out(own: str, name: str, work: bytes, item: bytes) -> tuple[str, bytes]:
    """On a worker: its answer, and the result or the error if it has one."""
    import traceback

    import cloudpickle
    from dask.distributed import get_worker

    refusal = f"the worker {get_worker().address} cannot take part: "
    try:
        pass
    except ImportError as error:
        return f"{refusal}{error}; it needs {own}, as here", b""
    if release() != own:
        return f"{refusal}it has {release()}, here is {own}; install the same on both", b""
    try:
        function = seen_function(name, work)
    except ImportError as error:
        return f"{refusal}{error}; install there what is imported here", b""
    if function is None:
        return "unknown", b""
    try:
        return "done", cloudpickle.dumps(function(cloudpickle.loads(item)))
    except Exception as error:
        error.add_note(f"on a worker:\n{traceback.format_exc()}")
        return "raised", cloudpickle.dumps(error)


_seen: dict[str, Callable[[Any], Any]] = {}


def seen_function(name: str, work: bytes) -> Callable[[Any], Any] | None:
    """The last function that was sent to this worker, if it has that name, or the one sent now; read once."""
    import cloudpickle

    if work and name not in _seen:
        function = cloudpickle.loads(work)
        _seen.clear()
        _seen[name] = function
    return _seen.get(name)


@cache
def release() -> str:
    """What results depend on, to the last digit: Taskcal, by its sources too, and the libraries that compute."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for source in sorted(package.rglob("*.py")):
        digest.update(f"{source.relative_to(package).as_posix()}\n".encode())
        digest.update(source.read_bytes().replace(b"\r\n", b"\n"))
    libraries = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    return f"taskcal {version('taskcal')} ({digest.hexdigest()[:8]}), {libraries}"
