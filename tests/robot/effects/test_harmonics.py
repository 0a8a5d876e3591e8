"""Gears and encoders that err with the joint's own angle."""

import numpy as np
import pytest
from hypothesis import given

from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel
from tests.laws.robots import generators

UR5 = load_robot("ur5")


@given(generators)
def test_harmonics_are_cosines_and_sines_of_the_angle(rng: np.random.Generator) -> None:
    """A joint errs by a cosine and a sine of multiples of its angle."""
    nominal = ErrorModel(UR5)
    model = nominal + Harmonics(orders=(1, 3), joints=(UR5.joint_names[1],))
    assert [name.partition(".")[2] for name in model.names[len(nominal) :]] == ["cos1", "sin1", "cos3", "sin3"]
    q, a = rng.uniform(-3.0, 3.0, (3, 6)), 1e-3 * rng.normal(size=4)
    turn = q[:, 1]
    wrong = q.copy()
    wrong[:, 1] += a @ [np.cos(turn), np.sin(turn), np.cos(3 * turn), np.sin(3 * turn)]
    x = np.concatenate([np.zeros(len(nominal)), a])
    np.testing.assert_allclose(model.poses(q, x), nominal.poses(wrong), atol=1e-12)


@pytest.mark.parametrize(
    ("text", "orders"),
    [("harmonics", (1, 2)), ("harmonics:3", (3,)), ("harmonics:1-4", (1, 2, 3, 4)), ("periodic", tuple(range(3, 31)))],
)
def test_orders_are_written_as_a_word_a_number_or_a_range(text: str, orders: tuple[int, ...]) -> None:
    effect = Harmonics.parse(text)
    assert effect is not None
    assert effect.orders == orders


@pytest.mark.parametrize("text", ["harmonics:0", "harmonics:4-1", "harmonics:1-999"])
def test_orders_that_do_not_exist_are_refused(text: str) -> None:
    with pytest.raises(TaskcalError, match="orders count periods in a turn; write harmonics:1-4"):
        Harmonics.parse(text)
