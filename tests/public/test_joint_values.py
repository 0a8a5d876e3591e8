"""A table of joint values whose columns have names is nowhere taken by the places of its columns."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import taskcal as tc
from taskcal.errors import WrongValue
from taskcal.kinematics.inverse import solve_near
from tests.public import joint_values

NAMED = {
    "Calibration.predict_covariance(q)", "Calibration.predict_tool(q)", "Calibration.tool_covariance(q)", "ErrorModel.walk(q)",
    "ErrorModel.poses(q)", "Robot.inside_limits(q)", "solve_near(seed)", "simulate(q)", "plan(candidates)", "Campaign(q)",
    "MeasuredRange.of_rows(q)", "Thermal.participation(q)", "SocketInstrument.faults(q)", "Truth.points(q)", "locate_tool(q)",
}  # fmt: skip
"""Some of those that the walk must find."""


def test_no_public_function_takes_the_columns_of_a_table_by_their_places() -> None:
    """A data frame with the joints in another order is refused by its columns, before anything else is looked at."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-m", joint_values.__name__],
        capture_output=True,
        text=True,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert set(found) >= NAMED
    assert {name: ended for name, ended in found.items() if ended != "refused"} == {}


def test_tables_of_every_kind_are_refused_by_their_columns() -> None:
    """Columns with names of several levels, and a table of another library, are no numbers in order either."""
    arrow = pytest.importorskip("pyarrow")
    model = tc.ErrorModel(tc.load_robot("abb-irb120"))
    names = list(model.robot.joint_names[::-1])
    frame = pd.DataFrame(np.linspace(0.1, 0.6, 12).reshape(2, 6), columns=names)
    levels = frame.set_axis(pd.MultiIndex.from_product([["joints"], names]), axis="columns")
    for table in (levels, arrow.Table.from_pandas(frame)):
        for method in (model.poses, model.joint_jacobian):
            with pytest.raises(WrongValue, match=r"q is a data frame with the columns .*J6.*J5"):
                method(table)


def test_a_series_of_joints_is_refused_by_its_labels() -> None:
    """One posture, or several, with the joints in another order; without labels it counts as any numbers."""
    robot = tc.load_robot("abb-irb120")
    model = tc.ErrorModel(robot)
    series = pd.Series(np.linspace(0.1, 0.6, 6), index=robot.joint_names[::-1])
    T = model.poses(series.to_numpy()[None])[0]
    for call in (lambda: model.poses([series, series]), lambda: solve_near(model, T[None], [series])):
        with pytest.raises(WrongValue, match=r"is a series with the labels J6, J5.*series\[\[…\]\]\.to_numpy"):
            call()
    plain = series.reset_index(drop=True)
    assert np.array_equal(model.poses([plain])[0], T)


def test_a_table_is_refused_by_place_as_by_name_and_counts_without_names() -> None:
    robot = tc.load_robot("abb-irb120")
    model = tc.ErrorModel(robot)
    q = np.random.default_rng(0).uniform(-0.6, 0.6, (40, 6))
    campaign, _ = tc.simulate(model, q, rng=np.random.default_rng(0))
    calibration = tc.identify(model, campaign)
    turned = pd.DataFrame(q, columns=robot.joint_names)[list(robot.joint_names[::-1])]
    for method in (
        calibration.predict_covariance, calibration.predict_tool, calibration.tool_covariance, calibration.tool_in_base,
        calibration.tool_jacobian, calibration.target_poses, calibration.growth_at, model.joint_jacobian, robot.joint_frames,
        robot.inside_limits,
    ):  # fmt: skip
        with pytest.raises(WrongValue, match="q is a data frame with the columns J6, J5"):
            method(turned)
        expected = method(q)
        np.testing.assert_array_equal(method(pd.DataFrame(q)), expected)
        np.testing.assert_array_equal(method(q=q.tolist()), expected)
