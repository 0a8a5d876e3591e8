"""A Dask cluster of processes of its own, as ``dask scheduler`` and ``dask worker`` start it."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

DASK = (sys.executable, "-m", "dask")


@dataclass(frozen=True)
class Cluster:
    """A scheduler that runs, and where it writes what it has to say."""

    address: str
    folder: Path
    process: int
    """Number of the scheduler's."""

    @contextmanager
    def workers(
        self, count: int = 1, *options: str, threads: int = 1, python: Sequence[str] = DASK
    ) -> Generator[subprocess.Popen, None, None]:
        """So many worker processes of so many threads each, below a parent that starts those anew that die."""
        arguments = [
            *python,
            "worker",
            self.address,
            "--nworkers",
            str(count),
            "--nthreads",
            str(threads),
            "--no-dashboard",
        ]
        with _running([*arguments, "--local-directory", str(self.folder), *options], self.folder) as process:
            yield process


@contextmanager
def scheduler(folder: Path, *, python: Sequence[str] = DASK) -> Generator[Cluster, None, None]:
    """A scheduler without workers."""
    told = folder / "scheduler.json"
    arguments = [*python, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard"]
    with _running([*arguments, "--scheduler-file", str(told)], folder) as process:
        until = time.monotonic() + 30.0
        while not (told.exists() and told.read_text()):
            assert process.poll() is None, "no scheduler"
            assert time.monotonic() < until, "no scheduler"
            time.sleep(0.02)
        yield Cluster(json.loads(told.read_text())["address"], folder, process.pid)


@contextmanager
def cluster(folder: Path, workers: int = 2, threads: int = 1) -> Generator[Cluster, None, None]:
    """A scheduler and its workers, which all take part."""
    from dask.distributed import Client

    with ExitStack() as stack:
        made = stack.enter_context(scheduler(folder))
        stack.enter_context(made.workers(workers, threads=threads))
        with Client(made.address, set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=60)
        yield made


@contextmanager
def _running(arguments: Sequence[str], folder: Path) -> Generator[subprocess.Popen, None, None]:
    settings = {**os.environ, "OMP_NUM_THREADS": "1", "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": "1"}
    with subprocess.Popen(
        arguments, cwd=folder, env=settings, start_new_session=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as process:  # fmt: skip
        try:
            yield process
        finally:
            os.killpg(process.pid, signal.SIGKILL)  # its workers with it, whatever they are at
