"""How many parameters can be told, against the formulas that are published for it.

Of R revolute and P sliding joints, tracker frame and tool included, 4R + 2P + 6 where the whole pose is measured (Everett,
Driels and Mooring 1987; Schröer, Albright and Grethlein 1997). A point tells nothing of how the tool is turned, and every point
has three coordinates of its own: 4R + 2P + 3k for k points on the tool, at least one of them off the last axis.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.analysis.identifiability import Identifiability, eliminate, identifiability
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import (
    generators,
    industrial,
    industrial_positions,
    irb6660_description,
    irb6660_positions,
    positions,
)

TARGETS = np.array([[0.05, 0.02, 0.1], [-0.06, 0.03, 0.07], [0.01, -0.08, 0.12]])
"""In the tool, metres."""


def of_targets(model: ErrorModel, q: np.ndarray, targets: np.ndarray) -> Identifiability:
    """Elimination of what points on the tool tell of the model, the tracker frame and the points themselves."""
    T, J, p, n = model.poses(q), model.jacobian(q), len(model), len(q)
    S = np.zeros((len(targets), n, 3, p + 6 + 3 * len(targets)))
    for k, target in enumerate(targets):
        lever = T[:, :3, :3] @ target
        S[k, :, :, :p] = se3.carry(J, lever)[:, :3]
        S[k, :, :, p : p + 6] = se3.by_twist(T[:, :3, 3] + lever)
        S[k, :, :, p + 6 + 3 * k : p + 9 + 3 * k] = T[:, :3, :3]
    columns = S.shape[-1]
    return eliminate(S.reshape(-1, columns), tuple(map(str, range(columns))), np.ones(columns), poses=n)


def count(found: Identifiability) -> int:
    """The rank, where all three ways to find it agree and it is clear."""
    assert found.agrees
    assert found.gap > 1e6
    return found.rank


def generic(rng: np.random.Generator, kinds: str) -> dict:
    """An arm of these joints with no axes parallel and none that meet."""
    size = lambda: float(rng.choice([-1.0, 1.0]) * rng.uniform(100, 500))  # noqa: E731
    joints = [
        {
            "name": f"J{i + 1}",
            "type": {"R": "revolute", "P": "prismatic"}[kind],
            "mdh": {"alpha_deg": float(rng.uniform(40, 140)), "a_mm": size(), "d_mm": size()},
        }
        for i, kind in enumerate(kinds)
    ]
    return {"name": kinds, "joint": joints, "tool": [{"tx_mm": 120.0}, {"tz_mm": 200.0}]}


@settings(max_examples=5)
@given(st.lists(st.sampled_from("RRP"), min_size=3, max_size=9).filter(lambda kinds: kinds.count("P") <= 3), generators)
def test_an_arm_of_any_joints_has_as_many_as_its_formula_says(kinds, rng):
    description = generic(rng, "".join(kinds))
    model, q = ErrorModel(robot_from(description)), positions(rng, description, 60)
    base = 4 * kinds.count("R") + 2 * kinds.count("P")
    assert count(identifiability(model, q, components="pose", frames=True)) == base + 6
    assert count(identifiability(model, q, frames=True)) == base + 3
    for k in (1, 2, 3):
        assert count(of_targets(model, q, TARGETS[:k])) == base + 3 * k


@pytest.mark.parametrize(("joints", "pose", "targets"), [("six", 30, (27, 30, 33)), ("seven", 34, (31, 34, 37))])
def test_six_axes_have_30_and_a_seventh_4_more(joints, pose, targets):
    """A six axis arm of usual build has thirty and a seventh axis four more."""
    rng = np.random.default_rng(0)
    description, q = industrial(rng), industrial_positions(rng, 80)
    if joints == "seven":  # an elbow that turns, as lightweight arms have
        elbow = {"name": "J0", "mdh": {"alpha_deg": 30.0, "a_mm": 150.0, "d_mm": 200.0}}
        description = {**description, "joint": [*description["joint"][:2], elbow, *description["joint"][2:]]}
        q = np.insert(q, 2, rng.uniform(-1.5, 1.5, len(q)), axis=1)
    model = ErrorModel(robot_from(description))
    assert count(identifiability(model, q, components="pose", frames=True)) == pose
    assert tuple(count(of_targets(model, q, TARGETS[:k])) for k in (1, 2, 3)) == targets


@pytest.mark.parametrize(
    ("loop", "more"), [({}, 2), ({"rod_mm": 730.0}, 3), (None, 0)], ids=["parallelogram", "other loop", "open chain"]
)
def test_parallelogram_adds_two_other_loops_three(loop, more):
    """A parallelogram's crank and rocker count as one."""
    description = irb6660_description()
    bar = description.pop("four_bar")
    if loop is not None:
        description["four_bar"] = {**bar, **loop}
    model, q = ErrorModel(robot_from(description)), irb6660_positions(np.random.default_rng(0), 80)
    assert count(identifiability(model, q, components="pose", frames=True)) == 30 + more
    assert [count(of_targets(model, q, TARGETS[:k])) - more for k in (1, 2, 3)] == [27, 30, 33]


def test_point_on_the_last_axis_loses_two():
    """One point on the last axis tells two less and beside another nothing less."""
    rng = np.random.default_rng(0)
    model = ErrorModel(robot_from({**industrial(rng), "tool": [{"tz_mm": 150.0}]}))
    q, on_axis = industrial_positions(rng, 80), np.zeros((1, 3))
    assert count(of_targets(model, q, TARGETS[:1])) == 27
    assert count(of_targets(model, q, on_axis)) == 25
    assert count(identifiability(model, q, frames=True)) == 25
    assert count(of_targets(model, q, np.concatenate([on_axis, TARGETS[:1]]))) == 30
