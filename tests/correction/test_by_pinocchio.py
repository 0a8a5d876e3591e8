"""Corrected programs against another library: the controller's joints by Pinocchio, the true tool by the calibration."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robot_programs.core.program import Frame, Motion, Target
from robot_programs.core.source import Place, Source
from robot_programs.languages import Composition, language_of
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


@pytest.fixture(scope="module", params=HOME)
def true_robot(request):
    """A calibration of a robot with defects, its chain, where a program begins, the robot, and its flange there."""
    calibration, chain, q = defective(request.param, np.radians(HOME[request.param]))
    robot = calibration.model.robot
    return calibration, chain, q, robot, chain.pose(q) @ np.linalg.inv(robot.T_flange_tool)


@pytest.mark.parametrize(("name", "in_hand"), [("p.mod", True), ("p.csv", False)])
def test_the_true_tool_is_where_the_program_wants_it(true_robot, name, in_hand):
    """With a part in the hand; or in a turned part that no file states."""
    calibration, chain, q, robot, flange = true_robot
    # what is held and what stands still; the program's points are the tool in the part
    held = TOOL if name != "p.csv" else robot.T_flange_tool
    standing = flange @ held @ se3.translation(0.05, -0.03, 0.02) @ se3.rotation("x", 0.4)
    tool, part = (standing, held) if in_hand else (held, standing)
    frames = Frame(name="tGrip", T=tool), Frame(name="wPart", T=part)
    home = Target(name="", T=None, q=q, posture=None, place=Place(path=Path(name), line=1))
    motions = [
        Motion(
            kind="axes", end=home, via=None, tool=frames[0], part=frames[1], part_in_hand=in_hand, speed=None, stops=True,
            follows=None, routine="p", place=home.place,
        )
    ]  # fmt: skip
    for i, (x, y, z) in enumerate([(0, 0, 0), (0.05, 0, 0), (0.05, 0.04, 0.01)]):
        T = np.linalg.inv(standing) @ se3.translation(x, y, z) @ flange @ held
        place = Place(path=Path(name), line=1)
        end = Target(name="", T=np.linalg.inv(T) if in_hand else T, q=None, posture=None, place=place)
        motions.append(
            Motion(
                kind="linear" if i else "joint", end=end, via=None, tool=frames[0], part=frames[1], part_in_hand=in_hand,
                speed=0.1, stops=True, follows=i, routine="p", place=place,
            )
        )  # fmt: skip
    at = np.stack([q, *(chain.joints(move.flange(move.end.T) @ robot.T_flange_tool, q) for move in motions[1:])])
    language = language_of(Path(name))
    source = language.compose(Composition(name="p", robot=robot, motions=motions, q=at))
    surroundings = {} if language.declares_frames else {"tool": frames[0], "part": frames[1]}
    program = parse_program((source,), robot=robot, **surroundings)
    assert [move.part_in_hand for move in program.motions] == [in_hand] * 4
    found = correct(calibration, program, bounds=COARSE)
    assert not found.rejected
    again = parse_program(found.sources, robot=robot, **surroundings)
    for wanted, move, near in list(zip(motions, again.motions, at, strict=True))[1:]:
        driven = chain.joints(move.flange(move.end.T) @ robot.T_flange_tool, near)
        true = calibration.tool_in_base(driven[None])[0] @ np.linalg.inv(robot.T_flange_tool)
        got = np.linalg.inv(true @ part) @ tool if in_hand else np.linalg.inv(part) @ true @ tool
        meets(got, wanted.end.T)
        assert np.abs(move.end.T - wanted.end.T).max() > 1e-5


def test_true_part_in_a_kukas_hand_is_as_programmed(true_robot):
    """The true part in a KUKA's hand is where the program wants it."""
    calibration, chain, q, robot, flange = true_robot
    standing = flange @ TOOL @ ASIDE
    wanted = [np.linalg.inv(se3.translation(*step) @ flange @ TOOL) @ standing for step in STEPS]
    lines = ["DEF p()", "$TOOL = BASE_DATA[1]", "$BASE = TOOL_DATA[1]", "$IPO_MODE = #TCP", f"PTP {krl_joints(q)}"]
    lines += [f"{'LIN' if k else 'PTP'} {krl_frame(T)}" for k, T in enumerate(wanted)]
    frames = f"DEFDAT $CONFIG\nTOOL_DATA[1]={krl_frame(TOOL)}\nBASE_DATA[1]={krl_frame(standing)}\nENDDAT\n"
    source = Source.of(Path("p.src"), "\n".join([*lines, "END", ""]).encode())
    program = parse_program((source, Source.of(Path("$config.dat"), frames.encode())), robot=robot)
    assert [move.part_in_hand for move in program.motions[1:]] == [True] * 3
    found = correct(calibration, program, bounds=COARSE)
    assert not found.rejected
    for T, move in zip(wanted, parse_program(found.sources, robot=robot).motions[1:], strict=True):
        true_held = true_tool(calibration, chain, move.flange(move.end.T), q, TOOL)
        got = np.linalg.inv(true_held) @ standing
        meets(got, T)
        assert np.abs(move.end.T - T).max() > 1e-5


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


@pytest.mark.parametrize("name", ["p.mod", "p.src"])
@pytest.mark.parametrize("carries", ["robot", "part"])
def test_true_tool_is_as_programmed_on_external_axes(true_robot, name, carries):
    """On a track the robot's base moves; on a turntable, in RAPID, the part does."""
    if carries == "part" and name == "p.src":
        pytest.skip("a base that moves is named by machine data, which tests/robot_programs/krl reads")
    calibration, chain, q, robot, flange = true_robot
    direction, stations = np.array([0.6, 0.8, 0.0]), (0.0, 250.0, -120.0)
    table = flange @ TOOL @ se3.translation(0.1, 0.0, -0.05)
    inner = se3.translation(-0.03, 0.02, 0.04)
    moved = [
        se3.translation(*direction * s * 1e-3) if carries == "robot" else table @ se3.rotation("z", np.radians(s))
        for s in stations
    ]
    standing = flange @ TOOL if carries == "robot" else None
    flanges = [se3.translation(*step) @ flange for step in STEPS]
    wanted = [
        np.linalg.inv(standing) @ T @ goal @ TOOL if carries == "robot" else np.linalg.inv(T @ inner) @ goal @ TOOL
        for T, goal in zip(moved, flanges, strict=True)
    ]
    axis = ExternalAxis(
        number=1, carries=carries, slides_along=direction if carries == "robot" else None,
        turns_about=None if carries == "robot" else np.array([0, 0, 1.0]),
        T_frame=None if carries == "robot" else table, unit="",
    )  # fmt: skip
    source = text_with_axes(name, standing if carries == "robot" else inner, wanted, stations, carries, robot, q)
    program = parse_program((source,), robot=robot)
    found = correct(calibration, program, cell=Cell(axes=(axis,)), bounds=COARSE)
    assert not found.rejected
    again = parse_program(found.sources, robot=robot).motions[-3:]
    for T, move, at in zip(wanted, again, moved, strict=True):
        T_base_part = np.linalg.inv(at) @ standing if carries == "robot" else at @ inner
        goal = T_base_part @ move.end.T @ np.linalg.inv(TOOL)
        got = np.linalg.inv(T_base_part) @ true_tool(calibration, chain, goal, q, TOOL)
        meets(got, T)
        assert np.abs(move.end.T[:3, 3] - T[:3, 3]).max() > 1e-5


def text_with_axes(name, part, targets, stations, carries, robot, q):
    """Three motions with positions of the first external axis."""
    if name == "p.src":
        lines = ["DEF p()", f"$TOOL = {krl_frame(TOOL)}", f"$BASE = {krl_frame(part)}"]
        lines += [
            f"{'LIN' if k else 'PTP'} {krl_frame(T, f',E1 {s}')}"
            for k, (T, s) in enumerate(zip(targets, stations, strict=True))
        ]
        lines[3:3] = [f"PTP {krl_joints(q, ',E1 0')}"]
        return Source.of(Path(name), "\n".join([*lines, "END", ""]).encode())
    unit = '[FALSE,TRUE,"",' if carries == "robot" else '[FALSE,FALSE,"STN1",'
    configuration = Confdata.of(robot, q)
    lines = [
        "MODULE p",
        f"PERS tooldata t:=[TRUE,{rapid_pose(TOOL)},[1,[0,0,1],[1,0,0,0],0,0,0]];",
        f"PERS wobjdata w:={unit}[[0,0,0],[1,0,0,0]],{rapid_pose(part)}];",
        "PROC main()",
    ]
    for k, (T, s) in enumerate(zip(targets, stations, strict=True)):
        target = f"{rapid_pose(T)[:-1]},{configuration},[{s},9E9,9E9,9E9,9E9,9E9]]"
        lines.append(f"{'MoveL' if k else 'MoveJ'} {target},v100,fine,t\\WObj:=w;")
    return Source.of(Path(name), "\n".join([*lines, "ENDPROC", "ENDMODULE", ""]).encode())


@pytest.mark.parametrize("name", ["p.mod", "p.src"])
def test_true_tool_is_as_programmed_on_a_pedestal(true_robot, name):
    """Its base is in MOC.cfg or $machine.dat; a pure rotation at the end goes at the stated speed."""
    calibration, chain, q, robot, flange = true_robot
    base = se3.translation(1.0, -2.0, 0.8) @ se3.rotation("z", 0.5)
    part = base @ flange @ TOOL @ se3.rotation("x", 0.4)
    flanges = [se3.translation(*step) @ flange for step in STEPS]
    turned = flanges[-1] @ TOOL @ se3.rotation("z", 0.6)
    wanted = [np.linalg.inv(part) @ base @ T for T in (*(F @ TOOL for F in flanges), turned)]
    motions = text_with_axes(name, part, wanted, (0.0,) * 4, "robot", robot, q)
    text = motions.text.replace("DEF p()", "DEF p()\n$VEL.CP = 0.1\n$VEL.ORI1 = 100")
    sources = (Source.of(Path(name), text.encode()), base_file(name, base))
    found = correct(calibration, parse_program(sources, robot=robot), bounds=COARSE)
    assert not found.rejected
    speed = np.degrees(found.motion.speed).max()
    stated = {"p.mod": 500.0, "p.src": 100.0}[name]
    assert stated < speed < 2.0 * stated  # several axes turn about a tilted tool, some against each other
    for T, move in zip(wanted, parse_program(found.sources, robot=robot).motions[-4:], strict=True):
        T_base_part = np.linalg.inv(base) @ part
        got = np.linalg.inv(T_base_part) @ true_tool(
            calibration, chain, T_base_part @ move.end.T @ np.linalg.inv(TOOL), q, TOOL
        )
        np.testing.assert_allclose(got[:3, 3], T[:3, 3], atol=1e-6)


def base_file(name, base):
    """What says where the robot stands."""
    x, y, z = base[:3, 3]
    if name == "p.src":
        text = f"DEFDAT $MACHINE PUBLIC\n$ROBROOT={krl_frame(base)}\nENDDAT\n"
        return Source.of(Path("$machine.dat"), text.encode())
    _, _, qz, qw = Rotation.from_matrix(base[:3, :3]).as_quat()
    frame = f"-base_frame_pos_x {x} -base_frame_pos_y {y} -base_frame_pos_z {z}\\\n"
    turn = f"      -base_frame_orient_u0 {qw} -base_frame_orient_u3 {qz}\n"
    return Source.of(Path("MOC.cfg"), f'MOC:CFG_1.0:6:0::\n#\nROBOT:\n\n      -name "ROB_1" {frame}{turn}'.encode())
