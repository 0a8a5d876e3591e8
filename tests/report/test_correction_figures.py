"""The figures of a corrected program."""

from pathlib import Path

import numpy as np
import pytest

from robot_programs.apt.read import read_apt
from robot_programs.core.program import Frame
from robot_programs.core.source import Source
from taskcal.correction.correct import correct
from taskcal.identification.identify import identify
from taskcal.report.content import Scene
from taskcal.report.correction import draw_program
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

PLANAR = b"""GOTO/350,0,300,0,0,1
GOTO/400,0,300
CIRCLE/400,10,300,0,0,1,10
GOTO/410,10,300
GOTO/410,60,300
"""


@pytest.fixture(scope="module")
def scene() -> Scene:
    robot = load_robot("abb-irb120")
    model = ErrorModel(robot)
    q = np.random.default_rng(3).uniform(*0.5 * robot.limits.T, size=(30, 6))
    calibration = identify(model, simulate(model, q, rng=np.random.default_rng(4))[0])
    tool, part = Frame(name="mill", T=robot.T_flange_tool), Frame(name="vice", T=np.eye(4))
    return draw_program(correct(calibration, read_apt([Source.of(Path("flat.apt"), PLANAR)], tool=tool, part=part)))


def test_every_target_is_drawn_also_where_its_way_is_not_known(scene: Scene) -> None:
    _, layer = scene.layers
    drawn = np.array(layer["at"])
    assert np.isfinite(drawn).all()
    for point in ([350, 0, 300], [400, 0, 300], [410, 60, 300]):
        assert np.abs(drawn - point).max(axis=1).min() < 0.051


def test_its_colours_and_words_are_the_errors(scene: Scene) -> None:
    _, layer = scene.layers
    values = np.array(layer["values"])
    assert (layer["least"], layer["most"]) == (0.0, pytest.approx(values.max(), abs=1e-5))
    assert all(f"{value:.3f} mm" in tip for value, tip in zip(values, layer["tips"], strict=True))
    assert f"bright {values.max():.3f} mm" in layer["label"]
