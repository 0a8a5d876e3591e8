"""Every kind of file that is read, as it should be, and what reads it."""

import tempfile
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

import numpy as np

from taskcal.campaigns.performance import read_path_cycles, read_pose_cycles
from taskcal.cli.commands.simulate import read_truth, truth_text
from taskcal.cli.options.campaign import choose_rows
from taskcal.correction.cell import load_cell
from taskcal.export.forms import export_ur_yaml
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.io.toml_file import read_toml
from taskcal.observations.calibration_board import read_boards
from taskcal.observations.point import load_station
from taskcal.observations.socket import read_distances
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign
from taskcal.registration.registration import register
from taskcal.registration.registration_file import load_registration, save_registration
from taskcal.report.page import read_header
from taskcal.robot.catalogue import catalogue_names, describe_robot, load_robot, robot_toml
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.importers.dh import read_dh_table
from taskcal.robot.robot_file import robot_from
from taskcal.tables.forms import read_csv
from taskcal.task.orientation import read_tool_poses
from taskcal.task.task import load_task
from taskcal.virtual.cell import simulate
from taskcal_studio.project import Choices
from tests.campaigns.test_cycles import PATH, PATH_ROWS, POSE_ROWS, POSES
from tests.laws.calibrations import calibrated
from tests.laws.urdfs import random_urdf
from tests.observations.test_calibration_board import CHARUCO, CIRCLES
from tests.observations.test_station import STATION
from tests.readers.damage import Files
from tests.readers.packed_readers import PACKED_READERS, read_either
from tests.readers.reader import Reader, named
from tests.reading import test_forms_people_write as forms
from tests.reading import test_tables_with_surroundings as surroundings
from tests.reading.known_campaign import DEG, JOINTS, MM, ROBOT, N
from tests.robot.test_ur_files import CONF
from tests.tables.test_labelled_values import LOG
from tests.tables.test_motion_capture import EXPORT
from tests.task.task_files import BOX, CYLINDER


def _campaigns() -> Files:
    """One file of each form that tests know."""
    out: Files = [("log.txt", LOG.encode()), ("motive.csv", EXPORT.encode())]
    for header, rows, *_ in (*forms.READ.values(), *surroundings.READ.values(), *surroundings.REFUSED.values()):
        text = "\r\n".join([*([",".join(header)] if header else []), *rows[:8], ""])
        out += [("file.csv", text.encode()), ("file.csv", text.replace(",", ";").replace(".", ",").encode("utf-16"))]
    return out


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


XACRO = """<robot name="cell" xmlns:xacro="http://www.ros.org/wiki/xacro">
 <xacro:property name="length" value="0.25"/>
 <xacro:macro name="arm" params="prefix">
  <link name="${prefix}base"/><link name="${prefix}tool0"/>
  <joint name="${prefix}j1" type="continuous">
   <origin xyz="0 0 ${2 * length}"/><parent link="${prefix}base"/><child link="${prefix}tool0"/><axis xyz="0 0 1"/>
  </joint>
 </xacro:macro>
 <xacro:arm prefix="left_"/>
</robot>
"""
SOCKETS = ("left/0", "left/1", "right/0", "right/1", "far/0")
OBSERVED = {
    "socket,place": ("a,1", "b,1", "c,2"),
    "d_mm,anchor": ("812.5,a", "900.25,b", "1011,a"),
    "sx_mm,sy_mm,sz_mm,landmark": ("1.5,2,300,a", "20,-3,310,b", "0,0,290,a"),
    "sx_mm,sy_mm,sz_mm,sqx,sqy,sqz,sqw,board": ("1.5,2,300,0,0,0,1,a", "20,-3,310,0,0.6,0,0.8,b"),
    "plane": ("a", "b", "c"),
    "cube,face,edge_mm,tip_radius_mm": ("1,+x,100,2", "1,-y,100,2", "1,+z,100,2"),
    "x_mm,y_mm,z_mm,J1_approach,J2_approach,J3_approach,J4_approach,J5_approach,J6_approach,temp_C,time_s": (
        "812.5,100,900,1,-1,0,1,1,1,21.5,10", "700,110,910,1,-1,0,1,1,1,22,20",
    ),
}  # fmt: skip
"""Columns beside the joints, and cells of them."""
HEADER = 'customer = "a"\norder = "4711"\ndate = 2025-01-02\ntemperature_C = 20.5\nremark = "none"\n'
PROJECT = (
    'name = "p"\nrobot = "ur5"\ncampaign = "campaigns/first.csv"\nholdout = 0.3\nseed = 0\nposes = 60\nrobust = false\n'
)


def _observed() -> Files:
    """Campaigns of every way to measure without a tracker, and of conditions."""
    joints = ",".join(f"q{k}_deg" for k in range(1, 7))
    out: Files = []
    for header, cells in OBSERVED.items():
        rows = [f"{k},10,-60,50,{k},20,{3 * k},{cells[k % len(cells)]}" for k in range(12)]
        out.append(("campaign.csv", "\n".join([f"id,{joints},{header}", *rows, ""]).encode()))
    return out


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


def _with_deltas(path: Path) -> object:
    """A UR's calibration, added to the nominal robot."""
    return robot_from(describe_robot(path, nominal=ROBOT))


READERS = {
    "campaign": Reader(files=_campaigns, read=read_either),
    "points": Reader(files=_point_files, read=_points),
    "robot": Reader(files=_robots, read=load_robot),
    "dh": Reader(files=_tables, read=lambda path: read_dh_table(path, "dh")),
    "ur-yaml": Reader(files=lambda: [("k.yaml", export_ur_yaml(calibrated("ur5")).text.encode())], read=load_robot),
    "ur-conf": Reader(files=named("calibration.conf", CONF), read=_with_deltas),
    "xacro": Reader(files=named("r.urdf.xacro", XACRO), read=load_robot, sample=3),
    "urdf": Reader(
        files=lambda: [("r.urdf", random_urdf(np.random.default_rng(k), 4).encode()) for k in range(20)],
        read=load_robot,
    ),
    "task": Reader(files=named("task.toml", BOX, CYLINDER), read=load_task),
    "station": Reader(files=named("station.toml", STATION), read=load_station),
    "boards": Reader(files=named("board.toml", CHARUCO + CIRCLES), read=read_boards),
    "cell": Reader(files=named("cell.toml", CELL), read=load_cell),
    "poses": Reader(files=named("poses.csv", *POSE_TABLES), read=lambda path: read_tool_poses(read_csv(path))),
    "pose-cycles": Reader(files=named("cycles.csv", "\n".join([POSES, *POSE_ROWS])), read=read_pose_cycles),
    "path-cycles": Reader(files=named("path.csv", "\n".join([PATH, *PATH_ROWS])), read=read_path_cycles),
    "calibration": Reader(files=_json("cal"), read=partial(load_calibration, unsealed=True)),
    "registration": Reader(files=_json("reg"), read=lambda path: load_registration(path, *_saved()[:2], unsealed=True)),
    "truth": Reader(files=_json("truth"), read=lambda path: read_truth(path, _saved()[0])),
    "rows": Reader(
        files=named("rows.txt", "0\n3\n5\n", "# rows\n1\n"), read=lambda path: choose_rows(str(path), 9, path)
    ),
    "observed": Reader(files=_observed, read=read_either),
    "distances": Reader(
        files=named("d.csv", "socket_a,socket_b,distance_mm,u_mm\n0,1,50.0,0.01\nleft/0,right/1,810.5,\n"),
        read=lambda path: read_distances(path, SOCKETS),
    ),
    "header": Reader(files=named("header.toml", HEADER), read=read_header),
    "project": Reader(files=named("project.toml", PROJECT), read=lambda path: read_toml(path, Choices)),
    **PACKED_READERS,
}
