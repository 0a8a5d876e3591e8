"""Files as people and programs write them: read as they are meant, or refused, never taken for something else in silence."""

import time

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from taskcal.errors import FileError
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign, read_measurements
from tests.reading.known_campaign import BARE, DEG, JOINTS, MM, ROBOT, WXYZ, XYZ, N, P, Q, R, T, lines, write

ONE = np.ones((N, 1))
POSES = np.concatenate([R, MM[:, :, None]], axis=2)
NUMBERED = [f"p{k}" for k in range(N)]
ANGLES = Rotation.from_matrix(R).as_euler("ZYX", degrees=True)

READ = {
    "RoboDK": ([*BARE, "X", "Y", "Z"], lines(DEG, MM)),
    "nominal, measured, deviation": (
        ["Name", *(f"{w} {a}" for w in ("Nominal", "Measured", "Dev") for a in "XYZ"), *BARE],
        lines(NUMBERED, MM + 1, MM, 0 * MM + 1, DEG),
    ),
    "goal and measurement": (
        [*(f"Goal {a}" for a in "xyz"), *JOINTS, *(f"measurement_{a}_mm" for a in "xyz")],
        lines(P + 0.001, DEG, MM),
    ),
    "target and actual": (
        [*(f"{w}_{a}" for w in ("target", "actual") for a in "xyz"), *JOINTS],
        lines(MM + 0.5, MM, DEG),
    ),
    "tcp and tracker": ([*JOINTS, *(f"{w}_{a}_mm" for w in ("tcp", "tracker") for a in "xyz")], lines(DEG, MM + 3, MM)),
    "commanded and actual joints": (
        [*(f"{w}_{joint}" for w in ("cmd", "act") for joint in JOINTS), *XYZ],
        lines(DEG + 0.1, DEG, MM),
    ),
    "target and actual joints from zero": (
        [*(f"{w}_q_{k}" for w in ("target", "actual") for k in range(6)), *XYZ],
        lines(Q + 0.1, Q, MM),
    ),
    "matrix with its position": (
        [*JOINTS, *(f"T{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3, 4))],
        lines(DEG, POSES.reshape(N, 12)),
    ),
    "matrix of four rows from zero": (
        [*JOINTS, *(f"m{i}{j}" for i in range(4) for j in range(4))],
        lines(DEG, POSES.reshape(N, 12), 0 * ONE, 0 * ONE, 0 * ONE, ONE),
    ),
    "scalar first by name": ([*JOINTS, *XYZ, "qw", "qx", "qy", "qz"], lines(DEG, MM, WXYZ)),
    "KUKA": (["A1", "A2", "A3", "A4", "A5", "A6", "X", "Y", "Z", "A", "B", "C"], lines(DEG, MM, ANGLES)),
    "feet": ([*JOINTS, "X [ft]", "Y [ft]", "Z [ft]"], lines(DEG, P / 0.3048)),
    "yards": ([*JOINTS, "X [yd]", "Y [yd]", "Z [yd]"], lines(DEG, P / 0.9144)),
    "yards in the cells": (
        [*JOINTS, "X", "Y", "Z"],
        lines(DEG, np.char.add(np.char.mod("%.9f", P / 0.9144), " yards")),
    ),
    "gon": ([f"Achse {k} [gon]" for k in range(1, 7)] + XYZ, lines(DEG / 0.9, MM)),
    "units in a row": ([*BARE, "X", "Y", "Z"], ["deg,deg,deg,deg,deg,deg,mm,mm,mm", *lines(DEG, MM)]),
    "columns numbered from one": (None, ["1,2,3,4,5,6,7,8,9", *lines(DEG, MM)]),
    "columns numbered from zero": (None, ["0,1,2,3,4,5,6,7,8", *lines(DEG, MM)]),
    "mean and scatter below": (
        ["id", *JOINTS, *XYZ],
        [*lines(NUMBERED, DEG, MM), "Mean" + 9 * ",1", "Std. Dev." + 9 * ",2"],
    ),
    "an axis that stands still": ([*JOINTS, "E1", *XYZ], lines(DEG, 250.0 * ONE, MM)),
    "names again on each page": (
        [*JOINTS, *XYZ],
        [*lines(DEG, MM)[:5], ",".join([*JOINTS, *XYZ]), *lines(DEG, MM)[5:]],
    ),
    "an instrument's quaternion and its time": (
        ["Time", *JOINTS, *XYZ, "Q0", "Q1", "Q2", "Q3"],
        lines(np.arange(N) * 0.1, DEG, MM, WXYZ),
    ),
    "two comments": (["comment", *JOINTS, *XYZ, "comment"], lines(NUMBERED, DEG, MM, NUMBERED)),
}


@pytest.mark.parametrize("form", READ)
def test_what_was_measured_is_read(tmp_path, form):
    campaign = read_campaign(write(tmp_path, *READ[form]), ROBOT)
    assert len(campaign.targets) == 1
    np.testing.assert_allclose(campaign.q, Q, atol=1e-6)
    np.testing.assert_allclose(campaign.points[:, 0], P, atol=1e-6)
    if campaign.rotations is not None:
        np.testing.assert_allclose(campaign.rotations, R, atol=1e-6)


def test_poses_are_read_with_their_rotations(tmp_path):
    for form in ("matrix with its position", "matrix of four rows from zero", "scalar first by name", "KUKA"):
        assert read_measurements(write(tmp_path, *READ[form]), ROBOT).rotations is not None


def beyond(turned):
    out = turned.copy()
    out[4, 5] = 7.0
    return out


REFUSED = {
    "goals and differences": (
        [*(f"{a}_{w}" for w in ("t", "dif") for a in "xyz"), *(f"joint_{k}" for k in range(1, 7))],
        lines(MM, 0 * MM + 0.5, DEG),
        r"has goals \('x_t'\) and differences from them \('x_dif'\), not points",
    ),
    "units that contradict": (
        [*JOINTS, *XYZ],
        ["deg,deg,deg,deg,deg,deg,m,m,m", *lines(DEG, P)],
        "column 'x_mm': the name states mm, the row of units m",
    ),
    "radians as A B C": ([*JOINTS, *XYZ, "A", "B", "C"], lines(DEG, MM, np.radians(ANGLES)), "they may be radians"),
    "radians beyond a limit": (
        [*BARE, *XYZ],
        lines(beyond(Q), MM),
        r":6: column 'J1': the unit is not stated: as degrees",
    ),
    "an axis that moves": (
        [*JOINTS, "E1_mm", *XYZ],
        lines(DEG, np.arange(N) * 10.0, MM),
        "'E1_mm': is an axis that ur5 does not",
    ),
    "a seventh joint": (
        [*BARE, "J7", *XYZ],
        lines(DEG, np.arange(N) * 10.0, MM),
        "'J7': is an axis that ur5 does not have",
    ),
    "a second table": (
        ["id", *JOINTS],
        [*lines(NUMBERED, DEG), "", "id,x_mm,y_mm,z_mm", *lines(NUMBERED, MM)],
        r":15: names columns again \('id x_mm y_mm z_mm'\): a second table begins here",
    ),
    "what only the controller says": (
        [*JOINTS, *(f"ctrl_{a}_mm" for a in "xyz"), "cx_mm", "cy_mm", "cz_mm"],
        lines(DEG, MM, MM + 5),
        "names no target.*columns left out: ctrl_x_mm, ctrl_y_mm, ctrl_z_mm, cx_mm, cy_mm, cz_mm",
    ),
    "controller's positions beside a wire's length": (
        [*JOINTS, *XYZ, "L_mm"],
        lines(DEG, T[:, :3, 3] * 1e3, np.linalg.norm(T[:, :3, 3] - [1.5, 0.2, 0.1], axis=1) * 1e3),
        "positions of 'tool' are in the robot's own base, as the controller shows them, and 'L_mm' may be what was measured",
    ),
    "a sensor's sightings without what was seen": (
        [*JOINTS, *XYZ, *(f"sensor_{a}_mm" for a in "xyz")],
        lines(DEG, MM, MM),
        "column 'sensor_x_mm': what a sensor on the tool sees needs a column 'landmark'",
    ),
    "an uncertainty that is an angle": (
        [*JOINTS, *XYZ, "u_deg"],
        lines(DEG, MM, 0.5 * ONE),
        "column 'u_deg': 'deg' is not a unit of length",
    ),
    "an uncertainty without a unit beside metres": (
        [*JOINTS, "x_m", "y_m", "z_m", "u"],
        lines(DEG, P, 0.5 * ONE),
        "column 'u': the unit is not stated; name the column u_mm",
    ),
    "a sphere beside another target": (
        [*JOINTS, *XYZ, "sx_mm", "sy_mm", "sz_mm"],
        lines(DEG, MM, np.abs(MM) + 400.0),
        r"column 'sx_mm': [\d.]+ is not a standard uncertainty; give one named u_mm, or name the columns of a position",
    ),
    "a coordinate beyond any robot": (
        [*BARE, "X", "Y", "Z"],
        ["deg,deg,deg,deg,deg,deg,m,m,m", *lines(DEG, np.vstack([P[:-1], [[150.0, 0.0, 0.0]]]))],
        r"file\.csv:14: column 'X': '150' is beyond ±100",
    ),
    "positions twice": ([*JOINTS, *XYZ, *XYZ], lines(DEG, MM, MM + 1), "are both the x of one target"),
}


@pytest.mark.parametrize("form", REFUSED)
def test_what_cannot_be_meant_is_refused_and_named(tmp_path, form):
    header, rows, message = REFUSED[form]
    with pytest.raises(FileError, match=message):
        read_campaign(write(tmp_path, header, rows), ROBOT)


def test_what_is_left_out_is_said(tmp_path):
    def notes(form):
        return " ".join(read_campaign(write(tmp_path, *READ[form]), ROBOT).notes)

    assert "rows below the table are left out: Mean (line 14), Std. Dev. (line 15)" in notes("mean and scatter below")
    assert "line 1 numbers the columns, and is left out" in notes("columns numbered from one")
    assert "tcp_x_mm, tcp_y_mm, tcp_z_mm" in notes("tcp and tracker")


INSTRUMENTS = {
    "SpatialAnalyzer": ("// Units: mm\n// Collection, Group, Point, X, Y, Z\n", "A, Robot, P{k}, {x:.4f}, {y:.4f}, {z:.4f}"),
    "SpatialAnalyzer without names": ("", "A::Robot::P{k} {x:.4f} {y:.4f} {z:.4f}"),
    "PolyWorks": (
        "Object Name\tMeasured X\tMeasured Y\tMeasured Z\tNominal X\tNominal Y\tNominal Z\n",
        "point {k}\t{x:.4f}\t{y:.4f}\t{z:.4f}\t0\t0\t0",
    ),
    "Metrolog": ("METROLOG X4\nUnit: mm\n\nPoint;X act.;Y act.;Z act.;X nom.;Dev\n", "PT{k};{x:.4f};{y:.4f};{z:.4f};0;0"),
    "Leica": (
        "# Unit: mm, gon\nPointID  X  Y  Z  SigmaX  SigmaY  SigmaZ  Date\n",
        "{k}  {x:.4f}  {y:.4f}  {z:.4f}  0.011 0.012 0.010 2021-03-12",
    ),
    "CAM2": (
        "FARO CAM2 Measure 10\nUnits,mm\n\nLabel,Type,Actual X,Actual Y,Actual Z,Nominal X,Nominal Y,Nominal Z\n",
        "Point{k:03d},Point,{x:.4f},{y:.4f},{z:.4f},0,0,0",
    ),
    "Vicon": (
        "Trajectories\n100\n,,Arm:M1,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n",
        "{k},0,{x:.4f},{y:.4f},{z:.4f}",
    ),
}  # fmt: skip


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_points_of_an_instrument_join_the_joints(tmp_path, instrument):
    head, row = INSTRUMENTS[instrument]
    rows = [row.format(k=k, x=x, y=y, z=z) for k, (x, y, z) in enumerate(MM, start=1)]
    file = tmp_path / "points.txt"
    file.write_text(head + "\n".join(rows) + "\n")
    joints = write(tmp_path, ["id", *JOINTS], lines(np.arange(1, N + 1)[:, None], DEG))
    campaign = read_campaign(joints, ROBOT, options=ReadOptions(points=file))
    np.testing.assert_allclose(campaign.q, Q, atol=1e-6)
    np.testing.assert_allclose(campaign.points[:, 0], P, atol=1e-6)


def test_joints_that_a_ur_logs_are_radians(tmp_path):
    names = [f"actual_q_{k}" for k in range(6)]
    campaign = read_campaign(write(tmp_path, [*names, *XYZ], lines(Q, MM)), ROBOT)
    np.testing.assert_allclose(campaign.q, Q, atol=1e-5)
    assert campaign.notes == ()


@pytest.mark.parametrize(
    "content",
    [
        "x " * 250_000 + "_mm,y,z\n1,2,3\n4,5,6\n",
        "# a b c\n" * 120_000 + "1,2,3\n4,5,6\n",
        "c," * 100_000 + "\n" + "1," * 100_000,
    ],
    ids=["one long name", "many comments", "many columns"],
)
def test_a_megabyte_of_nonsense_is_refused_soon(tmp_path, content):
    path = tmp_path / "file.csv"
    path.write_text(content)
    begun = time.process_time()
    with pytest.raises(FileError):
        read_campaign(path, ROBOT)
    assert time.process_time() - begun < 2.0


def test_controllers_positions_are_taken_where_they_are_chosen(tmp_path):
    header, rows, _ = REFUSED["controller's positions beside a wire's length"]
    assert read_campaign(write(tmp_path, header, rows), ROBOT, targets=["tool"]).targets == ("tool",)


def test_ignored_numbers_are_reported_first(tmp_path):
    rows = lines(DEG, MM, np.arange(N) * 1.0)
    campaign = read_campaign(write(tmp_path, [*BARE, "X", "Y", "Z", "Probe"], rows), ROBOT)
    assert campaign.notes[0] == "column left out: Probe; measured: X, Y, Z"


def test_a_quaternion_of_an_instrument_is_no_set_of_joints(tmp_path):
    joints = write(tmp_path, JOINTS, lines(DEG)).rename(tmp_path / "joints.csv")
    points = write(tmp_path, ["Time", "X", "Y", "Z", "Q0", "Q1", "Q2", "Q3"], lines(np.arange(N) * 0.1, MM, WXYZ))
    campaign = read_campaign(joints, ROBOT, options=ReadOptions(points=points))
    np.testing.assert_allclose(campaign.rotations, R, atol=1e-6)


@pytest.mark.parametrize("bodies", [("Tool", "Base"), ("Base", "Tool"), ("Tool", "Part"), ("Part", "Tool")])
def test_each_rigid_body_keeps_its_own_quaternion(tmp_path, bodies):
    still = {"qw": ONE, **dict.fromkeys(("qx", "qy", "qz"), 0 * ONE)}
    turned = dict(zip(("qw", "qx", "qy", "qz"), WXYZ.T[:, :, None], strict=True))
    header, columns = [*JOINTS], [DEG]
    for body in bodies:
        header += [f"{body}_{part}" for part in ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")]
        columns += [MM if body == "Tool" else 0 * MM + 1, *(turned if body == "Tool" else still).values()]
    path = write(tmp_path, header, lines(*columns))
    campaign = read_campaign(path, ROBOT, targets=["Tool"])
    np.testing.assert_allclose(campaign.rotations, R, atol=1e-6)
    (other,) = {*bodies} - {"Tool"}
    assert f"rotations of {other} are left out" in campaign.notes
