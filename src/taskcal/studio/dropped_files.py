"""Files that a page sends: kept in the project's folder, under a name made from theirs, and taken up."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from urllib.parse import unquote

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from taskcal.errors import TaskcalError
from taskcal.studio.project import CAMPAIGN_ENDINGS, CELL_ENDINGS, LAYOUT, PROGRAM_ENDINGS, ROBOT_ENDINGS, TASK_ENDINGS
from taskcal.studio.studio import Studio


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of file that may be dropped."""

    folder: str
    endings: tuple[str, ...]
    choice: str
    """Which of the project's choices it becomes."""


KINDS: Mapping[str, Kind] = {
    "robot": Kind(folder=LAYOUT.robots, endings=ROBOT_ENDINGS, choice="robot"),
    "campaign": Kind(folder=LAYOUT.campaigns, endings=CAMPAIGN_ENDINGS, choice="campaign"),
    "task": Kind(folder=LAYOUT.tasks, endings=TASK_ENDINGS, choice="task"),
    "cell": Kind(folder=LAYOUT.cells, endings=CELL_ENDINGS, choice="cell"),
    "program": Kind(folder=LAYOUT.programs, endings=PROGRAM_ENDINGS, choice="program"),
}


def receiver(studio: Studio) -> Callable[[str, Request], Awaitable[Response]]:
    """What takes files for a project.

    Args:
        studio: whose project it is.
    """

    async def receive(kind: str, request: Request) -> Response:
        if kind not in KINDS:
            return JSONResponse({"message": "no files of this kind are taken"}, status_code=404)
        wanted, given = KINDS[kind], unquote(request.headers.get("x-file-name", ""))
        content = await request.body()
        try:
            path = await run_in_threadpool(studio.project.put, wanted.folder, given, content, wanted.endings)
            await run_in_threadpool(lambda: studio.project.choose(**{wanted.choice: path}))
        except TaskcalError as error:
            return JSONResponse({"message": str(error)}, status_code=422)
        return JSONResponse({"path": path})

    return receive
