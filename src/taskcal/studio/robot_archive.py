"""A robot that is dropped as a zip: its URDF and the meshes that it names, and nothing else of what is in there."""

from pathlib import Path, PurePosixPath

from taskcal.errors import TaskcalError, shown
from taskcal.robot.urdf_visuals import read_looks
from taskcal.studio.project import LAYOUT, URDF_ENDINGS, Project
from taskcal.studio.robot_meshes import MESH_ENDINGS, MOST_BYTES, mesh_name, put_mesh
from taskcal.zip_file import ZipEntry, ZipKind, open_zip

ZIPPED = ZipKind(
    most_entries=5000, largest_mb=1000.0, small_mb=200.0, most_ratio=50.0, largest_entry_mb=MOST_BYTES / 1e6,
)  # fmt: skip
"""A package of a family of robots has some hundred files; meshes as text pack ten times."""

MOST_ALL_BYTES = 200_000_000
"""Of all that is taken from it."""


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
            named = ", ".join(shown(entry.name, 60) for entry in robots[:5]) or "none"
            raise TaskcalError(f"the zip must hold one robot (.urdf or .xacro); it has {named}")
        robot = project.put(LAYOUT.robots, robots[0].name, packed.read(robots[0]), URDF_ENDINGS)
        taken = 0
        for file in dict.fromkeys(visual.file for visual in read_looks(project.path(robot)).visuals):
            entry = _of(entries, file)
            if entry is not None:
                mesh = packed.read(entry)
                taken += len(mesh)
                if taken > MOST_ALL_BYTES:
                    raise TaskcalError(f"the meshes of the zip have more than {MOST_ALL_BYTES // 1_000_000} MB")
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
