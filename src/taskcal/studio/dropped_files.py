"""Files that a page sends: kept in the project's folder, under a name made from theirs, and taken up."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from urllib.parse import unquote

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from taskcal.errors import TaskcalError
from taskcal.studio.project import (
    CAMPAIGN_ENDINGS,
    CELL_ENDINGS,
    LAYOUT,
    PROGRAM_ENDINGS,
    ROBOT_ENDINGS,
    STATION_ENDINGS,
    TABLE_ENDINGS,
    TASK_ENDINGS,
    Project,
)
from taskcal.studio.robot_archive import unpack_robot
from taskcal.studio.robot_meshes import MESH_ENDINGS, put_mesh
from taskcal.studio.studio import Studio


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A kind of file that may be dropped."""

    folder: str
    endings: tuple[str, ...]
    choice: str
    """Which of the project's choices it becomes."""


KINDS: Mapping[str, Kind] = {
    "robot": Kind(folder=LAYOUT.robots, endings=(*ROBOT_ENDINGS, *TABLE_ENDINGS), choice="robot"),
    "campaign": Kind(folder=LAYOUT.campaigns, endings=CAMPAIGN_ENDINGS, choice="campaign"),
    "task": Kind(folder=LAYOUT.tasks, endings=TASK_ENDINGS, choice="task"),
    "station": Kind(folder=LAYOUT.stations, endings=STATION_ENDINGS, choice="station"),
    "cell": Kind(folder=LAYOUT.cells, endings=CELL_ENDINGS, choice="cell"),
    "program": Kind(folder=LAYOUT.programs, endings=PROGRAM_ENDINGS, choice="program"),
}


ARCHIVE = ".zip"

ROBOT_DROPS = (*ROBOT_ENDINGS, *TABLE_ENDINGS, ARCHIVE, *MESH_ENDINGS)
"""Endings of all that may be dropped for a robot."""


def receiver(studio: Studio) -> Callable[[str, Request], Awaitable[Response]]:
    """What takes files for a project.

    Args:
        studio: whose project it is.
    """

    async def receive(kind: str, request: Request) -> Response:
        if kind not in KINDS:
            return JSONResponse({"message": "no files of this kind are taken"}, status_code=404)
        given, beside = (unquote(request.headers.get(name, "")) for name in ("x-file-name", "x-beside"))
        content = await request.body()
        try:
            path = await run_in_threadpool(_keep, studio.project, kind, given, content, beside)
            await run_in_threadpool(lambda: studio.project.choose(**{KINDS[kind].choice: path}))
        except TaskcalError as error:
            return JSONResponse({"message": str(error)}, status_code=422)
        return JSONResponse({"path": path})

    return receive


def _keep(project: Project, kind: str, given: str, content: bytes, beside: str) -> str:
    """Keep a file; gives what becomes the project's choice.

    Args:
        project: whose file it is.
        kind: one of `KINDS`.
        given: the name that came with it.
        content: of the file.
        beside: of a mesh, the robot that it was dropped with; the one that is chosen by default.
    """
    if kind == "robot" and given.lower().endswith(ARCHIVE):
        return unpack_robot(project, given, content)
    if kind == "robot" and given.lower().endswith(MESH_ENDINGS):
        return put_mesh(project, beside or project.choices.robot, given, content)
    wanted = KINDS[kind]
    return project.put(wanted.folder, given, content, wanted.endings)
