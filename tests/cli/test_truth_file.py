"""The truth of a virtual robot, written and read back."""

import json

import numpy as np
import pytest

from taskcal.cli.commands.simulate import read_truth, truth_text
from taskcal.errors import FileError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

TARGETS = {"a": np.array([0.1, 0.0, 0.05]), "b": np.array([-0.1, 0.08, 0.0])}


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return ErrorModel(load_robot("ur5"))


@pytest.fixture(scope="module")
def written(model):
    rng = np.random.default_rng(0)
    _, truth = simulate(model, rng.uniform(-1.0, 1.0, (5, 6)), rng=rng, targets=TARGETS)
    return truth, truth_text(truth, tuple(TARGETS))


def test_a_truth_reads_back_to_the_last_bit(model, written, tmp_path):
    truth, text = written
    path = tmp_path / "truth.json"
    path.write_text(text)
    known = read_truth(path, model)
    assert list(known.x) == list(model.names)
    np.testing.assert_array_equal([*known.x.values()], truth.x)
    np.testing.assert_array_equal(known.T_tracker_base, truth.T_tracker_base)
    assert list(known.targets) == list(TARGETS)
    np.testing.assert_array_equal([*known.targets.values()], truth.T_tool_target)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"robot": "ur10"}, "was simulated for ur10, not ur5"),
        ({"x": {}}, "differ in parameter"),
        ({"targets": {}}, "is not the truth of a simulated robot: targets: has no entries"),
        ({"T_tracker_base": [1.0]}, "robot: T_tracker_base 1: is not a list.*; make one with simulate --truth"),
        ({"x": None}, "is not the truth of a simulated robot: x: is not a table"),
    ],
)
def test_what_is_not_the_robots_truth_is_refused(model, written, tmp_path, change, message):
    path = tmp_path / "truth.json"
    path.write_text(json.dumps({**json.loads(written[1]), **change}))
    with pytest.raises(FileError, match=message):
        read_truth(path, model)
