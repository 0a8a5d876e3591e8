"""The sentences about two calibrations, one for each verdict."""

import numpy as np
import pytest

from taskcal.identification.comparison import ChangedParameter, Comparison, Resemblance
from taskcal.report.comparison import (
    describe_chance,
    describe_comparison,
    describe_due,
    describe_resemblance,
    tabulate_changes,
)
from taskcal.robot.parameter import ShownUnit

MRAD, MM = ShownUnit("mrad", 1e3), ShownUnit("mm", 1e3)


def compared(chance: float, unexplained: float) -> Comparison:
    """Points that moved by 0.5 mm, 0.4 mm of them beyond what is uncertain."""
    return Comparison(
        q=np.zeros((2, 6)),
        difference=np.tile([3e-4, 0.0, 4e-4], (2, 1, 1)),
        expected=3e-4,
        chance=chance,
        unexplained=unexplained,
        parameters=(
            ChangedParameter(name="J2.rz", unit=MRAD, first=1e-3, second=2e-3, standard_error=1e-4),
            ChangedParameter(name="J3.tx", unit=MM, first=1e-4, second=2e-4, standard_error=1e-4),
        ),
        resembles=(Resemblance(name="J2.rz", unit=MRAD, amount=-9e-4, share=0.875),),
    )


UNCHANGED, SMALL, CHANGED = compared(0.3, 0.0), compared(0.001, 4.5e-4), compared(0.001, 3.5e-4)


@pytest.mark.parametrize(
    ("comparison", "words"),
    [
        (UNCHANGED, "no significant change: 3D rms difference 0.500 mm, expected from the uncertainties 0.300 mm"),
        (SMALL, "small change: 3D rms difference 0.500 mm, significant (expected 0.300 mm), but smaller than the model error"),
        (CHANGED, "the robot has changed: 3D rms difference 0.500 mm, expected from the uncertainties 0.300 mm"),
    ],
    ids=["unchanged", "small", "changed"],
)  # fmt: skip
def test_describe_comparison_states_its_figures(comparison, words):
    assert describe_comparison(comparison).startswith(words)


@pytest.mark.parametrize(
    ("comparison", "accuracy", "words"),
    [
        (UNCHANGED, 1e-4, "no: no significant change against 0.1 mm"),
        (CHANGED, 3e-4, "yes: change 0.400 mm rms exceeds 0.3 mm; use the new calibration"),
        (CHANGED, 5e-4, "no: change 0.400 mm rms is within 0.5 mm"),
        (SMALL, 5e-4, "no: change 0.400 mm rms is within 0.5 mm"),
    ],
)
def test_describe_due_compares_with_the_accuracy(comparison, accuracy, words):
    assert describe_due(comparison, accuracy) == words


def test_changes_are_in_the_parameters_units():
    assert describe_resemblance(CHANGED) == "J2.rz by -0.900 mrad would explain 88 % of it"
    assert tabulate_changes(CHANGED).rows == (("J2.rz", "+1.0000", "+2.0000", "+1.0000", "mrad", "+10.0"),)
    assert [row[0] for row in tabulate_changes(CHANGED, None).rows] == ["J2.rz", "J3.tx"]


@pytest.mark.parametrize(
    ("chance", "said"),
    [
        (0.0, "< 0.001"),
        (1.6e-146, "< 0.001"),
        (0.00099, "< 0.001"),
        (0.001, "= 0.001"),
        (0.994, "= 0.99"),
        (0.9999, "> 0.99"),
    ],
)
def test_describe_chance_gives_a_bound_if_nearly_0_or_1(chance: float, said: str) -> None:
    assert describe_chance(compared(chance, 0.0)).endswith(f"p (no change) {said}")
