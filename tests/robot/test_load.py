"""What a robot carries, as files describe it."""

import numpy as np
import pytest

from taskcal.errors import TaskcalError
from taskcal.robot.effects import Compliance, effect_from
from taskcal.robot.statics import Load
from tests.robot.effects.loads import LOAD


def test_a_load_survives_its_description():
    for effect in (Compliance(load=LOAD), Compliance(joints=("J2",), load=Load(axes="tool", moment=(1.0, 2.0, 3.0)))):
        assert effect_from(effect.to_json()) == effect
    assert effect_from({"kind": "Compliance", "joints": None, "tolerance": 3e-4}) == Compliance()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"force": (1.0, 2.0)}, "force is .* three finite numbers"),
        ({"moment": (1.0, np.nan, 2.0)}, "moment is .* three finite numbers"),
        ({"mass": -1.0}, "mass is -1 kg"),
        ({"centre": (0.0, 0.0, 0.1)}, "a centre but no mass"),
        ({"axes": "flange"}, "axes are 'flange'; give 'base' or 'tool'"),
    ],
)
def test_what_is_no_load_is_refused(wrong, words):
    with pytest.raises(TaskcalError, match=words):
        Load(**wrong)
