"""The figures of a corrected program."""

from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from taskcal.correction.correct import correct
from taskcal.identification.identify import identify
from taskcal.measurement.virtual_cell import simulate
from taskcal.presentation.correction_figures import draw_program
from taskcal.programs.apt.read import read_apt
from taskcal.programs.program import Frame
from taskcal.programs.source import Source
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel

PLANAR = b"""GOTO/350,0,300,0,0,1
GOTO/400,0,300
CIRCLE/400,10,300,0,0,1,10
GOTO/410,10,300
GOTO/410,60,300
"""


@pytest.fixture(scope="module")
def figure() -> go.Figure:
    robot = load_robot("abb-irb120")
    model = ErrorModel(robot)
    q = np.random.default_rng(3).uniform(*0.5 * robot.limits.T, size=(30, 6))
    calibration = identify(model, simulate(model, q, rng=np.random.default_rng(4))[0])
    tool, part = Frame(name="mill", T=robot.T_flange_tool), Frame(name="vice", T=np.eye(4))
    return draw_program(correct(calibration, read_apt([Source.of(Path("flat.apt"), PLANAR)], tool=tool, part=part)))


def test_every_target_is_drawn_also_where_its_way_is_not_known(figure: go.Figure) -> None:
    (trace,) = figure.data
    drawn = np.stack([trace.x, trace.y, trace.z], axis=1)
    assert np.isfinite(drawn).all()
    for point in ([350, 0, 300], [400, 0, 300], [410, 60, 300]):
        assert np.abs(drawn - point).max(axis=1).min() < 1e-6


def test_a_planar_program_has_depth_enough_to_be_seen(figure: go.Figure) -> None:
    """Scenes drawn to scale vanish where an axis has no extent."""
    scene, trace = figure.layout.scene, figure.data[0]
    for axis, values in ((scene.xaxis, trace.x), (scene.yaxis, trace.y), (scene.zaxis, trace.z)):
        low, high = axis.range
        assert high - low >= 10.0
        assert low < min(values) <= max(values) < high
