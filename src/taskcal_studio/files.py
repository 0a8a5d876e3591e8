"""Files that a page sends: kept in the project's folder, under a name made from theirs, and taken up."""

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response

from taskcal.errors import TaskcalError, listed, shown
from taskcal.robot.importers.urdf import read_looks
from taskcal_groundwork.files import ZipEntry, ZipKind, open_zip
from taskcal_studio.project import (
    BOARD_ENDINGS,
    CAMERA_ENDINGS,
    CAMPAIGN_ENDINGS,
    CELL_ENDINGS,
    FIXTURE_ENDINGS,
    KINEMATICS_ENDINGS,
    LAYOUT,
    PROGRAM_ENDINGS,
    ROBOT_ENDINGS,
    STATION_ENDINGS,
    TABLE_ENDINGS,
    TASK_ENDINGS,
    URDF_ENDINGS,
    Project,
)
from taskcal_studio.robot_meshes import MAX_MESH_BYTES, MESH_ENDINGS, mesh_name, put_mesh, triangles_of
from taskcal_studio.runs import Studio
from taskcal_studio.task_box import is_of_controller

# A robot that is dropped as a zip: its URDF and the meshes that it names, and nothing else of what is in there.

ZIPPED = ZipKind(
    most_entries=5000, largest_mb=1000.0, small_mb=200.0, most_ratio=50.0, largest_entry_mb=MAX_MESH_BYTES / 1e6,
)  # fmt: skip
"""A package of a family of robots has some hundred files; meshes as text pack ten times."""

MAX_ARCHIVE_BYTES = 200_000_000
"""Unpacked bytes that are taken from a zip of meshes, at most. A convention: ten times the largest mesh."""


def unpack_robot(project: Project, given: str, content: bytes) -> str:
    """Keep the URDF of a zip in a project, with its meshes.

    No name in the archive is used as a path, and nothing is unpacked that the URDF does not name.

    Args:
        project: whose robot it is.
        given: the zip file's name, for messages.
        content: of the zip file.

    Returns:
        the robot's path from the project's folder.

    Raises:
        FileError: as `open_zip`, or what is taken is too large.
        TaskcalError: it has no URDF or several.
    """
    with open_zip(Path(shown(PurePosixPath(given).name, 60)), ZIPPED, content) as packed:
        entries = [entry for entry in packed.entries if not entry.is_folder]
        robots = [entry for entry in entries if entry.name.lower().endswith(URDF_ENDINGS)]
        if len(robots) != 1:
            named = listed((shown(entry.name, 60) for entry in robots), 5) or "none"
            raise TaskcalError(f"the zip must hold one robot (.urdf or .xacro); it has {named}")
        robot = project.put(LAYOUT.robots, robots[0].name, packed.read(robots[0]), URDF_ENDINGS)
        taken = 0
        for file in dict.fromkeys(visual.file for visual in read_looks(project.path(robot)).visuals):
            entry = _of(entries, file)
            if entry is not None:
                mesh = packed.read(entry)
                taken += len(mesh)
                if taken > MAX_ARCHIVE_BYTES:
                    raise TaskcalError(f"the meshes of the zip have more than {MAX_ARCHIVE_BYTES // 1_000_000} MB")
                put_mesh(project, robot, mesh_name(file), mesh)
        return robot


def _of(entries: list[ZipEntry], file: str) -> ZipEntry | None:
    """The entry that a URDF means: of those of its name the one whose folders agree furthest, counted from the end."""
    wanted = PurePosixPath(file.replace("\\", "/")).parts[::-1]
    if Path(file).suffix.lower() not in MESH_ENDINGS:
        return None

    def agreeing(entry: ZipEntry) -> int:
        parts = PurePosixPath(entry.name).parts[::-1]
        count = 0
        for a, b in zip(wanted, parts, strict=False):
            if a != b:
                break
            count += 1
        return count

    best = max(entries, key=agreeing, default=None)
    return best if best is not None and agreeing(best) else None


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
    "points": Kind(folder=LAYOUT.campaigns, endings=CAMPAIGN_ENDINGS, choice="points"),
    "task": Kind(folder=LAYOUT.tasks, endings=TASK_ENDINGS, choice="task"),
    "board": Kind(folder=LAYOUT.boards, endings=BOARD_ENDINGS, choice="board"),
    "camera": Kind(folder=LAYOUT.cameras, endings=CAMERA_ENDINGS, choice="camera"),
    "fixtures": Kind(folder=LAYOUT.fixtures, endings=FIXTURE_ENDINGS, choice="fixtures"),
    "station": Kind(folder=LAYOUT.stations, endings=STATION_ENDINGS, choice="station"),
    "cell": Kind(folder=LAYOUT.cells, endings=CELL_ENDINGS, choice="cell"),
    "kinematics": Kind(folder=LAYOUT.cells, endings=KINEMATICS_ENDINGS, choice="kinematics"),
    "program": Kind(folder=LAYOUT.programs, endings=PROGRAM_ENDINGS, choice="program"),
}


IMAGES = "images"
"""Kind of images of boards, which are kept together in a folder."""

ARCHIVE = ".zip"

ROBOT_DROPS = (*ROBOT_ENDINGS, *TABLE_ENDINGS, ARCHIVE, *MESH_ENDINGS)
"""Endings of all that may be dropped for a robot."""


def receiver(studio: Studio) -> Callable[[str, Request], Awaitable[Response]]:
    """Receiver of files for a project.

    Args:
        studio: whose project it is.
    """

    async def receive(kind: str, request: Request) -> Response:
        if kind not in (*KINDS, IMAGES):
            return JSONResponse({"message": "no files of this kind are taken"}, status_code=404)
        given, beside = (unquote(request.headers.get(name, "")) for name in ("x-file-name", "x-beside"))
        content = await request.body()
        try:
            if kind == IMAGES:
                path = await run_in_threadpool(studio.project.put_image, given, content)
            else:
                path = await run_in_threadpool(take_file, studio.project, kind, given, content, beside)
        except TaskcalError as error:
            return JSONResponse({"message": str(error)}, status_code=422)
        return JSONResponse({"path": path})

    return receive


def take_file(project: Project, kind: str, given: str, content: bytes, beside: str) -> str:
    """Keep a file, and choose it; arguments as of `_keep`.

    Of two files of measurements that are dropped together, one has the joints and the other the points; of the files of a program,
    those of its controller become no choice.
    """
    choice = "points" if kind == "campaign" and beside else KINDS[kind].choice
    with project.change():
        path = _keep(project, kind, given, content, beside)
        if not (kind == "program" and is_of_controller(path) and project.choices.program):
            project.choose(**{choice: path})
    return path


def _keep(project: Project, kind: str, given: str, content: bytes, beside: str) -> str:
    """Keep a file; gives what becomes the project's choice.

    Args:
        project: whose file it is.
        kind: one of `KINDS`.
        given: the name that came with it.
        content: of the file.
        beside: what it was dropped with, if that came before it; of a mesh, its robot, the one that is chosen by default.
    """
    if kind == "robot" and given.lower().endswith(ARCHIVE):
        return unpack_robot(project, given, content)
    if kind == "robot" and given.lower().endswith(MESH_ENDINGS):
        return put_mesh(project, beside or project.choices.robot, given, content)
    wanted = KINDS[kind]
    return project.put(wanted.folder, given, content, wanted.endings)


# Files of the project that a page gives out: to be kept, or looked at without being let near the studio.

GIVEN = (LAYOUT.calibrations, LAYOUT.campaigns, LAYOUT.corrected, LAYOUT.plans, LAYOUT.reports)

ISOLATED_ORIGIN_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'"
)
"""A report's figures in space need their script; in an origin of its own it reaches neither the studio nor anything else."""


def giver(studio: Studio) -> Callable[[str, str, Request], Response]:
    """Sender of files of a project.

    Args:
        studio: whose project it is.
    """

    def give(folder: str, name: str, request: Request) -> Response:
        path = f"{folder}/{name}"
        if folder not in GIVEN or path not in studio.project.files(folder):
            return PlainTextResponse("There is no such file.\n", status_code=404)
        file = studio.project.path(path)
        if name.endswith(".html") and "keep" not in request.query_params:
            return FileResponse(
                file, media_type="text/html", headers={"content-security-policy": ISOLATED_ORIGIN_POLICY}
            )
        return FileResponse(file, media_type="application/octet-stream", filename=name)

    return give


def mesh_giver(studio: Studio) -> Callable[[str, int], Response]:
    """Sender of meshes of a project's robots, as triangles: by number, so that no name of a mesh comes from outside.

    Args:
        studio: whose project it is.
    """

    def give(robot: str, number: int) -> Response:
        path = f"{LAYOUT.robots}/{robot}"
        try:
            if path not in studio.project.files(LAYOUT.robots, URDF_ENDINGS):
                return PlainTextResponse("There is no such robot.\n", status_code=404)
            visuals = read_looks(studio.project.path(path)).visuals
            if not 0 <= number < len(visuals):
                return PlainTextResponse("There is no such mesh.\n", status_code=404)
            triangles, _ = triangles_of(studio.project, path, visuals[number])
        except TaskcalError as error:
            return PlainTextResponse(f"{error}\n", status_code=404)
        return Response(triangles, media_type="model/stl")

    return give
