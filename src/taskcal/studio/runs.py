"""A command of the command line, run in a process of its own: its progress, its result, and its end at any time."""

import asyncio
import json
import os
import shlex
import signal
import sys
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

GRACE = 0.5
"""Seconds that a cancelled command has to end by itself."""

LONGEST_LINE = 1 << 26
"""Bytes of one line that a command writes."""

MESSAGES = 200
"""Of one command that are kept."""


class Status(StrEnum):
    """How far a run has come."""

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
        self.output = ""
        """What it wrote on standard output."""
        self.status = Status.running
        self._folder = folder
        self._process: asyncio.subprocess.Process | None = None
        self._cancelled = False

    @property
    def line(self) -> str:
        """As a person would type it, in the project's folder."""
        return "taskcal " + shlex.join(argument for argument in self.arguments if argument != "--json")

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
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            limit=LONGEST_LINE,
            **own_group,
        )
        if self._cancelled:
            self._signal(kill=True)
        assert self._process.stdout is not None
        written, _ = await asyncio.gather(self._process.stdout.read(), self._listen(self._process))
        code = await self._process.wait()
        self.output = written.decode("utf-8", "replace")
        with suppress(ValueError):
            parsed = json.loads(self.output)
            self.result = parsed if isinstance(parsed, dict) else None
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
            await asyncio.wait_for(process.wait(), GRACE)
        self._signal(kill=True)

    def _signal(self, *, kill: bool) -> None:
        assert self._process is not None
        with suppress(ProcessLookupError):
            if os.name == "posix":
                os.killpg(self._process.pid, signal.SIGKILL if kill else signal.SIGTERM)
            elif self._process.returncode is None:
                self._process.kill()

    async def _listen(self, process: asyncio.subprocess.Process) -> None:
        """Take progress and messages from standard error."""
        assert process.stderr is not None
        async for raw in process.stderr:
            line = raw.decode("utf-8", "replace").rstrip()
            step = _progress(line)
            if step is not None:
                self.progress = step
            elif line and len(self.messages) < MESSAGES:
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
