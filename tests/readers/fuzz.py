"""Random damage to every kind of file that is read: `python -m tests.readers.fuzz campaign 10000 [FIRST_SEED]`.

Whatever the bytes of a small file are, reading it ends soon, in what it holds or in a TaskcalError.
"""

import io
import re
import sys
import tempfile
import time
import traceback
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from taskcal.cli.rows import choose_rows
from taskcal.cli.truth_file import read_truth, truth_text
from taskcal.correction.cell_file import load_cell
from taskcal.errors import TaskcalError
from taskcal.export.ur_form import export_ur_yaml
from taskcal.identification.calibration_file import load_calibration
from taskcal.identification.identify import identify
from taskcal.measurement.cycles import read_path_cycles, read_pose_cycles
from taskcal.measurement.reader import ReadOptions, read_campaign, read_measurements
from taskcal.measurement.registration import register
from taskcal.measurement.registration_file import load_registration, save_registration
from taskcal.measurement.station import load_station
from taskcal.measurement.virtual_cell import simulate
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.robot.description import robot_toml
from taskcal.robot.dh_table import read_dh_table
from taskcal.robot.error_model import ErrorModel
from taskcal.tabular.column_groups import ColumnGroups
from taskcal.tabular.csv_form import read_csv
from taskcal.task.pose_table import read_tool_poses
from taskcal.task.task import load_task
from tests.laws.calibrations import calibrated
from tests.laws.urdfs import random_urdf
from tests.measurement import test_forms_people_write as forms
from tests.measurement import test_tables_with_surroundings as surroundings
from tests.measurement.known_campaign import DEG, JOINTS, MM, ROBOT, N
from tests.measurement.test_cycles import PATH, PATH_ROWS, POSE_ROWS, POSES
from tests.measurement.test_station import STATION
from tests.programs.fuzz import mutated
from tests.robot.test_ur_files import CONF
from tests.tabular.test_labelled_values import LOG
from tests.tabular.test_motion_capture import EXPORT
from tests.tabular.test_spreadsheet import book
from tests.task.task_files import BOX, CYLINDER

LONGEST = 2.0
"""Seconds of computing that no small file may take."""

NUMBERS = b"1e400 -1e308 nan inf 9999999999999999999999 0 -0 1e-320 1_000 0x10 \xd9\xa3 '' [] {} null true 1,5 1.234,5 #N/A".split()
"""What may stand where a number does."""

Content = bytes
Files = list[tuple[str, Content]]


@dataclass(frozen=True, kw_only=True)
class Reader:
    """Files of one kind, and what reads them."""

    files: Callable[[], Files]
    """Sound ones, each with its name."""
    read: Callable[[Path], object]


def damaged(rng: np.random.Generator, content: Content, others: list[Content]) -> Content:
    """Bytes changed at random; numbers replaced; cut off, repeated, or joined with another file's."""
    match int(rng.integers(8)):
        case 0 | 1 | 2:
            numbers = list(re.finditer(rb"-?\d+(?:\.\d+)?", content))
            for match in reversed(
                [numbers[k] for k in rng.integers(0, len(numbers), int(rng.integers(1, 3)))] if numbers else []
            ):
                content = content[: match.start()] + NUMBERS[int(rng.integers(len(NUMBERS)))] + content[match.end() :]
            return content
        case 3:
            other, at = others[int(rng.integers(len(others)))], int(rng.integers(len(content) + 1))
            return content[:at] + other[int(rng.integers(len(other) + 1)) :]
        case 4:
            at, size = int(rng.integers(len(content) + 1)), int(rng.integers(1, 200))
            return content[:at] + content[at : at + size] * int(rng.integers(2, 60)) + content[at + size :]
        case 5 | 6:
            at = int(rng.integers(len(content) + 1))
            return content[:at] + bytes(rng.integers(0, 256, 1, dtype=np.uint8)) + content[at + int(rng.integers(2)) :]
        case _:
            return mutated(rng, content, marks=b"[](){}\\;:=\"'!,<>%$&*/+-. \n\r\t09eE#|\xff\x00\xe4")


def _in_workbook(rng: np.random.Generator, content: Content) -> Content:
    """A workbook with damage inside one of its parts."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as whole, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as again:
        names = whole.namelist()
        hit = names[int(rng.integers(len(names)))]
        for name in names:
            part = whole.read(name)
            again.writestr(name, damaged(rng, part, [part]) if name == hit else part)
    return out.getvalue()


def _campaigns() -> Files:
    """One file of each form that tests know."""
    out: Files = [("log.txt", LOG.encode()), ("motive.csv", EXPORT.encode())]
    for header, rows, *_ in (*forms.READ.values(), *surroundings.READ.values(), *surroundings.REFUSED.values()):
        text = "\r\n".join([*([",".join(header)] if header else []), *rows[:8], ""])
        out += [("file.csv", text.encode()), ("file.csv", text.replace(",", ";").replace(".", ",").encode("utf-16"))]
    return out


def _read_campaign(path: Path) -> object:
    try:
        return read_campaign(path, ROBOT)
    except TaskcalError:
        return read_measurements(path, ROBOT)


def _workbooks() -> Files:
    rows = [["id", *JOINTS, "x_mm", "y_mm", "z_mm"], *([f"p{k}", *DEG[k].tolist(), *MM[k].tolist()] for k in range(6))]
    return [("file.xlsx", book(("about", [["robot", "UR5"]]), ("measured", rows)))]


def _points(path: Path) -> object:
    joints = path.with_name("joints.csv")
    if not joints.exists():
        rows = [",".join([f"p{k}", *map(str, DEG[k])]) for k in range(N)]
        joints.write_text("\n".join([",".join(["id", *JOINTS]), *rows]))
    return read_campaign(joints, ROBOT, options=ReadOptions(points=path))


def _point_files() -> Files:
    named = ["id,x_mm,y_mm,z_mm", *(",".join([f"p{k}", *map(str, MM[k])]) for k in range(N))]
    long = ["id,x,y,z", *(",".join([f"p{k}_{t}", *map(str, MM[k])]) for k in range(N) for t in "AB")]
    bare = [" ".join(map(str, MM[k])) for k in range(1, N)]
    return [("points.csv", "\n".join(lines).encode()) for lines in (named, long, bare)]


@cache
def _saved() -> tuple[ErrorModel, object, dict[str, str]]:
    """A model, a campaign and the JSON files of what was found in it."""
    model = ErrorModel(ROBOT)
    q = 0.4 * np.random.default_rng(0).normal(size=(12, 6)) + 0.3
    campaign, truth = simulate(model, q, rng=np.random.default_rng(1))
    texts: dict[str, str] = {"truth": truth_text(truth, campaign.targets)}
    with tempfile.TemporaryDirectory() as folder:
        registration = register(model, campaign)
        save_registration(Path(folder) / "reg.json", registration, model, campaign)
        identify(model, campaign, keep=["J2", "J3", "tool"]).save(Path(folder) / "cal.json")
        texts |= {kind: (Path(folder) / f"{kind}.json").read_text() for kind in ("reg", "cal")}
    return model, campaign, texts


def _json(kind: str) -> Callable[[], Files]:
    return lambda: [(f"{kind}.json", _saved()[2][kind].encode())]


def _robots() -> Files:
    return [("robot.toml", robot_toml(load_robot(name).description).encode()) for name in catalogue_names()]


def _tables() -> Files:
    dh = [
        "joint,alpha_deg,a_mm,d_mm,theta_offset_deg,lower_deg,upper_deg",
        *("1,90,0,400,0,-170,170", "2,0,500,0,90,-90,90", "3,90,35,515,0,-120,120", ""),
    ]
    bare = ["i;α [rad];a;d;θ", "1;1,5708;0;0,4;0", "2;0;0,5;0;1,5708", "3;-1,5708;0,035;0,515;0", ""]
    return [("dh.csv", "\n".join(lines).encode()) for lines in (dh, bare)]


CELL = """
[robot]
base = { position_mm = [0, 0, 800] }
[[axis]]
number = 1
carries = "robot"
slides_along = [1, 0, 0]
frame = { position_mm = [0, 0, 0] }
[[tool]]
name = "probe"
controller = { position_mm = [0, 0, 100], quaternion = [0, 0, 0, 1] }
[[tool]]
name = "cutter"
reflectors_mm = { a = [0, 0, 0], b = [100, 0, 0], c = [0, 100, 0] }
[[part]]
name = "blade"
touched_deg = [[1, 2, 3, 4, 5, 6], [3, 4, 5, 6, 7, 8], [5, 6, 1, 2, 3, 4]]
touched_with = "probe"
"""
POSE_TABLES = (
    "x_mm,y_mm,z_mm,qx,qy,qz,qw\n1000,0,500,0,1,0,0\n900,10,500,0,0.6,0.8,0\n",
    "x_mm;y_mm;z_mm;a_deg;b_deg;c_deg\n1000;0;500;10,5;20;30\n",
    "x_mm y_mm z_mm i j k\n1 2 3 0 0 -1\n",
)


def _named(name: str, *texts: str) -> Callable[[], Files]:
    return lambda: [(name, text.encode()) for text in texts]


READERS = {
    "campaign": Reader(files=_campaigns, read=_read_campaign),
    "points": Reader(files=_point_files, read=_points),
    "workbook": Reader(files=_workbooks, read=_read_campaign),
    "robot": Reader(files=_robots, read=load_robot),
    "dh": Reader(files=_tables, read=lambda path: read_dh_table(path, "dh")),
    "ur-yaml": Reader(files=lambda: [("k.yaml", export_ur_yaml(calibrated("ur5")).text.encode())], read=load_robot),
    "ur-conf": Reader(files=_named("calibration.conf", CONF), read=lambda path: load_ur_deltas(path)),
    "urdf": Reader(
        files=lambda: [("r.urdf", random_urdf(np.random.default_rng(k), 4).encode()) for k in range(20)],
        read=load_robot,
    ),
    "task": Reader(files=_named("task.toml", BOX, CYLINDER), read=load_task),
    "station": Reader(files=_named("station.toml", STATION), read=load_station),
    "cell": Reader(files=_named("cell.toml", CELL), read=load_cell),
    "poses": Reader(
        files=_named("poses.csv", *POSE_TABLES), read=lambda path: read_tool_poses(ColumnGroups(read_csv(path)))
    ),
    "pose-cycles": Reader(files=_named("cycles.csv", "\n".join([POSES, *POSE_ROWS])), read=read_pose_cycles),
    "path-cycles": Reader(files=_named("path.csv", "\n".join([PATH, *PATH_ROWS])), read=read_path_cycles),
    "calibration": Reader(files=_json("cal"), read=load_calibration),
    "registration": Reader(files=_json("reg"), read=lambda path: load_registration(path, *_saved()[:2])),
    "truth": Reader(files=_json("truth"), read=lambda path: read_truth(path, _saved()[0])),
    "rows": Reader(
        files=_named("rows.txt", "0\n3\n5\n", "# rows\n1\n"), read=lambda path: choose_rows(str(path), 9, path)
    ),
}


def load_ur_deltas(path: Path) -> object:
    """A UR's calibration, added to the nominal robot."""
    from taskcal.robot.description import describe_robot
    from taskcal.robot.file import robot_from

    return robot_from(describe_robot(path, nominal=ROBOT))


def check_case(kind: str, seed: int, folder: Path) -> str:
    """Damage one file and read it; says what became of it.

    Raises:
        AssertionError: it took too long.
    """
    rng = np.random.default_rng(seed)
    files = _sound(kind)
    name, content = files[int(rng.integers(len(files)))]
    if kind == "workbook" and rng.random() < 0.7:
        content = _in_workbook(rng, content)
    else:
        content = damaged(rng, content, [other for _, other in files])
    path = folder / name
    path.write_bytes(content)
    begin = time.process_time()
    try:
        READERS[kind].read(path)
    except TaskcalError:
        return "refused"
    finally:
        took = time.process_time() - begin
        assert took < LONGEST, f"reading takes {took:.1f} s"
    return "read"


@cache
def _sound(kind: str) -> Files:
    return READERS[kind].files()


def fuzz(kind: str, count: int, first: int = 0) -> int:
    """Check many cases, print those that fail, and say how many did."""
    outcomes: dict[str, int] = {}
    begin, slowest = time.perf_counter(), 0.0
    # what warns has not been thought of
    warnings.simplefilter("error")
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            started = time.process_time()
            try:
                outcome = check_case(kind, seed, Path(folder))
            except Exception:
                outcome = "failed"
                print(f"{kind} seed {seed}:", traceback.format_exc(limit=-3), file=sys.stderr, flush=True)
            slowest = max(slowest, time.process_time() - started)
            outcomes[outcome] = outcomes.get(outcome, 0) + 1
    print(
        f"{kind}: {count} cases in {time.perf_counter() - begin:.0f} s, the slowest {slowest:.2f} s: {outcomes}",
        flush=True,
    )
    return outcomes.get("failed", 0)


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if len(arguments) not in (2, 3) or arguments[0] not in READERS:
        sys.exit(f"usage: python -m tests.readers.fuzz {'|'.join(READERS)} COUNT [FIRST_SEED]")
    sys.exit(min(fuzz(arguments[0], *map(int, arguments[1:])), 1))
