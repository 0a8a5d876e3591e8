"""Controllers that compute with kinematics of their own: a UR's as the factory measured them, written here by its table."""

import gzip
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from robot_programs.core.source import Source
from robot_programs.reading import parse_program
from taskcal.correction.cell import Cell, cell_text, load_cell
from taskcal.correction.controller import MAX_FACTORY_M, kinematics_apart, read_controller
from taskcal.correction.correct import correct
from taskcal.correction.verdict import judge
from taskcal.errors import FileError, TaskcalError
from taskcal.robot.catalogue import catalogue_names, load_robot
from tests.correction.by_pinocchio import COARSE, TOOL, defective
from tests.laws.plain import product, shift, turn
from tests.robot_programs.written import urscript_pose

HOME = np.radians([10.0, -70.0, 90.0, -100.0, -80.0, 20.0])
KEYS = {"theta": 2e-3, "a": 5e-4, "d": 5e-4, "alpha": 1e-3}
"""What a factory finds, radians and metres."""


@pytest.fixture(scope="module")
def ur5():
    calibration, _, _ = defective("ur5", HOME)
    return calibration


def nominal_table(robot):
    joints = [joint["dh"] for joint in robot.description["joint"]]
    return {
        "theta": np.zeros(6),
        "a": np.array([row.get("a_mm", 0.0) for row in joints]) * 1e-3,
        "d": np.array([row.get("d_mm", 0.0) for row in joints]) * 1e-3,
        "alpha": np.radians([row.get("alpha_deg", 0.0) for row in joints]),
    }


def deltas(rng):
    return {key: rng.normal(0.0, size, 6) for key, size in KEYS.items()}


def flange(table, q):
    """Flange of an arm by its table (Denavit and Hartenberg)."""
    rows = zip(q + table["theta"], table["d"], table["a"], table["alpha"], strict=True)
    return product([part for t, d, a, alpha in rows for part in (turn(2, t), shift(2, d), shift(0, a), turn(0, alpha))])


def driven(table, T, near):
    """Joints at which such an arm's flange is at a pose."""

    def off(q):
        E = np.linalg.inv(T) @ flange(table, q)
        return np.r_[E[:3, 3], Rotation.from_matrix(E[:3, :3]).as_rotvec()]

    found = least_squares(off, near, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert np.abs(found.fun).max() < 1e-9
    return found.x


def listed(values):
    return ", ".join(repr(float(v)) for v in values)


def write_file(folder, suffix, nominal, found, status="LINEARIZED"):
    """The factory's file: calibration.conf has what is added to the nominal table, a program of PolyScope has all."""
    if suffix == ".conf":
        path = folder / "calibration.conf"
        path.write_text("[mounting]\n" + "".join(f"delta_{key} = [ {listed(found[key])}]\n" for key in KEYS))
        return path
    path, names = folder / "p.urp", {"theta": "deltaTheta"}
    rows = "".join(f'<{names.get(key, key)} value="{listed(nominal[key] + found[key])}"/>\n' for key in KEYS)
    inside = f'<kinematics status="{status}" validChecksum="true">\n{rows}</kinematics><children/>'
    path.write_bytes(gzip.compress(f'<?xml version="1.0"?><URProgram name="p">{inside}</URProgram>'.encode()))
    return path


def read(robot, poses, name="p.script"):
    lines = [
        f"set_tcp({urscript_pose(TOOL)})",
        f"movej([{listed(HOME)}])",
        *(f"movel({urscript_pose(T)}, v=0.1)" for T in poses),
    ]
    text = "def p():\n" + "".join(f"  {line}\n" for line in lines) + "end\n"
    return parse_program((Source.of(Path(name), text.encode()),), robot=robot)


@pytest.mark.parametrize("suffix", [".conf", ".urp"])
@pytest.mark.parametrize("seed", range(3))
def test_its_own_kinematics_drive_the_true_tool_where_the_program_wants_it(suffix, seed, ur5, tmp_path):
    rng, robot = np.random.default_rng(seed), ur5.model.robot
    nominal, found = nominal_table(robot), deltas(rng)
    table = {key: nominal[key] + found[key] for key in KEYS}
    path = write_file(tmp_path, suffix, nominal, found)
    controller = read_controller(path, robot)
    start = flange(table, HOME) @ TOOL
    wanted = [
        start
        @ product([shift(axis, rng.uniform(-0.05, 0.05)) for axis in range(3)])
        @ product([turn(axis, rng.uniform(-0.1, 0.1)) for axis in range(3)])
        for _ in range(5)
    ]
    off = {}
    for name, given in {"own": controller, "assumed": None}.items():
        read_by = robot if given is None else given
        program = read(read_by, wanted)
        out = correct(ur5, program, bounds=COARSE, controller=given)
        assert not out.rejected
        again = parse_program(out.sources, robot=read_by)
        q = [driven(table, move.end.T @ np.linalg.inv(TOOL), HOME) for move in again.motions[1:]]
        true = ur5.tool_in_base(np.array(q)) @ np.linalg.inv(robot.T_flange_tool) @ TOOL
        off[name] = np.linalg.norm(true[:, :3, 3] - np.array(wanted)[:, :3, 3], axis=1)
        assert [path.name in said for said in out.statements] == [
            *([False] * (len(out.statements) - 1)),
            given is not None,
        ]
    assert off["own"].max() < 1e-6
    assert off["assumed"].min() > 2e-4


@pytest.mark.parametrize("name", [name for name in catalogue_names() if name.startswith("ur")])
@pytest.mark.parametrize("suffix", [".conf", ".urp"])
def test_it_is_known_again_for_its_own_arm_and_refused_for_any_other(name, suffix, tmp_path):
    robot, found = load_robot(name), deltas(np.random.default_rng(1))
    path = write_file(tmp_path, suffix, nominal_table(robot), found)
    own = read_controller(path, robot)
    table = {key: nominal_table(robot)[key] + found[key] for key in KEYS}
    q = HOME + 0.3
    np.testing.assert_allclose(
        own.tool_poses(q[None])[0] @ np.linalg.inv(own.T_flange_tool), flange(table, q), atol=1e-9
    )
    assert 0.0 < kinematics_apart(robot, own) < MAX_FACTORY_M
    assert kinematics_apart(own, read_controller(path, own)) < 1e-9  # deltas are not added twice
    for other in set(catalogue_names()) - {name}:
        if suffix == ".urp" or not other.startswith("ur"):  # deltas alone do not tell the type
            with pytest.raises(FileError, match=f"is not of a {other}|the calibration is of {other}"):
                read_controller(path, load_robot(other))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda text: text.replace("LINEARIZED", "NOT_INITIALIZED"), "'NOT_INITIALIZED'"),
        (lambda text: text.replace("<alpha", "<beta"), "no whole table"),
        (lambda text: text.replace("kinematics", "children"), "states no kinematics"),
        (lambda text: text.replace('"0.0, ', '"', 1), "has 5 numbers"),
        (lambda text: text.replace('"0.0, ', '"x, ', 1), "'x' is not a number"),
    ],
)
def test_a_program_that_does_not_state_them_is_refused(change, message, tmp_path):
    robot = load_robot("ur5e")
    zero = {key: np.zeros(6) for key in KEYS}
    path = write_file(tmp_path, ".urp", nominal_table(robot), zero)
    path.write_bytes(gzip.compress(change(gzip.decompress(path.read_bytes()).decode()).encode()))
    with pytest.raises(FileError, match=message):
        read_controller(path, robot)
    path.write_bytes(b"URProgram")
    with pytest.raises(FileError, match="not packed"):
        read_controller(path, robot)


def test_what_is_not_stated_is_asked_and_never_met(ur5):
    """A UR's controller has kinematics of its own: unless something says with which it computes, no verdict is known."""
    program = read(ur5.model.robot, [flange(nominal_table(ur5.model.robot), HOME + 0.05) @ TOOL])
    for cell in (Cell(), Cell(controller="nominal")):
        found = correct(ur5, program, cell=cell, bounds=COARSE, accept_uncertain=True)
        reasons = [reason.why for reason in judge(ur5, None, found, cell).judgements[2].reasons]
        unstated = not cell.controller
        assert ("the controller's kinematics are not stated" in reasons) == unstated
        assert any("--controller-kinematics" in one.text for one in found.diagnostics) == unstated
        assert ("assumed" in found.statements[-1]) == unstated
        assert ("stated" in found.statements[-1]) != unstated


def test_statements_that_contradict_are_refused(ur5, tmp_path):
    robot = ur5.model.robot
    program = read(robot, [])
    own = read_controller(write_file(tmp_path, ".urp", nominal_table(robot), deltas(np.random.default_rng(0))), robot)
    with pytest.raises(TaskcalError, match="not known here"):
        correct(ur5, program, cell=Cell(controller="calibrated"))
    with pytest.raises(TaskcalError, match="keep one of them"):
        correct(ur5, program, cell=Cell(controller="nominal"), controller=own)
    with pytest.raises(TaskcalError, match="--helper: its module computes with the robot file"):
        correct(ur5, program, controller=own, helper=True)
    with pytest.raises(TaskcalError, match="has 7 joints"):
        correct(ur5, program, controller=load_robot("franka-panda"))


@pytest.mark.parametrize("controller", ["", "nominal", "calibrated"])
@pytest.mark.parametrize("base", [None, np.eye(4)])
def test_the_cell_file_keeps_the_controller(controller, base, tmp_path):
    cell = replace(Cell(), controller=controller, T_world_base=base)
    path = tmp_path / "cell.toml"
    path.write_text(cell_text(cell))
    again = load_cell(path)
    assert again.controller == controller
    assert (again.T_world_base is None) == (base is None)
