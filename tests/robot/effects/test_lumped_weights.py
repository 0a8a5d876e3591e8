"""Weights that nobody knows."""

import numpy as np
import pytest

from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Compliance
from taskcal.robot.robot_file import robot_from


@pytest.mark.parametrize("name", ["ur5", "abb-irb6660-205-1.9"])
def test_lumped_weights_span_weights_at_the_joints(name):
    """Masses at the origins of joints 2 to 6: each lumped parameter is then compliance times weight."""
    description = load_robot(name).description
    joints = [
        {**j, "mass_kg": 10.0 * (i + 1), "centre_mm": [0.0, 0.0, 0.0]} for i, j in enumerate(description["joint"])
    ]
    robot = robot_from({**description, "joint": joints})
    q = np.random.default_rng(4).uniform([-1, -0.4, 0.1, -1, -1, -1], [1, 0.4, 0.6, 1, 1, 1], (40, 6))
    known, lumped = Compliance().term(robot), Compliance().term(load_robot(name))
    for j in range(6):
        own = [k for k, (c, p) in enumerate(lumped.pairs) if c == j and lumped.names[p].startswith(f"J{j + 1}.")]
        column = known.basis(q)[:, list(map(tuple, known.pairs)).index((j, j))]
        span = lumped.basis(q)[:, own]
        left = column - span @ np.linalg.lstsq(span, column, rcond=None)[0]
        assert np.linalg.norm(left) <= 1e-9 + 1e-6 * np.linalg.norm(column)
