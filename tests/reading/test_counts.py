"""Joints in pulses, encoder counts or turns: numbers that are no angles."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.cli.commands.doctor import diagnose_file
from taskcal.errors import FileError
from taskcal.reading.columns import MeasuredTable, meanings
from taskcal.reading.joints import joints_of
from taskcal.reading.reader import read_campaign
from taskcal.robot.catalogue import catalogue_names, load_robot
from taskcal.tables.table import Table
from tests.diagnosis.virtual_campaigns import healthy
from tests.laws.robots import seeds

REMEDY = "write degrees: each joint's number over that of a degree"


def _written(folder, robot, values, points, unit):
    path = folder / "measured.csv"
    names = [
        f"{joint}{'_mm' if slides else unit}" for joint, slides in zip(robot.joint_names, robot.prismatic, strict=True)
    ]
    lines = [",".join([*names, "x_mm", "y_mm", "z_mm"])]
    lines += [
        ",".join(f"{v:.6f}".removesuffix(".000000") for v in (*values[k], *points[k])) for k in range(len(values))
    ]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("unit", ["", "_deg", "_rad"])
@pytest.mark.parametrize("per_degree", [(40.0, 60.0), (800.0, 1800.0), (5000.0, 90_000.0)])
@pytest.mark.parametrize("name", ["motoman-sia20d", "abb-irb120", "ur5e"])
def test_counts_are_refused_as_what_they_are(tmp_path, name, per_degree, unit):
    """By the doctor, too, which has no other explanation of them; whatever unit is stated."""
    robot, sound = load_robot(name), healthy(name, 1)
    counts = np.degrees(sound.q) * np.random.default_rng(0).uniform(*per_degree, sound.q.shape[1])
    path = _written(tmp_path, robot, counts.round(), sound.points[:, 0] * 1e3, unit)
    for read in (lambda: read_campaign(path, robot), lambda: diagnose_file([path], robot)):
        with pytest.raises(FileError, match=f"no angles in degrees or radians: .*{REMEDY}") as refused:
            read()
        assert f"{np.abs(counts.round()).max():.0f}" in str(refused.value)


@pytest.mark.parametrize("unit", ["", "_deg"])
def test_few_counts_are_asked_for(tmp_path, unit):
    """A thousand for a turn are as degrees beyond the limits; as counts alone they are whole numbers."""
    robot, sound = load_robot("motoman-sia20d"), healthy("motoman-sia20d", 1)
    counts = np.round(np.degrees(sound.q) / 0.36)
    with pytest.raises(FileError, match=f"is outside -.* counts of an encoder, {REMEDY}"):
        read_campaign(_written(tmp_path, robot, counts, sound.points[:, 0] * 1e3, unit), robot)


@pytest.mark.parametrize("what", ["pulses", "counts", "ticks4096", "increments", "Inkremente", "steps"])
@pytest.mark.parametrize("spelled", ["{joint}_{what}", "{joint} [{what}]", "{joint} ({what})"])
def test_columns_of_counts_are_named(tmp_path, what, spelled):
    robot, sound = load_robot("abb-irb120"), healthy("abb-irb120", 1)
    unit = spelled.format(joint="", what=what)
    path = _written(tmp_path, robot, sound.q.round(), sound.points[:, 0] * 1e3, unit)
    with pytest.raises(FileError, match=r"J1.* holds counts, not an angle; write degrees: .* name it J1_deg"):
        read_campaign(path, robot)


@pytest.mark.parametrize("what", ["turns", "rev", "revolutions"])
def test_columns_of_turns_are_named(tmp_path, what):
    robot, sound = load_robot("abb-irb120"), healthy("abb-irb120", 1)
    path = _written(tmp_path, robot, sound.q / (2.0 * np.pi), sound.points[:, 0] * 1e3, f"_{what}")
    with pytest.raises(FileError, match="holds turns, not an angle; multiply it by 360, and name it J1_deg"):
        read_campaign(path, robot)


@given(name=st.sampled_from(catalogue_names()), seed=seeds)
def test_angles_that_controllers_show_are_no_counts(name, seed):
    """Up to two turns, with a wrong digit in one row, and whatever unit their columns state."""
    robot, rng = load_robot(name), np.random.default_rng(seed)
    degrees = rng.uniform(-720.0, 720.0, (30, len(robot.joints)))
    degrees[rng.integers(30)] *= 10.0
    header = tuple(f"q{j + 1}_{'mm' if slides else 'deg'}" for j, slides in enumerate(robot.prismatic))
    table = Table(
        path=Path("a.csv"),
        header=header,
        rows=tuple(tuple(map(repr, row)) for row in degrees.tolist()),
        lines=range(2, 32),
    )
    known = tuple(meanings(header, [""] * len(header), robot.joint_names))
    assert joints_of(MeasuredTable.of_table(table, robot, known))["q"].shape == degrees.shape
