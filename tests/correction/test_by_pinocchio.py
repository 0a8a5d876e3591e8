"""Corrected programs against another library: the controller's joints by Pinocchio, the true tool by the calibration."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.rapid.resolve import Confdata
from robot_programs.reading import parse_program
from taskcal.correction.cell import Cell, ExternalAxis
from taskcal.correction.controller import simulate_controller
from taskcal.correction.correct import correct
from taskcal.geometry import se3
from tests.correction.by_pinocchio import COARSE, STEPS, TOOL, defective, meets, true_tool
from tests.robot_programs.written import krl_frame, krl_joints, rapid_pose

HOME = {"abb-irb120": (0, 20, 10, 10, 50, -20), "kuka-kr16-2": (10, -70, 90, 10, 50, -20)}
ASIDE = se3.translation(0.05, -0.03, 0.02) @ se3.rotation("x", 0.4)
STATIONS = (0.0, 250.0, -120.0)
"""Positions of an external axis, millimetres or degrees."""
TRACK, TURNED = np.array([0.6, 0.8, 0.0]), se3.translation(-0.03, 0.02, 0.04)
"""Direction of a track, and a part on a turntable."""
BASE = se3.translation(1.0, -2.0, 0.8) @ se3.rotation("z", 0.5)


@pytest.fixture(scope="module", params=HOME)
def true_robot(request):
    """A calibration of a robot with defects, its chain, where a program begins, the robot, and its flange there."""
    calibration, chain, q = defective(request.param, np.radians(HOME[request.param]))
    robot = calibration.model.robot
    return calibration, chain, q, robot, chain.pose(q) @ np.linalg.inv(robot.T_flange_tool)


@dataclass(frozen=True, kw_only=True)
class Place:
    """What stands still, and what is held."""

    stated: np.ndarray
    """What stands still, as the program states it."""
    standing: list[np.ndarray]
    """The same in the robot's base, by motion."""
    held: np.ndarray = field(default_factory=lambda: TOOL)
    in_hand: bool = False
    stations: tuple[float, ...] = ()
    axis: ExternalAxis | None = None
    base: np.ndarray | None = None

    def programmed(self, k, flange):
        """The tool in the part where the flange is at a pose."""
        T = np.linalg.inv(self.standing[k]) @ flange @ self.held
        return np.linalg.inv(T) if self.in_hand else T


def place_of(kind, flange, robot):
    at = flange @ TOOL
    match kind:
        case "turned":
            own = robot.T_flange_tool
            return Place(stated=flange @ own @ ASIDE, standing=[flange @ own @ ASIDE] * 3, held=own)
        case "in hand":
            return Place(stated=at @ ASIDE, standing=[at @ ASIDE] * 3, in_hand=True)
        case "pedestal":
            part = at @ se3.rotation("x", 0.4)
            return Place(stated=BASE @ part, standing=[part] * 4, stations=(0.0,) * 4, base=BASE)
        case "track":
            axis = ExternalAxis(number=1, carries="robot", slides_along=TRACK, T_frame=None, unit="")
            standing = [np.linalg.inv(se3.translation(*TRACK * s * 1e-3)) @ at for s in STATIONS]
            return Place(stated=at, standing=standing, stations=STATIONS, axis=axis)
        case _:
            table = at @ se3.translation(0.1, 0.0, -0.05)
            axis = ExternalAxis(number=1, carries="part", turns_about=np.array([0, 0, 1.0]), T_frame=table, unit="")
            standing = [table @ se3.rotation("z", np.radians(s)) @ TURNED for s in STATIONS]
            return Place(stated=TURNED, standing=standing, stations=STATIONS, axis=axis)


def text_of(name, kind, place, targets, robot, q):
    """A joint motion and lines; on what an external axis carries with its positions."""
    if name == "p.csv":
        rows = [[*T[:3, 3] * 1e3, *Rotation.from_matrix(T[:3, :3]).as_quat()] for T in targets]
        lines = [",".join(f"{v:.9f}" for v in row) + f",{'linear' if k else 'joint'}" for k, row in enumerate(rows)]
        return "\n".join(["x_mm,y_mm,z_mm,qx,qy,qz,qw,move", *lines, ""])
    stations = place.stations or ("9E9",) * 3
    if name == "p.src":
        frames = ("BASE_DATA[1]", "TOOL_DATA[1]") if place.in_hand else (krl_frame(place.held), krl_frame(place.stated))
        axes = [f",E1 {s}" if place.stations else "" for s in stations]
        lines = ["DEF p()", f"$TOOL = {frames[0]}", f"$BASE = {frames[1]}", "$VEL.CP = 0.1", "$VEL.ORI1 = 100"]
        lines += [f"$IPO_MODE = {'#TCP' if place.in_hand else '#BASE'}", f"PTP {krl_joints(q, axes[0] and ',E1 0')}"]
        lines += [
            f"{'LIN' if k else 'PTP'} {krl_frame(T, s)}" for k, (T, s) in enumerate(zip(targets, axes, strict=True))
        ]
        return "\n".join([*lines, "END", ""])
    fixed, unit = ("FALSE", "STN1") if kind == "turntable" else ("TRUE", "")
    hand, tool = str(place.in_hand).upper(), str(not place.in_hand).upper()
    still, moved = (place.held, place.stated) if place.in_hand else (place.stated, place.held)
    lines = [
        "MODULE p",
        f"PERS tooldata t:=[{tool},{rapid_pose(moved)},[1,[0,0,1],[1,0,0,0],0,0,0]];",
        f'PERS wobjdata w:=[{hand},{fixed},"{unit}",[[0,0,0],[1,0,0,0]],{rapid_pose(still)}];',
        "PROC main()",
    ]
    for k, (T, s) in enumerate(zip(targets, stations, strict=True)):
        target = f"{rapid_pose(T)[:-1]},{Confdata.of(robot, q)},[{s},9E9,9E9,9E9,9E9,9E9]]"
        lines.append(f"{'MoveL' if k else 'MoveJ'} {target},v100,fine,t\\WObj:=w;")
    return "\n".join([*lines, "ENDPROC", "ENDMODULE", ""])


def file_beside(name, place):
    """What states frames by number, or where the robot stands."""
    if place.in_hand and name == "p.src":
        text = f"DEFDAT $CONFIG\nTOOL_DATA[1]={krl_frame(place.held)}\nBASE_DATA[1]={krl_frame(place.stated)}\nENDDAT\n"
        return (Source.of(Path("$config.dat"), text.encode()),)
    if place.base is None:
        return ()
    if name == "p.src":
        text = f"DEFDAT $MACHINE PUBLIC\n$ROBROOT={krl_frame(place.base)}\nENDDAT\n"
        return (Source.of(Path("$machine.dat"), text.encode()),)
    (x, y, z), (_, _, qz, qw) = place.base[:3, 3], Rotation.from_matrix(place.base[:3, :3]).as_quat()
    frame = f"-base_frame_pos_x {x} -base_frame_pos_y {y} -base_frame_pos_z {z}\\\n"
    turn = f"      -base_frame_orient_u0 {qw} -base_frame_orient_u3 {qz}\n"
    return (Source.of(Path("MOC.cfg"), f'MOC:CFG_1.0:6:0::\n#\nROBOT:\n\n      -name "ROB_1" {frame}{turn}'.encode()),)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("p.csv", "turned"), ("p.mod", "turntable"),
        *((name, kind) for name in ("p.mod", "p.src") for kind in ("in hand", "track", "pedestal")),
    ],
)  # fmt: skip
def test_the_true_tool_is_where_the_program_wants_it(true_robot, name, kind):
    """In a turned part that no file states; with a part in the hand, on a track, on a turntable (in KRL it is named by machine
    data, which tests/robot_programs/krl reads), or on a pedestal of MOC.cfg or $machine.dat, with a pure rotation at the end."""
    calibration, chain, q, robot, flange = true_robot
    place = place_of(kind, flange, robot)
    flanges = [se3.translation(*step) @ flange for step in STEPS]
    if kind == "pedestal":
        flanges.append(flanges[-1] @ TOOL @ se3.rotation("z", 0.6) @ np.linalg.inv(TOOL))
    wanted = [place.programmed(k, T) for k, T in enumerate(flanges)]
    text = text_of(name, kind, place, wanted, robot, q)
    sources = (Source.of(Path(name), text.encode()), *file_beside(name, place))
    given = {} if name != "p.csv" else {"tool": Frame(name="t", T=place.held), "part": Frame(name="w", T=place.stated)}
    program = parse_program(sources, robot=robot, **given)
    assert [move.part_in_hand for move in program.motions[-len(wanted) :]] == [place.in_hand] * len(wanted)
    found = correct(calibration, program, cell=Cell(axes=(place.axis,) if place.axis else ()), bounds=COARSE)
    assert not found.rejected
    again = parse_program(found.sources, robot=robot, **given).motions[-len(wanted) :]
    for k, (T, move) in enumerate(zip(wanted, again, strict=True)):
        seen = np.linalg.inv(move.end.T) if place.in_hand else move.end.T
        goal = place.standing[k] @ seen @ np.linalg.inv(place.held)
        at = chain.joints(flanges[k] @ robot.T_flange_tool, q)
        got = np.linalg.inv(place.standing[k]) @ true_tool(calibration, chain, goal, at, place.held)
        meets(np.linalg.inv(got) if place.in_hand else got, T)
        assert np.abs(move.end.T - T).max() > 1e-5
    if kind == "pedestal":
        speed, stated = np.degrees(found.motion.speed).max(), {"p.mod": 500.0, "p.src": 100.0}[name]
        assert stated < speed < 2.0 * stated  # several axes turn about a tilted tool, some against each other


def test_the_true_cutter_of_an_apt_path_is_where_its_points_are(true_robot):
    calibration, chain, _, robot, flange = true_robot
    part = flange @ TOOL @ ASIDE
    wanted = [np.linalg.inv(part) @ se3.translation(*step) @ flange @ TOOL for step in STEPS]
    points = [
        "GOTO/" + ",".join(f"{v:.9f}" for v in (*T[:3, 3] * 1e3, *-T[:3, 2])) for T in wanted
    ]  # APT's tool axis points from the tip into the tool
    text = "\n".join(["UNITS/MM", "MULTAX/ON", "FEDRAT/600,MMPM", *points, "FINI", ""])
    source = Source.of(Path("p.apt"), text.encode())
    frames = {"tool": Frame(name="mill", T=TOOL), "part": Frame(name="fixture", T=part)}
    program = parse_program((source,), robot=robot, **frames)
    found = correct(calibration, program, bounds=COARSE)
    assert not found.rejected
    assert len(found.motions) == len(wanted)
    assert found.after.length[found.after.at_target].max() < 1e-7
    # APT states neither spin nor posture: they are those that the correction chose
    postures = simulate_controller(robot, found.program.motions).end
    for T, move, near in zip(wanted, found.motions, postures, strict=True):
        got = np.linalg.inv(part) @ true_tool(calibration, chain, part @ move.end.T @ np.linalg.inv(TOOL), near, TOOL)
        np.testing.assert_allclose(got[:3, 3], T[:3, 3], atol=1e-7)
        np.testing.assert_allclose(got[:3, 2], T[:3, 2], atol=2e-7)
        assert np.abs(move.end.T[:3, 3] - T[:3, 3]).max() > 1e-5
