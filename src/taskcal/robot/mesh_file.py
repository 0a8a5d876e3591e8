"""Files of meshes as triangles: STL, OBJ, COLLADA and glTF, read by trimesh."""

import io
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from jaxtyping import Float

from taskcal.errors import FileError, shown
from taskcal.io.xml_file import parse_xml

MESH_ENDINGS = (".stl", ".obj", ".dae", ".glb")

MAX_MESH_BYTES = 20_000_000
"""Bytes of one mesh, at most. A convention."""


def read_triangles(path: Path) -> Float[np.ndarray, "n 3 3"]:
    """Corners of the triangles of a mesh, metres before any scale.

    Raises:
        FileError: it cannot be read, is too large or has none; or trimesh is not installed.
    """
    content, count = stl_of(path)
    rows = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(content, rows, count, offset=84)["corners"].astype(float)


def stl_of(path: Path) -> tuple[bytes, int]:
    """A mesh as a binary STL in metres, and how many triangles it has; once for a file that did not change.

    Raises:
        FileError: as `read_triangles`.
    """
    status = path.stat()
    return _converted(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=64)
def _converted(path: Path, changed: int, size: int) -> tuple[bytes, int]:
    if find_spec("trimesh") is None:
        raise FileError(path, "is a mesh, which takes the package trimesh: pip install 'taskcal[studio]'")
    # half a second to import, for those alone who have meshes
    import trimesh

    if size > MAX_MESH_BYTES:
        raise FileError(path, f"has more than {MAX_MESH_BYTES // 1_000_000} MB; simplify it")
    content, ending = path.read_bytes(), path.suffix.lower()
    unit = _collada_unit(path, content) if ending == ".dae" else 1.0
    try:
        mesh = trimesh.load_scene(io.BytesIO(content), file_type=ending[1:]).to_mesh()
        mesh.apply_scale(unit)
        count = len(mesh.faces)
        written: bytes = mesh.export(file_type="stl")
    except Exception as error:  # whatever a reader of foreign formats trips over
        raise FileError(path, f"cannot be read as a {ending[1:].upper()} mesh") from error
    if not count or not np.isfinite(mesh.vertices).all():
        raise FileError(path, "has no triangles")
    return written, count


def _collada_unit(path: Path, content: bytes) -> float:
    """Metres of the unit that a COLLADA file counts in; its document types and what is nested too deeply are refused."""
    asset = parse_xml(path, content).first("asset")
    unit = None if asset is None else asset.first("unit")
    stated = "1" if unit is None else unit.attributes.get("meter", "1")
    try:
        meters = float(stated)
    except ValueError:
        meters = np.nan
    if not 1e-9 < meters < 1e9:
        raise FileError(path, f"has a unit of '{shown(stated, 20)}' metres, which is not a length")
    return meters
