"""Sets of poses: which are compared with which, and in which cycles."""

import numpy as np
import pytest

from taskcal.campaigns.performance import PoseCycles, assess_cycles
from taskcal.errors import CampaignError, UnknownName

COMMANDS = {"A": np.zeros(3), "B": np.array([3.0, 4.0, 0.0]), "C": np.array([0.0, 0.0, 2.0])}


def measured(pose: str, cycles: str, stretch: float = 1.0, direction: str = "", commanded: bool = True) -> PoseCycles:
    return PoseCycles(
        pose=pose,
        direction=direction,
        cycles=tuple(cycles),
        attained=np.repeat(stretch * COMMANDS[pose][None], len(cycles), axis=0),
        rotations=None,
        commanded=COMMANDS[pose] if commanded else None,
        commanded_rotation=None,
    )


def test_a_distance_is_taken_in_common_cycles():
    second = measured("B", "3412", 1.1)
    second.attained[1] *= 2.0  # cycle 4, which A does not have
    found = assess_cycles([measured("A", "123"), second, measured("C", "9")])
    assert list(found.distances) == [("A", "B", "")]
    assert found.distances["A", "B", ""].cycles == 3
    assert found.distances["A", "B", ""].accuracy == pytest.approx(0.5)
    assert found.distances["A", "B", ""].repeatability == pytest.approx(0.0, abs=1e-12)


def test_directions_are_kept_apart():
    every = [measured(pose, "12", 1.0 + 0.1 * (way == "up"), way) for pose in "AB" for way in ("up", "down")]
    found = assess_cycles([*every, measured("C", "12", 1.0, "up")], [("A", "B"), ("C", "A")])
    assert {key: one.accuracy for key, one in found.distances.items()} == pytest.approx(
        {("A", "B", "up"): 0.5, ("A", "B", "down"): 0.0, ("C", "A", "up"): 0.0}
    )
    assert {pose: one.position for pose, one in found.directions.items()} == pytest.approx({"A": 0.0, "B": 0.5})
    assert [line["direction"] for line in found.summary()["poses"]] == ["up", "down", "up", "down", "up"]


def test_a_distance_that_was_asked_for_must_be_there():
    cycles = [measured("A", "12"), measured("B", "34"), measured("C", "12", commanded=False)]
    assert not assess_cycles(cycles).distances
    for pair in (("A", "B"), ("A", "C")):
        with pytest.raises(CampaignError, match="have no distance"):
            assess_cycles(cycles, [pair])
    with pytest.raises(UnknownName, match="no pose 'D'"):
        assess_cycles(cycles, [("A", "D")])
