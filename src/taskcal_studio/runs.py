"""Commands of the command line that a studio runs, each in a process of its own: progress, result, and end at any time."""

import asyncio
import json
import os
import shlex
import signal
import sys
from collections.abc import Awaitable, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from taskcal.errors import TaskcalError
from taskcal.io.files import write_whole
from taskcal_studio.project import LAYOUT, Project

GRACE_S = 0.5
"""Time that a cancelled command has to end by itself."""

MAX_LINE_BYTES = 1 << 26
"""Of one line that a command writes: more than the largest result."""

MAX_MESSAGES = 200
"""Of one command that are kept; a page shows them all."""


ASKS = "measure"
"""Kind of run that asks questions, whose answers it reads line by line."""

EXAMINES = "doctor"
"""Kind of run that is begun without being asked for, and again where it was interrupted."""


class Status(StrEnum):
    """Progress of a run."""

    running = "running"
    done = "done"
    refused = "refused"
    cancelled = "cancelled"


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The step that a command is at."""

    step: str = ""
    done: int = 0
    of: int | None = None


class CommandRun:
    """One run."""

    def __init__(self, arguments: Sequence[str], folder: Path, kind: str) -> None:
        self.arguments = tuple(arguments)
        self.kind = kind
        """What it is for: at most one of each kind runs in a project."""
        self.progress = Progress()
        self.messages: list[str] = []
        """What it says beside its result."""
        self.result: dict[str, Any] | None = None
        self.lines: list[str] = []
        """What it wrote on standard output so far, with the ends of lines."""
        self.status = Status.running
        self._folder = folder
        self._process: asyncio.subprocess.Process | None = None
        self._cancelled = False

    @property
    def line(self) -> str:
        """Command line as a person would type it, in the project's folder."""
        return "taskcal " + shlex.join(argument for argument in self.arguments if argument != "--json")

    @property
    def output(self) -> str:
        """What it wrote on standard output so far."""
        return "".join(self.lines)

    async def run(self, then: Callable[["CommandRun"], Awaitable[None]] | None = None) -> None:
        """Run it to its end; a cancelled one ends early.

        Args:
            then: what is done with a result before the run counts as done.
        """
        environment = {
            **os.environ,
            "TASKCAL_PROGRESS": "lines",
            "PYTHONIOENCODING": "utf-8",
            "COLUMNS": "100",
            "NO_COLOR": "1",
        }
        own_group: dict[str, Any] = {"start_new_session": True} if os.name == "posix" else {}
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "taskcal", *self.arguments),
            cwd=self._folder,
            env=environment,
            stdin=asyncio.subprocess.PIPE if self.kind == ASKS else asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            limit=MAX_LINE_BYTES,
            **own_group,
        )
        if self._cancelled:
            self._signal(kill=True)
        await asyncio.gather(self._read(self._process), self._listen(self._process))
        code = await self._process.wait()
        for said in (self.output, *self.lines[-1:]):  # of what tells line by line, the last one is the result
            with suppress(ValueError):
                parsed = json.loads(said)
                self.result = parsed if isinstance(parsed, dict) else None
                break
        if self._cancelled:
            self.status = Status.cancelled
            return
        if then is not None and self.result is not None:
            await then(self)
        self.status = Status.done if code == 0 else Status.refused

    async def cancel(self) -> None:
        """End it, with what it started, within a second."""
        self._cancelled = True
        process = self._process
        if process is None or process.returncode is not None:
            return
        self._signal(kill=False)
        with suppress(TimeoutError):
            await asyncio.wait_for(process.wait(), GRACE_S)
        self._signal(kill=True)

    def interrupt(self) -> None:
        """Ask it to end by itself, as Ctrl-C does; twice, at once. Where there is no such signal it ends at once, too."""
        if self._process is None:
            return
        if os.name != "posix":
            self._signal(kill=True)
            return
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGINT)

    def answer(self, line: str) -> None:
        """Answer what it asks, in a line."""
        if self._process is not None and self._process.returncode is None and self._process.stdin is not None:
            self._process.stdin.write(f"{' '.join(line.split())}\n".encode())

    def _signal(self, *, kill: bool) -> None:
        assert self._process is not None
        with suppress(ProcessLookupError):
            if os.name == "posix":
                os.killpg(self._process.pid, signal.SIGKILL if kill else signal.SIGTERM)
            elif self._process.returncode is None:
                self._process.kill()

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        """Take what it writes as it comes."""
        assert process.stdout is not None
        async for raw in process.stdout:
            self.lines.append(raw.decode("utf-8", "replace"))

    async def _listen(self, process: asyncio.subprocess.Process) -> None:
        """Take progress and messages from standard error."""
        assert process.stderr is not None
        async for raw in process.stderr:
            line = raw.decode("utf-8", "replace").rstrip()
            step = _progress(line)
            if step is not None:
                self.progress = step
            elif line and len(self.messages) < MAX_MESSAGES:
                self.messages.append(line)


def _progress(line: str) -> Progress | None:
    if not line.startswith('{"step":'):
        return None
    try:
        said = json.loads(line)
        return Progress(
            step=str(said["step"]), done=int(said["done"]), of=None if said["of"] is None else int(said["of"])
        )
    except (ValueError, KeyError, TypeError):
        return None


class Studio:
    """A project that is being worked on, in however many tabs."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self._runs: dict[str, CommandRun] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._closing = False
        self.examined = ""
        """Digest of robot and campaign that the doctor saw last."""
        self.unread = ""
        """Likewise of those whose file could not be read last."""

    def running(self) -> set[str]:
        """Kinds of the runs that go on."""
        return {kind for kind, run in self._runs.items() if run.status is Status.running}

    def findings(self) -> Sequence[Mapping[str, Any]]:
        """What the doctor found last."""
        run = self._runs.get(EXAMINES)
        return () if run is None or run.status is not Status.done or run.result is None else run.result["findings"]

    def _record_of(self, kind: str) -> Path:
        return self.project.path(f"{LAYOUT.history}/run-{kind}.txt")

    def interrupted(self) -> dict[str, str]:
        """Command lines of runs that a studio before this one began and did not live to end, by their kinds."""
        found: dict[str, str] = {}
        for path in sorted((self.project.folder / LAYOUT.history).glob("run-*.txt")):
            kind = path.stem.removeprefix("run-")
            with suppress(OSError, ValueError):
                if kind not in self._runs:
                    found[kind] = path.read_text(encoding="utf-8")
        return found

    def forget(self, kind: str) -> None:
        """Keep a run that was interrupted no longer."""
        self._record_of(kind).unlink(missing_ok=True)

    def run_of(self, kind: str) -> CommandRun | None:
        """The last run of a kind, whether it is still going on or not."""
        return self._runs.get(kind)

    def start(
        self,
        kind: str,
        arguments: Sequence[str],
        then: Callable[[CommandRun], Awaitable[None]] | None = None,
    ) -> CommandRun:
        """Run a command for a page, in the project's folder.

        Args:
            kind: what it is for.
            arguments: of ``taskcal``.
            then: what is done with its result.

        Raises:
            TaskcalError: one of the kind is running already, perhaps from another tab.
        """
        before = self._runs.get(kind)
        if before is not None and before.status is Status.running:
            raise TaskcalError("this is being computed already, perhaps for another tab; wait for it or cancel it")
        self.project.path(LAYOUT.history).mkdir(exist_ok=True)
        run = CommandRun(arguments, self.project.folder, kind)
        if kind != EXAMINES:
            write_whole(self._record_of(kind), run.line)
        self._runs[kind] = run
        task = asyncio.get_running_loop().create_task(self._kept(run, then))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return run

    async def close(self) -> None:
        """End everything that is being computed; it is named as the project is opened again."""
        self._closing = True
        await asyncio.gather(*(run.cancel() for run in self._runs.values() if run.status is Status.running))

    async def _kept(self, run: CommandRun, then: Callable[[CommandRun], Awaitable[None]] | None) -> None:
        """Run a command; what goes wrong around it is its end, not the server's."""
        try:
            await run.run(then)
        except (OSError, TaskcalError) as error:
            run.messages.append(f"error: {error}")
            run.status = Status.refused
        if not self._closing:
            self.forget(run.kind)
