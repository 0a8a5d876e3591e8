"""Tables of dimensions as their makers print them: parts of π, sums, joints by their letters, a flange without a joint."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import FileError
from taskcal.geometry import se3
from taskcal.robot.catalogue import describe_robot, load_robot
from taskcal.robot.importers.dh import read_dh_table
from tests.laws.robots import generators

UR = """Kinematics\ttheta [rad]\ta [m]\td [m]\talpha [rad]\tDynamics\tMass [kg]\tCenter of Mass [m]
Joint 1\t0\t0\t0.1625\tπ/2\tLink 1\t3.761\t[0, -0.02561, 0.00193]
Joint 2\t0\t-0.425\t0\t0\tLink 2\t8.058\t[0.2125, 0, 0.11336]
Joint 3\t0\t-0.3922\t0\t0\tLink 3\t2.846\t[0.15, 0.0, 0.0265]
Joint 4\t0\t0\t0.1333\tπ/2\tLink 4\t1.37\t[0, -0.0018, 0.01634]
Joint 5\t0\t0\t0.0997\t-π/2\tLink 5\t1.3\t[0, 0.0018, 0.01634]
Joint 6\t0\t0\t0.0996\t0\tLink 6\t0.365\t[0, 0, -0.001159]
"""
"""Universal Robots, DH parameters of the UR5e."""

FRANKA = """Joint,a (m),d (m),α (rad),θ (rad)
Joint 1,0,0.333,0,θ1
Joint 2,0,0,−π/2,θ2
Joint 3,0,0.316,π/2,θ3
Joint 4,0.0825,0,π/2,θ4
Joint 5,−0.0825,0.384,−π/2,θ5
Joint 6,0,0,π/2,θ6
Joint 7,0.088,0,π/2,θ7
Flange,0,0.107,0,0
"""
"""Franka, Denavit–Hartenberg parameters of the Panda."""


def _written(folder, text, name="arm.csv"):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "file", "convention", "name"),
    [(UR, "ur.tsv", "dh", "ur5e"), (UR, "ur.txt", "dh", "ur5e"), (FRANKA, "panda.csv", "mdh", "franka-panda")],
)
def test_printed_tables_are_the_robots_of_the_catalogue(tmp_path, text, file, convention, name):
    robot, own = read_dh_table(_written(tmp_path, text, file), convention), load_robot(name)
    assert robot.joint_names == own.joint_names
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (20, len(own.joints)))
    np.testing.assert_allclose(robot.tool_poses(q), own.tool_poses(q), atol=1e-12)
    np.testing.assert_allclose(robot.T_flange_tool, own.T_flange_tool, atol=1e-12)
    assert describe_robot(tmp_path / file, convention=convention)["joint"]


def _spelled(rng, value):
    """A number as a maker may print it, and what it is."""
    kind = rng.integers(4)
    if kind == 0 and value:
        part = round(value * float(rng.uniform(0.1, 0.9)), 4)
        return f"{part:g} + {value - part:.6g}".replace("+ -", "- "), part + float(f"{value - part:.6g}")
    if kind == 1:
        return f"{value:.6g}".replace("-", "−"), float(f"{value:.6g}")
    return f"{value:.6g}", float(f"{value:.6g}")


def _angle(rng):
    """A multiple of a quarter or sixth of π as a maker may print it, and what it is in radians."""
    top, part = int(rng.integers(-3, 4)), int(rng.choice([2, 3, 4, 6]))
    top, part = (top, part) if rng.random() < 0.8 else (int(np.sign(top)), 1)
    letter = str(rng.choice(["π", "pi", "PI"]))
    number = {0: "0", 1: letter, -1: f"-{letter}"}.get(
        top, f"{top}{letter}" if rng.random() < 0.5 else f"{top}*{letter}"
    )
    return (number if part == 1 or top == 0 else f"{number}/{part}").replace(
        "-", str(rng.choice(["-", "−"]))
    ), top * np.pi / part


def _dh(theta, d, a, alpha):
    return se3.rotation("z", theta) @ se3.translation(0, 0, d) @ se3.translation(a, 0, 0) @ se3.rotation("x", alpha)


def _mdh(theta, d, a, alpha):
    return se3.rotation("x", alpha) @ se3.translation(a, 0, 0) @ se3.rotation("z", theta) @ se3.translation(0, 0, d)


@given(generators)
def test_random_printed_tables_have_the_poses_that_they_state(tmp_path_factory, rng):
    """The poses are multiplied here, of what is written; rows called Flange, or with a number for θ, have no joint."""
    convention, joints, fixed = str(rng.choice(["dh", "mdh"])), int(rng.integers(2, 8)), int(rng.integers(0, 3))
    separator, letter = str(rng.choice([",", "\t", ";"])), str(rng.choice(["θ", "q", "theta_"]))
    by_letter, beside = bool(rng.random() < 0.6), bool(rng.random() < 0.4)
    header = ["Joint", "a [m]", "d [m]", "α [rad]", "θ [rad]", *(["offset [rad]"] if beside else [])]
    lines, rows = [header], []
    for i in range(joints + fixed):
        (a_text, a), (d_text, d) = (
            _spelled(rng, round(float(rng.choice([0.0, rng.uniform(-0.8, 0.8)])), 4)) for _ in "ad"
        )
        (alpha_text, alpha), (text, offset) = _angle(rng), _angle(rng)
        is_joint = i < joints
        name = f"{rng.choice(['Joint ', 'J', ''])}{i + 1}" if is_joint else ["Flange", "TCP"][i - joints]
        own = f"{letter}{i + 1}" if is_joint and by_letter else "0"
        if not beside:
            own = (
                text
                if own == "0"
                else own
                if text == "0"
                else f"{own} + {text}"
                if rng.random() < 0.5
                else f"{text} + {own}"
            )
            own = own.replace("+ -", "- ").replace("+ −", "− ")
        lines.append([name, a_text, d_text, alpha_text, own, *([text] if beside else [])])
        rows.append((is_joint, offset, d, a, alpha))
    if beside and not by_letter:  # two columns of numbers for one angle
        lines = [line[:4] + line[5:] for line in lines]
    path = tmp_path_factory.mktemp("dh") / "arm.csv"
    path.write_text("\n".join(separator.join(line) for line in lines) + "\n", encoding="utf-8")
    robot = read_dh_table(path, convention)
    assert len(robot.joints) == joints
    q = rng.uniform(-3.0, 3.0, (3, joints))
    for angles, pose in zip(q, robot.tool_poses(q), strict=True):
        expected, left = np.eye(4), iter(angles)
        for is_joint, offset, d, a, alpha in rows:
            theta = offset + (next(left) if is_joint else 0.0)
            expected = expected @ (_dh if convention == "dh" else _mdh)(theta, d, a, alpha)
        np.testing.assert_allclose(pose, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("row", "why"),
    [
        ("Joint 7,0.088,0,π/2,0", "'Joint 7' is neither clearly a joint nor clearly a fixed part"),
        ("Flange,0.088,0,π/2,θ7", "'Flange' is neither clearly a joint nor clearly a fixed part"),
        ("Joint 7,0.088,0,π/2,θ5", "not numbered in the order of the rows"),
        ("Joint 7,0.088,0,π/2,-θ7", "'Joint 7' is neither clearly a joint"),
        ("Joint 7,0.088,0,2 3,θ7", "'2 3' is not a number"),
        ("Joint 7,0.088,0,π/0,θ7", "'π/0' is not a number"),
        ("Joint 7,0.088,0,2**3,θ7", "'2\\*\\*3' is not a number"),
        ("Joint 7,0.088,0,tau/4,θ7", "'tau/4' is not a number"),
    ],
)
def test_rows_that_are_not_clear_are_refused_by_name(tmp_path, row, why):
    own = "Joint 7,0.088,0,π/2,θ7"
    assert own in FRANKA
    with pytest.raises(FileError, match=why):
        read_dh_table(_written(tmp_path, FRANKA.replace(own, row)), "mdh")


def test_named_rows_beside_numbered_ones_are_refused_by_name(tmp_path):
    text = "joint,alpha_deg,a_mm,d_mm,theta_offset_deg\n1,90,0,300,0\n2,0,400,0,0\nwrist,0,0,100,0\n"
    with pytest.raises(FileError, match="'wrist' is neither clearly a joint nor clearly a fixed part"):
        read_dh_table(_written(tmp_path, text), "dh")


def test_a_fixed_part_before_a_joint_is_refused_by_name(tmp_path):
    head, *rest = FRANKA.splitlines()
    with pytest.raises(FileError, match=r"arm\.csv:2: is a fixed part before a joint"):
        read_dh_table(_written(tmp_path, "\n".join([head, rest[-1], *rest[:-1]]) + "\n"), "mdh")


def test_parts_of_pi_are_no_degrees(tmp_path):
    for header in ("joint,alpha_deg,a_mm,d_mm,theta_offset_deg", "joint,alpha,a_mm,d_mm,theta"):
        text = f"{header}\n1,π/2,0,300,180\n2,0,400,0,90\n"
        with pytest.raises(FileError, match="'π/2' is in radians, and its column is read in degrees"):
            read_dh_table(_written(tmp_path, text), "dh")
