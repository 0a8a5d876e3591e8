"""Corrected programs: the true tool goes where the program wants it, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest

from robot_programs.core.program import Frame
from robot_programs.reading import read_program
from taskcal.correction.cell import Cell, Measured
from taskcal.correction.correct import correct
from taskcal.correction.options import Bounds
from taskcal.errors import FileError, TaskcalError
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel

HEADER = "x_mm,y_mm,z_mm,qx,qy,qz,qw,speed_mm_s,move"


def write_path(path, poses, motions=None):
    """A path in CSV; the first row is a joint motion."""
    motions = motions or ["joint"] + ["linear"] * (len(poses) - 1)
    rows = [HEADER]
    for T, move in zip(poses, motions, strict=True):
        numbers = [*(T[:3, 3] * 1e3), *se3.to_quaternion(T[:3, :3])]
        rows.append(",".join(f"{value:.9f}" for value in numbers) + f",50,{move}")
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.fixture
def pocket(tmp_path, shifted):
    """A square of lines and an arc."""
    poses = [shifted(x, y, z) for x, y, z in ((0, 0, 0), (200, 0, 0), (200, 150, 20), (0, 150, 20), (0, 0, 0))]
    arc = [shifted(60, -60, 0), shifted(120, 0, 0)]
    return write_path(
        tmp_path / "pocket.csv", poses + arc, ["joint", "linear", "linear", "linear", "linear", "via", "circular"]
    )


def true_poses(calibration, motions, robot):
    """Where the true tool is at the targets of motions, by a solver of its own for the nominal robot."""
    from scipy.optimize import least_squares

    nominal, q = ErrorModel(robot), []
    seed = None
    for move in motions:
        T = move.flange(move.end.T) @ robot.T_flange_tool

        def error(at, T=T):
            found = nominal.poses(at[None])[0]
            return np.concatenate([found[:3, 3] - T[:3, 3], se3.log(found[:3, :3] @ T[:3, :3].T)])

        if seed is None:
            from taskcal.kinematics.inverse import find_posture

            seed = find_posture(nominal, T)
        seed = least_squares(error, seed, xtol=1e-15, ftol=1e-15, gtol=1e-15).x
        q.append(seed)
    return calibration.model.poses(np.array(q), calibration.estimate)


def test_the_true_tool_goes_to_the_targets(pocket, calibration, robot):
    program = read_program(pocket, robot=robot)
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    wanted = np.array([move.end.T for move in program.motions])
    before = true_poses(calibration, program.motions, robot)
    after = true_poses(calibration, found.motions, robot)
    assert np.linalg.norm(before[:, :3, 3] - wanted[:, :3, 3], axis=1).min() > 3e-4
    np.testing.assert_allclose(after[:, :3, 3], wanted[:, :3, 3], atol=2e-9)  # the file has 6 decimals of a millimetre
    turn = se3.log(after[:, :3, :3] @ np.swapaxes(wanted[:, :3, :3], 1, 2))
    np.testing.assert_allclose(turn, 0.0, atol=1e-8)
    # what the report says of it
    at = found.before.at_target
    np.testing.assert_allclose(found.before.error[at], before[:, :3, 3] - wanted[:, :3, 3], atol=1e-8)
    assert found.after.length[found.after.at_target].max() < 2e-9


def test_correction_is_the_negative_error_to_first_order(pocket, calibration, robot):
    """A correction is the error with the other sign to first order."""
    program = read_program(pocket, robot=robot)
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    moved = np.array(
        [new.end.T[:3, 3] - old.end.T[:3, 3] for old, new in zip(program.motions, found.motions, strict=True)]
    )
    error = found.before.error[found.before.at_target]
    np.testing.assert_allclose(moved, -error, atol=0.02 * np.abs(error).max())
    on_the_way = [
        np.linalg.norm(new.via.T[:3, 3] - old.via.T[:3, 3]) if old.via else 0.0
        for old, new in zip(program.motions, found.motions, strict=True)
    ]
    np.testing.assert_allclose(found.shift, np.maximum(np.linalg.norm(moved, axis=1), on_the_way), atol=2e-8)


def test_segments_are_divided_until_the_tool_keeps_to_them(pocket, calibration, robot):
    """Lines and arcs are cut until the true tool keeps to them."""
    program = read_program(pocket, robot=robot)
    coarse = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    between = coarse.after.length[~coarse.after.at_target].max()
    fine = correct(calibration, program, bounds=Bounds(tolerance=between / 10.0))
    assert len(fine.motions) > len(program.motions)
    assert fine.after.length[~fine.after.at_target].max() < between / 10.0 * 1.05
    assert fine.motions[-1].kind == "circular"
    assert [move.kind for move in coarse.motions] == [move.kind for move in program.motions]
    # a chord's deviation goes with the square of its length: no more pieces than that asks for
    assert fine.pieces.max() <= np.ceil(np.sqrt(10.0) * 1.1) + 1


def test_a_calibration_that_found_nothing_changes_no_byte(pocket, nominal, robot):
    program = read_program(pocket, robot=robot)
    found = correct(nominal, program)
    assert found.sources[0].encode() == pocket.read_bytes()
    assert not len(found.corrected)
    assert found.after.length.max() < 1e-9


def test_what_would_move_too_far_is_left_and_named(pocket, calibration, robot):
    program = read_program(pocket, robot=robot)
    found = correct(calibration, program, bounds=Bounds(shift=1e-6))
    assert found.sources[0].encode() == pocket.read_bytes()
    assert sorted(found.rejected) == list(range(len(program.motions)))
    assert "would move by" in found.rejected[0]
    turned = correct(calibration, program, bounds=Bounds(turn=1e-7))
    assert "would turn by" in turned.rejected[0]


def test_targets_out_of_reach_are_refused_alone(tmp_path, shifted, calibration, robot):
    """Targets out of reach are refused and the rest is corrected."""
    poses = [shifted(0, 0, 0), shifted(50, 0, 0), shifted(3000, 0, 0), shifted(0, 50, 0), shifted(0, 90, 0)]
    path = write_path(tmp_path / "far.csv", poses)
    found = correct(calibration, read_program(path, robot=robot))
    assert list(found.rejected) == [2]
    assert "out of reach" in found.rejected[2]
    assert sorted(found.corrected) == [0, 1, 3, 4]
    lines, old = found.sources[0].text.splitlines(), path.read_text().splitlines()
    assert old[3] in lines  # the line that is out of reach stays as it was
    assert found.targets()[2]["refused"]


def test_an_arc_that_stays_whole_keeps_its_point_on_the_way(pocket, calibration, robot):
    program = read_program(pocket, robot=robot)
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    moved = found.motions[-1].via.T[:3, 3] - program.motions[-1].via.T[:3, 3]
    assert np.linalg.norm(moved) < 1.2 * found.shift[-1]


def test_joint_positions_can_be_kept(tmp_path, calibration, robot):
    path = tmp_path / "joints.csv"
    path.write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,5,-40,10\n3,12,22,6,-42,12\n")
    program = read_program(path, robot=robot)
    assert len(correct(calibration, program).corrected) == 2
    kept = correct(calibration, program, keep_joints=True)
    assert kept.sources[0].encode() == path.read_bytes()
    assert not kept.rejected
    np.testing.assert_array_equal(kept.after.error, kept.before.error)


def test_files_are_written_beside_and_never_over_the_program(pocket, calibration, robot, tmp_path):
    found = correct(calibration, read_program(pocket, robot=robot))
    before = pocket.read_bytes()
    with pytest.raises(FileError, match="never overwritten"):
        found.write(pocket)
    with pytest.raises(FileError, match="never overwritten"):
        found.write(tmp_path)
    (tmp_path / "out").mkdir()
    assert found.write(tmp_path / "out") == (tmp_path / "out" / "pocket.csv",)
    assert found.write(tmp_path / "other.csv") == (tmp_path / "other.csv",)
    assert (tmp_path / "other.csv").read_bytes() == found.sources[0].encode() != before
    assert pocket.read_bytes() == before


def test_joint_speeds_are_those_of_the_jacobian(pocket, calibration, robot):
    """Along a line at constant speed, joint rates are J⁻¹ times the tool's velocity."""
    program = read_program(pocket, robot=robot)
    found = correct(calibration, program, bounds=Bounds(tolerance=1.0))
    nominal = ErrorModel(robot)
    largest = np.zeros(6)
    for first, second in zip(program.motions[:4], program.motions[1:5], strict=True):
        way = second.end.T[:3, 3] - first.end.T[:3, 3]
        velocity = np.concatenate([0.05 * way / np.linalg.norm(way), np.zeros(3)])
        rows = found.before.move == program.motions.index(second)
        J = nominal.joint_jacobian(found.before.q[rows])
        largest = np.maximum(
            largest, np.abs(np.linalg.solve(J, np.broadcast_to(velocity, (len(J), 6))[..., None])).max(0)[:, 0]
        )
    assert (found.motion.speed > 0.8 * largest - 1e-4).all()


def test_a_program_without_motions_is_an_error(tmp_path, calibration, robot):
    path = tmp_path / "none.csv"
    path.write_text(HEADER + ",tool\n1,2,3,0,0,0,1,50,joint,unknown\n")
    with pytest.raises(TaskcalError, match="unknown"):
        correct(calibration, read_program(path, robot=robot))


def test_an_arc_whose_start_is_not_known_stays_an_arc(calibration, robot, make_moves, shifted, tmp_path):
    """Its point on the way and its end are corrected one by one."""
    path = write_path(
        tmp_path / "arc.csv", [shifted(50, 50, 0), shifted(100, 0, 0), shifted(0, 0, 0)], ["via", "circular", "linear"]
    )
    program = read_program(path, robot=robot)
    found = correct(calibration, program)
    assert [move.kind for move in found.motions] == ["circular", "linear"]
    true = true_poses(calibration, [replace(m, end=m.via) for m in found.motions[:1]] + list(found.motions), robot)
    wanted = [program.motions[0].via.T, program.motions[0].end.T, program.motions[1].end.T]
    np.testing.assert_allclose(true[:, :3, 3], np.array(wanted)[:, :3, 3], atol=2e-9)
    assert "start point unknown" in str(found.diagnostics[0])


def test_misplaced_part_is_reported_as_a_large_shift(tmp_path, nominal, robot, shifted):
    """A part that is stated elsewhere is reported as a move too far."""
    path = write_path(tmp_path / "part.csv", [shifted(0, 0, 0), shifted(20, 0, 0)])
    table = Frame(name="table", T=np.eye(4))
    program = read_program(path, robot=robot, tool=Frame(name="spindle", T=robot.T_flange_tool), part=table)
    for offset in (50.0, 600.0):
        there = nominal.T_tracker_base @ se3.translation(x=offset * 1e-3)
        cell = Cell(parts={"table": Measured(name="table", in_tracker=there)})
        found = correct(nominal, program, cell=cell)
        assert set(found.rejected) == {0, 1}
        for why in found.rejected.values():
            assert "singular" not in why
            assert f"would move by {offset:.0f}" in why
            assert "cell file" in why


def test_swinging_joints_near_singular_are_refused(tmp_path, calibration, robot):
    """Joints that would swing near a singular posture are refused."""
    path = tmp_path / "wrist.csv"
    path.write_text("J1_deg,J2_deg,J3_deg,J4_deg,J5_deg,J6_deg\n0,10,20,0,-40,0\n0,10,20,0,0.05,0\n")
    found = correct(calibration, read_program(path, robot=robot))
    assert list(found.rejected) == [1]
    assert "would move a joint by" in found.rejected[1] or "singular" in found.rejected[1]
    assert path.read_text().splitlines()[2] in found.sources[0].text
    assert not correct(calibration, read_program(path, robot=robot), keep_joints=True).rejected


def test_undrivable_program_is_refused_by_line(tmp_path, calibration, robot, shifted):
    """A program of which nothing can be driven is refused line by line."""
    path = write_path(tmp_path / "far.csv", [shifted(9000, 0, 0), shifted(9100, 0, 0)])
    found = correct(calibration, read_program(path, robot=robot))
    assert sorted(found.rejected) == [0, 1]
    assert found.sources[0].encode() == path.read_bytes()
    assert not len(found.after.error)


def test_a_name_of_the_cell_that_no_motion_has_is_remarked(pocket, calibration, robot):
    cell = Cell(parts={"wobjx": Measured(name="wobjX", in_tracker=np.eye(4))})
    found = correct(calibration, read_program(pocket, robot=robot), cell=cell)
    assert "no motion has the cell's part 'wobjX'" in str(found.diagnostics[0])
