"""What all pages of a running studio share: the project, and what is being computed for it."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence

from taskcal.errors import TaskcalError
from taskcal.studio.project import Project
from taskcal.studio.runs import CommandRun, Status


class Studio:
    """A project that is being worked on, in however many tabs."""

    def __init__(self, project: Project) -> None:
        self.project = project
        self._runs: dict[str, CommandRun] = {}
        self._tasks: set[asyncio.Task[None]] = set()

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
        run = CommandRun(arguments, self.project.folder, kind)
        self._runs[kind] = run
        task = asyncio.get_running_loop().create_task(_kept(run, then))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return run

    async def close(self) -> None:
        """End everything that is being computed."""
        await asyncio.gather(*(run.cancel() for run in self._runs.values() if run.status is Status.running))


async def _kept(run: CommandRun, then: Callable[[CommandRun], Awaitable[None]] | None) -> None:
    """Run a command; what goes wrong around it is its end, not the server's."""
    try:
        await run.run(then)
    except (OSError, TaskcalError) as error:
        run.messages.append(f"error: {error}")
        run.status = Status.refused
