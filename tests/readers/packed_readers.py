"""Readers of files that pack others: workbooks, Parquet, backups of controllers, robots with their meshes, single meshes."""

import io
import tempfile
import zipfile
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import trimesh

from robot_programs.reading import read_program
from taskcal.errors import TaskcalError
from taskcal.reading.chunked import campaign_in_chunks
from taskcal.reading.reader import read_campaign, read_measurements
from taskcal.robot.catalogue import load_robot
from taskcal.robot.importers.urdf import Visual
from taskcal.tables.parquet import parquet_of
from taskcal_studio.files import unpack_robot
from taskcal_studio.project import Project
from taskcal_studio.robot_meshes import MESH_ENDINGS, meshes_of, put_mesh, triangles_of
from tests.readers.damage import NUMBERS, Content, Files, damaged, damaged_zip
from tests.readers.reader import Reader
from tests.reading.known_campaign import DEG, JOINTS, MM, ROBOT
from tests.robot.test_urdf_visuals import ARM
from tests.robot_programs.apt.generator import generate as apt
from tests.robot_programs.krl.generator import generate as krl
from tests.robot_programs.rapid.generator import generate as rapid
from tests.robot_programs.tp.generator import generate as tp
from tests.tables.test_spreadsheet import book

HEADER = ["id", *JOINTS, "x_mm", "y_mm", "z_mm"]
ROWS = [[f"p{k}", *DEG[k].tolist(), *MM[k].tolist()] for k in range(6)]


def read_either(path: Path) -> object:
    """A campaign, or measurements without joints."""
    try:
        return read_campaign(path, ROBOT)
    except TaskcalError:
        return read_measurements(path, ROBOT)


def _workbooks() -> Files:
    return [("file.xlsx", book(("about", [["robot", "UR5"]]), ("measured", [HEADER, *ROWS])))]


def _parquets() -> Files:
    return [("file.parquet", parquet_of(HEADER, [list(map(str, row)) for row in ROWS]))]


def _damaged_parquet(rng: np.random.Generator, content: Content, others: list[Content]) -> Content:
    """Bytes of the file changed, or its columns: of other kinds, names or lengths."""
    if rng.random() < 0.4:
        return damaged(rng, content, others)
    table = pyarrow.parquet.read_table(io.BytesIO(content))
    names, columns = list(table.column_names), [column.combine_chunks() for column in table.columns]
    for _ in range(int(rng.integers(1, 4))):
        k = int(rng.integers(len(names)))
        values = columns[k].to_pylist()
        match int(rng.integers(9)):
            case 0:
                names[k] = names[int(rng.integers(len(names)))]
            case 1:
                names[k] = damaged(rng, names[k].encode() or b"x", [b"x_mm"]).decode("utf-8", "replace")
            case 2:
                values[int(rng.integers(len(values)))] = None
                columns[k] = pyarrow.array(values)
            case 3:
                columns[k] = pyarrow.array([[v] for v in values])
            case 4:
                columns[k] = pyarrow.array([{"a": v} for v in values])
            case 5:
                texts = [NUMBERS[int(rng.integers(len(NUMBERS)))].decode() for _ in values]
                columns[k] = pyarrow.array(texts).dictionary_encode()
            case 6:
                columns[k] = pyarrow.array([bytes(rng.integers(0, 256, 4, dtype=np.uint8)) for _ in values])
            case 7:
                kinds = (pyarrow.timestamp("ns", "UTC"), pyarrow.duration("us"), pyarrow.date64(), pyarrow.time64("ns"))
                whole = pyarrow.array(rng.integers(-(2**62), 2**62, len(values)))
                columns[k] = whole.cast(kinds[int(rng.integers(4))], safe=False)
            case _:
                odd = [float("nan"), float("inf"), 1e308, -1e308, 5e-324, -0.0, 1.0]
                columns[k] = pyarrow.array(rng.choice(odd, len(values)))
    out = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.Table.from_arrays(columns, names), out)
    return out.getvalue()


def _read_parquet(path: Path) -> object:
    """Whole, and by parts."""
    try:
        with campaign_in_chunks(path, ROBOT) as parts:
            list(parts)
    except TaskcalError:
        pass
    return read_either(path)


def zipped(parts: dict[str, bytes]) -> bytes:
    """A zip file of these."""
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in parts.items():
            packed.writestr(name, content)
    return out.getvalue()


def _backups() -> Files:
    out: Files = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        files = {
            "RAPID/TASK1/PROGMOD": rapid(rng).sources,
            "KRC/R1/Program": krl(rng).sources,
            "MD": tp(rng, trouble=False),
        }
        for folder, sources in files.items():
            parts = {f"{folder}/{source.path.name}": source.encode() for source in sources}
            out.append(("backup.zip", zipped({**parts, "readme.txt": b"4711"})))
        out.append(("backup.zip", zipped({"part.apt": apt(rng, trouble=False)})))
    return out


R2000 = load_robot("fanuc-r2000ic-165f")


def _robots() -> Files:
    bar = trimesh.creation.box(extents=(0.1, 0.2, 0.4))
    return [("robot.zip", zipped({"arm/urdf/arm.urdf": ARM.encode(), "arm/meshes/a.stl": bar.export(file_type="stl")}))]


def _unpacked(path: Path) -> object:
    with tempfile.TemporaryDirectory() as folder:
        project = Project(Path(folder))
        robot = unpack_robot(project, path.name, path.read_bytes())
        return load_robot(project.path(robot)), meshes_of(project, robot)


def _meshes() -> Files:
    bar = trimesh.creation.box(extents=(0.1, 0.2, 0.4))
    out: Files = []
    for ending in MESH_ENDINGS:
        whole = trimesh.Scene(bar).export(file_type="glb") if ending == ".glb" else bar.export(file_type=ending[1:])
        out.append((f"a{ending}", whole if isinstance(whole, bytes) else whole.encode()))
    return out


def _triangles(path: Path) -> object:
    with tempfile.TemporaryDirectory() as folder:
        project = Project(Path(folder))
        robot = project.put("robots", "arm.urdf", ARM.encode(), (".urdf",))
        put_mesh(project, robot, path.name, path.read_bytes())
        return triangles_of(
            project, robot, Visual(link="upper", origin=np.eye(4), scale=(1.0, 1.0, 1.0), file=path.name)
        )


PACKED_READERS = {
    "workbook": Reader(files=_workbooks, read=read_either, damage=damaged_zip),
    "parquet": Reader(files=_parquets, read=_read_parquet, damage=_damaged_parquet),
    "backup": Reader(files=_backups, read=lambda path: read_program(path, robot=R2000), damage=damaged_zip),
    "robot-zip": Reader(files=_robots, read=_unpacked, damage=damaged_zip),
    "mesh": Reader(files=_meshes, read=_triangles),
}
