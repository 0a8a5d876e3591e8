"""Programs of robots on pedestals, on tracks, and beside positioners."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from robot_programs.krl.read import read_krl
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.resolve import Confdata
from robot_programs.reading import read_program
from taskcal.correction.cell import Cell, ExternalAxis, Measured, carried_part, carried_robot, mount
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.kinematics.inverse import find_posture
from taskcal.robot.error_model import ErrorModel
from tests.robot_programs.written import rapid_pose

BASE = se3.pose(se3.exp(np.array([0.0, 0.0, 0.8])), np.array([0.4, -1.2, 0.9]))
TRACK = ExternalAxis(number=1, carries="robot", slides_along=np.array([0.0, 0.6, 0.8]))
TABLE = ExternalAxis(
    number=2, carries="part", turns_about=np.array([0.0, 0.0, 1.0]),
    T_frame=se3.pose(se3.exp(np.array([0.1, 0.2, 0.3])), np.array([1.5, 0.3, 0.4])), unit="STN1",
)  # fmt: skip
COARSE = Bounds(tolerance=1.0)


def program_of(poses, part, tool, *, external=(), unit="", conf="[0,0,0,0]"):
    """Motions to poses in a work object, in one posture; external axes by motion."""
    work_object = f'[FALSE,{"FALSE" if unit else "TRUE"},"{unit}",[[0,0,0],[1,0,0,0]],{rapid_pose(part)}]'
    lines = [
        "MODULE Part",
        f"PERS tooldata tMill:=[TRUE,{rapid_pose(tool)},[1,[0,0,1],[1,0,0,0],0,0,0]];",
        f"PERS wobjdata wPart:={work_object};",
        "PROC main()",
        "ConfJ\\Off; ConfL\\Off;",
    ]
    for i, T in enumerate(poses):
        axes = ["9E9"] * 6
        for k, value in (external[i] if external else {}).items():
            axes[k] = f"{value:g}"
        name = "MoveL" if i else "MoveJ"
        target = f"{rapid_pose(T)[:-1]},{conf},[{','.join(axes)}]]"
        lines.append(f"{name} {target},v50,z1,tMill\\WObj:=wPart;")
    return Source.of(Path("part.mod"), "\n".join([*lines, "ENDPROC", "ENDMODULE", ""]).encode())


@pytest.fixture
def corners(shifted):
    return [shifted(x, y, z) for x, y, z in ((0, 0, 0), (200, 0, 0), (200, 150, 20))]


@pytest.fixture
def conf(corners, robot):
    """The first target's posture, as RAPID states it."""
    return str(Confdata.of(robot, find_posture(ErrorModel(robot), corners[0])))


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


def test_line_along_which_a_track_moves_is_corrected_at_its_end(corners, part, robot, conf, calibration):
    """And the one after it begins where it ended."""
    stations, world = (0.0, 700.0, 700.0), BASE @ part
    travel = [se3.translation(*(TRACK.slides_along * s * 1e-3)) for s in stations]
    # targets that the robot reaches where the track then has it
    targets = [se3.inverse(world) @ T @ BASE @ corner for T, corner in zip(travel, corners, strict=True)]
    axes = [{0: s} for s in stations]
    program = read_rapid([program_of(targets, world, robot.T_flange_tool, conf=conf, external=axes)])
    cell = Cell(T_world_base=BASE, axes=(TRACK,))
    assert [move.follows for move in mount(program, cell).program.motions] == [None, None, 1]
    found = correct(calibration, program, cell=cell, bounds=COARSE)
    assert not found.rejected
    assert sum("an external axis moves robot or part along it" in str(d) for d in found.diagnostics) == 1


def test_a_part_on_a_positioner_is_measured_at_no_other_place(corners, part, robot, conf, calibration):
    targets = in_part(part, corners)
    program = read_rapid(
        [program_of(targets, part, robot.T_flange_tool, conf=conf, external=[{1: 35.0}] * 3, unit="stn1")]
    )
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


def test_a_track_of_which_a_krl_point_says_nothing_stays_where_it_was():
    point = "LIN {{X {},Y 0,Z 0,A 0,B 0,C 0{}}}".format
    lines = ["$TOOL=$NULLFRAME", "$BASE=$NULLFRAME", point(1, ",E1 0"), point(2, ",E1 700"), point(3, "")]
    program = read_krl([Source.of(Path("p.src"), "\n".join(["DEF P( )", *lines, "END", ""]).encode())])
    first, second, third = (move.part.T for move in mount(program, Cell(axes=(TRACK,))).program.motions)
    np.testing.assert_array_equal(third, second)
    np.testing.assert_allclose(second, se3.translation(*(-0.7 * TRACK.slides_along)) @ first)
    assert list(mount(program, Cell()).refused) == [1, 2]


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


# What external axes carry, against Pinocchio.


def random_pose(rng):
    return se3.pose(se3.exp(rng.uniform(-2, 2, 3)), rng.uniform(-2, 2, 3))


def random_axes(rng, carries):
    axes = []
    for number in range(1, 1 + int(rng.integers(1, 4))):
        direction = rng.normal(size=3)
        axes.append(
            ExternalAxis(
                number=number,
                carries=carries,
                **{("slides_along", "turns_about")[rng.integers(2)]: direction / np.linalg.norm(direction)},
                T_frame=random_pose(rng) if rng.integers(4) else None,
            )
        )
    return axes


def by_pinocchio(axes, positions):
    """Pose of the last axis' carriage: a chain of joints, each in the frame that the one before carries."""
    model, parent = pin.Model(), 0
    for axis in axes:
        turns = axis.turns_about is not None
        joint = (pin.JointModelRevoluteUnaligned if turns else pin.JointModelPrismaticUnaligned)(
            axis.turns_about if turns else axis.slides_along
        )
        frame = np.eye(4) if axis.T_frame is None else axis.T_frame
        parent = model.addJoint(parent, joint, pin.SE3(frame), f"axis{axis.number}")
    data = model.createData()
    q = [p * 1e-3 if axis.turns_about is None else np.radians(p) for axis, p in zip(axes, positions, strict=False)]
    pin.forwardKinematics(model, data, np.array(q))
    return data.oMi[parent].homogeneous


@pytest.mark.parametrize("seed", range(8))
def test_the_part_is_where_a_chain_of_joints_carries_it(seed):
    rng = np.random.default_rng(seed)
    axes, positions = random_axes(rng, "part"), rng.uniform(-500, 500, 6)
    np.testing.assert_allclose(carried_part(axes, positions), by_pinocchio(axes, positions), atol=1e-12)


@pytest.mark.parametrize("seed", range(8))
def test_the_robot_is_where_a_chain_of_joints_carries_it(seed):
    rng = np.random.default_rng(seed)
    axes, positions = random_axes(rng, "robot"), rng.uniform(-500, 500, 6)
    base = random_pose(rng)
    home = by_pinocchio(axes, np.zeros(6))
    expected = (
        by_pinocchio(axes, positions) @ se3.inverse(home) @ base
    )  # the base stays where it is on the last carriage
    np.testing.assert_allclose(carried_robot(axes, positions) @ base, expected, atol=1e-12)
