"""Where tools and parts are: from the robot's tool to the program's and back, whatever the robot holds."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from taskcal.correction.path import Placed, Placement
from taskcal.geometry import se3
from tests.laws.robots import generators


def poses(rng: np.random.Generator, n: int) -> np.ndarray:
    return se3.pose(se3.exp(rng.normal(size=(n, 3))), rng.normal(size=(n, 3)))


def placement(rng: np.random.Generator, part_in_hand: bool) -> Placement:
    grasped, fixed = poses(rng, 2)
    return Placement(T_tool_grasped=grasped, T_base_fixed=fixed, part_in_hand=part_in_hand)


@given(generators, st.booleans())
def test_the_robot_s_tool_is_the_inverse_of_the_program_s(rng, part_in_hand):
    one, T = placement(rng, part_in_hand), poses(rng, 5)
    np.testing.assert_allclose(one.tool_in_part(one.robot_tool(T)), T, atol=1e-12)
    # on the path of both frames round the loop: base to fixed to grasped is base to tool to grasped
    X = se3.inverse(T) if part_in_hand else T
    np.testing.assert_allclose(one.T_base_fixed @ X, one.robot_tool(T) @ one.T_tool_grasped, atol=1e-12)


@given(generators)
def test_each_motion_has_the_placement_of_its_number(rng):
    both = placement(rng, False), placement(rng, True)
    B = poses(rng, 6)
    placed = Placed(tool_in_base=lambda q, move, share: B[move], placements=both, number=np.array([0, 1, 1, 0, 0, 1]))
    move = rng.permutation(6)
    T = placed.tool_in_part(move, np.ones(6), np.zeros((6, 6)))
    for k, i in enumerate(move):
        np.testing.assert_allclose(T[k], both[placed.number[i]].tool_in_part(B[i][None])[0], atol=1e-12)
    np.testing.assert_allclose(placed.robot_tool(move, T), B[move], atol=1e-12)
