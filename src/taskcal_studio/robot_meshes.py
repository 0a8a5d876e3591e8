"""Meshes beside a robot's file: kept in a folder of its own, and turned into triangles that a page can draw."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, TaskcalError, shown
from taskcal.io.files import write_whole
from taskcal.robot.importers.urdf import Looks, Visual, read_looks
from taskcal.robot.mesh_file import MAX_MESH_BYTES, MESH_ENDINGS, stl_of
from taskcal_studio.project import LAYOUT, URDF_ENDINGS, Project, plain_name

MESHES = ".meshes"
"""Ending of the folder beside a robot's file, after its name, that holds its meshes."""

MAX_TRIANGLES = 400_000
"""Triangles of one robot, at most: as many as a browser without a graphics card still turns."""


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotMeshes:
    """Meshes of a robot's links."""

    robot: str
    """Path of the robot's file in its project."""
    looks: Looks
    drawn: tuple[tuple[int, Visual], ...]
    """Those that are there, with their numbers among the visuals."""
    missing: tuple[str, ...]
    """Why others are not drawn."""

    def poses(self, names: Iterable[str], q: Float[np.ndarray, " joints"]) -> list[Float[np.ndarray, "4 4"]]:
        """Poses of the meshes in the robot's base at joint positions, radians or metres."""
        links = self.looks.link_poses(dict(zip(names, map(float, q), strict=True)))
        return [links[visual.link] @ visual.origin for _, visual in self.drawn]


def meshes_of(project: Project, robot: str) -> RobotMeshes | None:
    """The meshes of a project's robot; None where it is no URDF or names none.

    Raises:
        FileError: its file cannot be read.
    """
    if not robot.lower().endswith(URDF_ENDINGS) or "/" not in robot:
        return None
    looks = read_looks(project.path(robot))
    drawn: list[tuple[int, Visual]] = []
    missing: dict[str, None] = {}
    triangles = 0
    for number, visual in enumerate(looks.visuals):
        try:
            _, count = triangles_of(project, robot, visual)
        except TaskcalError as error:
            missing[str(error)] = None
            continue
        triangles += count
        if triangles > MAX_TRIANGLES:
            raise FileError(project.path(robot), f"has meshes of more than {MAX_TRIANGLES} triangles; simplify them")
        drawn.append((number, visual))
    return RobotMeshes(robot=robot, looks=looks, drawn=tuple(drawn), missing=tuple(missing)) if looks.visuals else None


def meshes_if_sound(project: Project) -> RobotMeshes | None:
    """The meshes of a project's robot, for pages that show it beside other things; its own page says what is wrong with them."""
    with suppress(TaskcalError):
        return meshes_of(project, project.choices.robot)
    return None


def triangles_of(project: Project, robot: str, visual: Visual) -> tuple[bytes, int]:
    """A mesh as a binary STL in metres before its scale, and how many triangles it has.

    Raises:
        TaskcalError: it is not there, or cannot be read.
    """
    return stl_of(_found(project, robot, visual.file))


def folder_of(robot: str) -> str:
    """The folder of a project that holds the meshes of a robot's file."""
    return f"{LAYOUT.robots}/{Path(robot).stem}{MESHES}"


def put_mesh(project: Project, robot: str, given: str, content: bytes) -> str:
    """Keep a mesh that was dropped together with a robot's file, or for it.

    Returns:
        the robot's path.

    Raises:
        TaskcalError: there is no such robot, or the mesh is not of a kind that is drawn or too large.
    """
    name = plain_name(given, MESH_ENDINGS)
    if robot not in project.files(LAYOUT.robots, URDF_ENDINGS):
        raise TaskcalError(f"'{shown(name)}' is a mesh; drop it together with its URDF, or choose that robot first")
    if len(content) > MAX_MESH_BYTES:
        raise TaskcalError(f"'{shown(name)}' has more than {MAX_MESH_BYTES // 1_000_000} MB; simplify it")
    place = project.path(folder_of(robot))
    place.mkdir(parents=True, exist_ok=True)
    path = f"{folder_of(robot)}/{name}"
    with project.change(path):
        write_whole(project.path(path), content)
    return robot


def mesh_name(file: str) -> str:
    """The plain name of a mesh that a URDF names with folders before it.

    Raises:
        TaskcalError: it is of a kind that is not drawn.
    """
    return plain_name(file, MESH_ENDINGS)


def _found(project: Project, robot: str, file: str) -> Path:
    """Under its plain name in the robot's folder of meshes, or where the URDF names it, from its own folder on."""
    places = [f"{folder_of(robot)}/{mesh_name(file)}"]
    scheme, apart, rest = file.partition("://")
    named = PurePosixPath(rest.partition("/")[2] if scheme == "package" and apart else file)
    if not named.is_absolute() and ".." not in named.parts and ":" not in str(named):
        places.append(f"{LAYOUT.robots}/{named}")
    for place in places:
        path = project.path(place)
        if path.is_file():
            return path
    raise TaskcalError(
        f"its mesh '{shown(file, 80)}' is not there; drop it here, or drop the URDF with its meshes as a zip"
    )
