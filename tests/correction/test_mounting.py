"""Programs of robots on pedestals, on tracks, and beside positioners."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Configuration
from robot_programs.reading import read_program
from taskcal.correction.cell import Cell, ExternalAxis, Measured, mount
from taskcal.correction.correct import correct
from taskcal.correction.correction import Bounds
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.robot.error_model import ErrorModel
from tests.correction.test_correct import true_poses

BASE = se3.pose(se3.exp(np.array([0.0, 0.0, 0.8])), np.array([0.4, -1.2, 0.9]))
TRACK = ExternalAxis(number=1, carries="robot", direction=np.array([0.0, 0.6, 0.8]))
TABLE = ExternalAxis(
    number=2, carries="part", turns=True, direction=np.array([0.0, 0.0, 1.0]),
    T_frame=se3.pose(se3.exp(np.array([0.1, 0.2, 0.3])), np.array([1.5, 0.3, 0.4])), unit="STN1",
)  # fmt: skip
COARSE = Bounds(tolerance=1.0)


def numbers(values):
    return "[" + ",".join(f"{value:.9g}" for value in values) + "]"


def program_of(poses, part, tool, *, external=(), unit="", conf="[0,0,0,0]"):
    """Motions to poses in a work object, in one posture; external axes by motion."""

    def frame(T):
        x, y, z, w = se3.to_quaternion(T[:3, :3])
        return f"[{numbers(T[:3, 3] * 1e3)},{numbers([w, x, y, z])}]"

    work_object = f'[FALSE,{"FALSE" if unit else "TRUE"},"{unit}",'
    work_object += f"[[0,0,0],[1,0,0,0]],{frame(part)}]"
    lines = [
        "MODULE Part",
        f"PERS tooldata tMill:=[TRUE,{frame(tool)},[1,[0,0,1],[1,0,0,0],0,0,0]];",
        f"PERS wobjdata wPart:={work_object};",
        "PROC main()",
        "ConfJ\\Off; ConfL\\Off;",
    ]
    for i, T in enumerate(poses):
        axes = ["9E9"] * 6
        for k, value in (external[i] if external else {}).items():
            axes[k] = f"{value:g}"
        name = "MoveL" if i else "MoveJ"
        target = f"{frame(T)[:-1]},{conf},[{','.join(axes)}]]"
        lines.append(f"{name} {target},v50,z1,tMill\\WObj:=wPart;")
    return Source.of(Path("part.mod"), "\n".join([*lines, "ENDPROC", "ENDMODULE", ""]).encode())


@pytest.fixture
def corners(shifted):
    return [shifted(x, y, z) for x, y, z in ((0, 0, 0), (200, 0, 0), (200, 150, 20))]


@pytest.fixture
def conf(corners, robot):
    """The first target's posture, as RAPID states it."""
    return str(Configuration.of(robot, find_posture(ErrorModel(robot), corners[0])))


@pytest.fixture
def part(middle):
    return middle @ se3.translation(0.05, 0.02, 0.0)


def in_part(part, poses):
    return [se3.inverse(part) @ T for T in poses]


def ends(correction):
    return np.array([move.end.T for move in correction.motions])


def test_a_robot_on_a_pedestal_corrects_as_one_in_the_origin(corners, part, robot, conf, calibration):
    tool, targets = robot.T_flange_tool, in_part(part, corners)
    plain = correct(calibration, read_rapid([program_of(targets, part, tool, conf=conf)]), bounds=COARSE)
    raised = read_rapid([program_of(targets, BASE @ part, tool, conf=conf)])
    found = correct(calibration, raised, cell=Cell(T_world_base=BASE), bounds=COARSE)
    assert not found.rejected
    np.testing.assert_allclose(ends(found), ends(plain), atol=3e-8)
    assert "the robot stands at [400.00, -1200.00, 900.00] mm in the world, as the cell file says" in found.statements
    assert any("the robot's base is taken to be the world's frame" in text for text in plain.statements)


def test_where_the_robot_stands_is_asked_once(corners, part, robot, conf, calibration):
    far = se3.translation(0.0, 6.0, 0.0) @ part
    program = read_rapid([program_of(in_part(part, corners), far, robot.T_flange_tool)])
    found = correct(calibration, program)
    assert len(found.rejected) == 3
    asked = [str(diagnostic) for diagnostic in found.diagnostics if "where does it stand" in diagnostic.text]
    assert asked == [
        "part.mod:6: 3 motions are out of reach of a robot in the world's origin: where does it stand? Pass MOC.cfg with the "
        "program, or state [robot] base in the cell file"
    ]
    stated = correct(calibration, program, cell=Cell(T_world_base=np.eye(4)))
    assert not [diagnostic for diagnostic in stated.diagnostics if "where does it stand" in diagnostic.text]


def test_conflicting_bases_are_refused():
    """Cell file and program must not place the robot differently."""
    krl = (
        "DEF P( )\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 30,A6 0}\nEND\n",
        "DEFDAT $MACHINE\nFRAME $ROBROOT={X 0,Y 0,Z 500,A 0,B 0,C 0}\nENDDAT\n",
    )
    program = read_krl(
        [Source.of(Path(name), text.encode()) for name, text in zip(("p.src", "$machine.dat"), krl, strict=True)]
    )
    with pytest.raises(
        TaskcalError, match=r"at \[0\.00, 0\.00, 600\.00\] mm by the cell file and at \[0\.00, 0\.00, 500\.00\] mm"
    ):
        mount(program, Cell(T_world_base=se3.translation(0.0, 0.0, 0.6)))
    assert not mount(program, Cell(T_world_base=se3.translation(0.0, 0.0, 0.5))).refused


def test_the_true_tool_of_a_robot_on_a_track_goes_to_the_targets(corners, part, robot, conf, calibration):
    """In the world, by plain products: where the track has the robot, times that robot, is where the part has the target."""
    tool, stations = robot.T_flange_tool, (0.0, 700.0, 700.0)
    world = BASE @ part
    travel = [se3.translation(*(TRACK.direction * s * 1e-3)) for s in stations]
    # targets that the robot reaches where the track then has it
    targets = [se3.inverse(world) @ T @ BASE @ corner for T, corner in zip(travel, corners, strict=True)]
    program = read_rapid([program_of(targets, world, tool, conf=conf, external=[{0: s} for s in stations])])
    cell = Cell(T_world_base=BASE, axes=(TRACK,))
    found = correct(calibration, program, cell=cell, bounds=COARSE)
    assert not found.rejected
    true = [T @ BASE @ pose for T, pose in zip(travel, true_poses(calibration, found.motions, robot), strict=True)]
    wanted = [world @ T for T in targets]
    np.testing.assert_allclose(np.array(true)[:, :3, 3], np.array(wanted)[:, :3, 3], atol=3e-7)
    # the line along which the track moves is corrected at its end; the one after it begins where it ended
    assert [move.follows for move in mount(program, cell).program.motions] == [None, None, 1]
    assert sum("an external axis moves robot or part along it" in str(d) for d in found.diagnostics) == 1


def test_a_part_on_a_positioner_is_where_its_axis_has_it(corners, part, robot, conf, calibration):
    tool, turn = robot.T_flange_tool, np.radians(35.0)
    carried = TABLE.T_frame @ se3.pose(se3.exp(np.array([0.0, 0.0, turn])), np.zeros(3))
    inner = se3.inverse(carried) @ part  # what the table carries, so that it comes to stand at the part's place
    targets = in_part(part, corners)
    plain = correct(calibration, read_rapid([program_of(targets, part, tool, conf=conf)]), bounds=COARSE)
    program = read_rapid([program_of(targets, inner, tool, conf=conf, external=[{1: 35.0}] * 3, unit="stn1")])
    found = correct(calibration, program, cell=Cell(axes=(TABLE,)), bounds=COARSE)
    assert not found.rejected
    np.testing.assert_allclose(ends(found), ends(plain), atol=3e-8)
    tracked = Cell(axes=(TABLE,), parts={"wpart": Measured(name="wPart", in_tracker=np.eye(4))})
    with pytest.raises(TaskcalError, match="'wPart' was measured with the external axes at zero"):
        correct(calibration, program, cell=tracked)


@pytest.mark.parametrize(
    ("external", "unit", "axes", "words"),
    [
        ({0: 12.5}, "", (), r'write \[\[axis\]\] number = 1, carries = "nothing", or "robot" or "part"'),
        ({2: 12.5}, "", (TRACK,), r"external axis 3 \(eax_c, E3\) is away from zero"),
        ({}, "", (TRACK,), r"does not say where external axis 1 \(eax_a, E1\) stands, which carries the robot"),
        ({1: 0.0}, "STN2", (TABLE,), "its part 'wPart' is moved by STN2"),
    ],
)
def test_what_external_axes_carry_is_asked_for(external, unit, axes, words, corners, part, robot, conf, calibration):
    program = read_rapid(
        [program_of(in_part(part, corners), part, robot.T_flange_tool, conf=conf, external=[external] * 3, unit=unit)]
    )
    found = correct(calibration, program, cell=Cell(axes=axes), bounds=COARSE)
    assert len(found.rejected) == 3
    (why,) = set(found.rejected.values())
    import re

    assert re.search(words, why)
    assert [source.text for source in found.sources] == [source.text for source in program.sources]


def test_an_axis_that_carries_nothing_goes_along_in_step(corners, part, robot, conf, calibration):
    tool, targets = robot.T_flange_tool, in_part(part, corners)
    fed = [{3: 10.0}, {3: 110.0}, {3: 150.0}]
    nothing = ExternalAxis(number=4, carries="nothing")
    coarse = correct(calibration, read_rapid([program_of(targets, part, tool, conf=conf)]), bounds=COARSE)
    fine = Bounds(tolerance=float(coarse.after.length[~coarse.after.at_target].max()) / 5.0)
    found = correct(
        calibration,
        read_rapid([program_of(targets, part, tool, conf=conf, external=fed)]),
        cell=Cell(axes=(nothing,)),
        bounds=fine,
    )
    plain = correct(calibration, read_rapid([program_of(targets, part, tool, conf=conf)]), bounds=fine)
    np.testing.assert_allclose(ends(found), ends(plain), atol=1e-12)
    assert found.pieces[1] > 1
    pieces = np.array([move.external[3] for move in found.motions[1 : 1 + found.pieces[1]]])
    np.testing.assert_allclose(pieces, 10.0 + 100.0 * np.arange(1, len(pieces) + 1) / len(pieces), atol=1e-4)


def test_tools_that_are_loaded_have_to_be_told(tmp_path, corners, robot, calibration):
    points = "".join(
        "GOTO/" + ",".join(f"{v:.6f}" for v in (*(T[:3, 3] * 1e3), *-T[:3, 2])) + "\n" for T in corners[:1]
    )
    text = f"LOAD/TOOL,1\n{points}LOAD/TOOL,2\n{points}"
    path = tmp_path / "part.apt"
    path.write_text(text)
    found = correct(calibration, read_program(path, robot=robot), bounds=COARSE)
    assert list(found.rejected) == [1]
    (why,) = set(found.rejected.values())
    assert why.startswith(
        "tool 2 is loaded, and it is not known where that is; state it in the cell file: [[tool]] name = "
    )
    shorter = Frame(name="2", T=robot.T_flange_tool @ se3.translation(0.0, 0.0, -0.03))
    told = correct(calibration, read_program(path, robot=robot, tools={"2": shorter}), bounds=COARSE)
    assert not told.rejected
    assert {move.tool.name for move in told.motions} == {"", "2"}


def test_the_same_track_in_krl(corners, part, robot, conf, calibration):
    from robot_programs.krl.data import pose_values

    def written(T):
        return ",".join(f"{name} {value:.9g}" for name, value in pose_values(T).items())

    stations = (0.0, 700.0)
    travel = [se3.translation(*(TRACK.direction * s * 1e-3)) for s in stations]
    targets = [se3.inverse(BASE @ part) @ T @ BASE @ corner for T, corner in zip(travel, corners, strict=False)]
    lines = [
        f"{'LIN' if i else 'PTP'} {{{written(T)},E1 {s}}}"
        for i, (T, s) in enumerate(zip(targets, stations, strict=True))
    ]
    lines.append(f"LIN {{{written(targets[1])}}}")  # the track stays where it was
    text = [f"$TOOL={{{written(robot.T_flange_tool)}}}", f"$BASE={{{written(BASE @ part)}}}", "$VEL.CP=0.05", *lines]
    program = read_krl([Source.of(Path("p.src"), "\n".join(["DEF P( )", *text, "END", ""]).encode())])
    cell = Cell(T_world_base=BASE, axes=(TRACK,))
    found = correct(calibration, program, cell=cell, bounds=COARSE)
    assert not found.rejected
    true = true_poses(calibration, found.motions, robot)
    expected = [
        se3.inverse(T @ BASE) @ BASE @ part @ target
        for T, target in zip((*travel, travel[1]), (*targets, targets[1]), strict=True)
    ]
    np.testing.assert_allclose(true[:, :3, 3], np.array(expected)[:, :3, 3], atol=1e-7)
    unsaid = mount(replace(program), Cell(T_world_base=BASE))
    assert list(unsaid.refused) == [1, 2]


@pytest.mark.parametrize(
    ("axes", "refused"), [((TRACK,), True), ((), True), ((replace(TRACK, carries="nothing"),), False)]
)
@pytest.mark.parametrize("at", [0.0, 500.0])
def test_mount_refuses_axes_shifted_by_an_unknown_amount(axes, refused, at, corners, part):
    """An axis that EOffsSet shifts stands nowhere that the text says, at zero neither."""
    source = program_of(corners[:1], part, np.eye(4), external=[{0: at}])
    shifted = read_rapid([replace(source, text=source.text.replace("ConfL", "EOffsSet [99,0,0,0,0,0]; ConfL"))])
    mounted = mount(shifted, Cell(axes=axes))
    assert bool(mounted.refused) == refused
    assert (
        not refused or "may be shifted from where the text has it (EOffsSet in part.mod:5)" in mounted.refused[0] or at
    )
