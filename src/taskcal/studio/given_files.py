"""Files of the project that a page gives out: to be kept, or looked at without being let near the studio."""

from collections.abc import Callable

from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response

from taskcal.errors import TaskcalError
from taskcal.robot.urdf_visuals import read_looks
from taskcal.studio.project import LAYOUT, URDF_ENDINGS
from taskcal.studio.robot_meshes import triangles_of
from taskcal.studio.studio import Studio

GIVEN = (LAYOUT.calibrations, LAYOUT.campaigns, LAYOUT.corrected, LAYOUT.plans, LAYOUT.reports)

APART = "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline' 'unsafe-eval' blob:; "
APART += "style-src 'unsafe-inline'; img-src data: blob:; font-src data:; worker-src blob:"
"""A report's figures need their scripts; in an origin of its own they reach neither the studio nor anything else."""


def giver(studio: Studio) -> Callable[[str, str, Request], Response]:
    """What gives files of a project.

    Args:
        studio: whose project it is.
    """

    def give(folder: str, name: str, request: Request) -> Response:
        path = f"{folder}/{name}"
        if folder not in GIVEN or path not in studio.project.files(folder):
            return PlainTextResponse("There is no such file.\n", status_code=404)
        file = studio.project.path(path)
        if name.endswith(".html") and "keep" not in request.query_params:
            return FileResponse(file, media_type="text/html", headers={"content-security-policy": APART})
        return FileResponse(file, media_type="application/octet-stream", filename=name)

    return give


def mesh_giver(studio: Studio) -> Callable[[str, int], Response]:
    """What gives meshes of a project's robots, as triangles: by number, so that no name of a mesh comes from outside.

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
