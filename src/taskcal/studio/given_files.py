"""Files of the project that a page gives out: to be kept, or looked at without being let near the studio."""

from collections.abc import Callable

from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response

from taskcal.studio.project import LAYOUT
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
