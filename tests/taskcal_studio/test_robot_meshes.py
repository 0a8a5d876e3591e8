"""Meshes of a robot: kept beside it, read in each format alike, and nothing taken from an archive that its URDF does not name."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from taskcal.errors import TaskcalError
from taskcal_studio.files import unpack_robot
from taskcal_studio.project import LAYOUT, Project
from taskcal_studio.robot_meshes import MESH_ENDINGS, meshes_of, put_mesh, triangles_of
from tests.robot.test_urdf_visuals import ARM

BAR = trimesh.creation.box(extents=(0.1, 0.2, 0.4))


def exported(ending: str) -> bytes:
    written = trimesh.Scene(BAR).export(file_type="glb") if ending == ".glb" else BAR.export(file_type=ending[1:])
    return written if isinstance(written, bytes) else written.encode()


def arm(ending: str = ".stl") -> bytes:
    return ARM.replace("upper.stl", f"upper{ending}").replace("lower.dae", f"lower{ending}").encode()


def zipped(**files: bytes) -> bytes:
    into = io.BytesIO()
    with zipfile.ZipFile(into, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return into.getvalue()


@pytest.mark.parametrize("ending", MESH_ENDINGS)
def test_every_format_gives_the_same_triangles(tmp_path: Path, ending: str) -> None:
    project = Project(tmp_path)
    robot = project.put("robots", "arm.urdf", arm(ending), (".urdf",))
    for name in ("upper", "lower"):
        put_mesh(project, robot, f"../../{name}{ending}", exported(ending))
    meshes = meshes_of(project, robot)
    assert meshes is not None
    assert (len(meshes.drawn), meshes.missing) == (2, ())
    triangles, count = triangles_of(project, robot, meshes.drawn[0][1])
    again = trimesh.load_mesh(io.BytesIO(triangles), file_type="stl")
    assert count == len(again.faces) == 12
    np.testing.assert_allclose(np.sort(again.extents), [0.1, 0.2, 0.4], atol=1e-6)
    assert sorted(path.name for path in tmp_path.rglob("*.*") if path.suffix == ending) == [
        f"lower{ending}",
        f"upper{ending}",
    ]
    assert not list(tmp_path.parent.glob(f"*{ending}"))


def test_a_unit_that_a_collada_file_states_is_heard(tmp_path: Path) -> None:
    project = Project(tmp_path)
    robot = project.put("robots", "arm.urdf", arm(".dae"), (".urdf",))
    content = exported(".dae").decode().replace("</modified>", '</modified><unit name="millimeter" meter="0.001"/>')
    assert 'meter="0.001"' in content
    put_mesh(project, robot, "upper.dae", content.encode())
    meshes = meshes_of(project, robot)
    assert meshes is not None
    again = trimesh.load_mesh(io.BytesIO(triangles_of(project, robot, meshes.drawn[0][1])[0]), file_type="stl")
    np.testing.assert_allclose(again.extents, [1e-4, 2e-4, 4e-4], atol=1e-9)
    assert len(meshes.missing) == 1


def test_zip_keeps_only_meshes_of_urdf_under_own_names(tmp_path: Path) -> None:
    """Of a ZIP file only the meshes named in the URDF are kept, under generated names."""
    project = Project(tmp_path)
    other = BAR.copy().apply_scale(2.0).export(file_type="stl")
    content = zipped(
        **{
            "pkg/urdf/arm.urdf": arm(),
            "pkg/collision/upper.stl": other,
            "arm/meshes/upper.stl": exported(".stl"),
            "etc\\lower.stl": exported(".stl"),
            "pkg/run.sh": b"rm -rf /",
        }
    )
    robot = unpack_robot(project, "arm.zip", content)
    assert robot == "robots/arm.urdf"
    files = [path.relative_to(tmp_path) for path in tmp_path.rglob("*") if path.is_file()]
    kept = sorted(str(file) for file in files if file.parts[0] != LAYOUT.history)
    assert kept == ["project.toml", "robots/arm.meshes/lower.stl", "robots/arm.meshes/upper.stl", "robots/arm.urdf"]
    assert (tmp_path / "robots/arm.meshes/upper.stl").read_bytes() == exported(".stl")  # not that of the collision
    assert sorted(path.name for path in tmp_path.parent.iterdir() if path.suffix == ".stl") == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"PK not a zip", r"^arm\.zip: is a damaged zip file \(File is not a zip file\); pack the files again"),
        (zipped(**{"arm.urdf": arm(), "../../evil.stl": b""}), r"^arm\.zip: .*evil\.stl', which leads out of it"),
        (zipped(**{"readme.txt": b""}), "must hold one robot"),
        (zipped(**{"a.urdf": arm(), "b.urdf": arm()}), "must hold one robot"),
        (zipped(**{"arm.urdf": arm(), "upper.stl": b"\0" * 20_000_001}), r"arm\.zip/upper\.stl: has more than 20 MB"),
        (zipped(**{f"{k}.stl": b"" for k in range(5001)}), "more than 5000 files"),
    ],
)
def test_an_archive_that_is_not_a_robot_s_is_refused(tmp_path: Path, content: bytes, message: str) -> None:
    with pytest.raises(TaskcalError, match=message):
        unpack_robot(Project(tmp_path), "/home/me/arm.zip", content)


def test_meshes_outside_project_or_of_other_type_are_rejected(tmp_path: Path) -> None:
    """No mesh is read from outside the project, and a file that is not a mesh is named."""
    secret = tmp_path / "secret.stl"
    secret.write_bytes(exported(".stl"))
    (tmp_path / "p").mkdir()
    project = Project(tmp_path / "p")
    named = arm().replace(b"package://arm/meshes/upper.stl", b"../../secret.stl")
    named = named.replace(b"meshes/lower.stl", str(secret).encode())
    robot = project.put("robots", "arm.urdf", named, (".urdf",))
    meshes = meshes_of(project, robot)
    assert meshes is not None
    assert (meshes.drawn, len(meshes.missing)) == ((), 2)
    (tmp_path / "p" / "robots" / "arm.meshes").mkdir()
    (tmp_path / "p" / "robots" / "arm.meshes" / "secret.stl").symlink_to(secret)
    meshes = meshes_of(project, robot)
    assert meshes is not None
    assert meshes.drawn == ()
    assert "outside" in meshes.missing[0]
    robot = project.put("robots", "arm.urdf", arm(), (".urdf",))
    put_mesh(project, robot, "upper.stl", b"solid nothing\nendsolid")
    meshes = meshes_of(project, robot)
    assert meshes is not None
    assert "upper.stl" in meshes.missing[0]
    with pytest.raises(TaskcalError, match="drop it together with its URDF"):
        put_mesh(project, "robots/none.urdf", "upper.stl", b"")
    with pytest.raises(TaskcalError, match="not a file of this kind"):
        put_mesh(project, robot, "upper.exe", b"")
