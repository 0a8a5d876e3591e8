"""What makers call the joints of their robots, in columns of measurements."""

import re
from collections.abc import Sequence

_CALLED = (
    ("shoulder pan", "shoulder lift", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3"),
    ("s", "l", "u", "r", "b", "t"),
    ("s", "l", "e", "u", "r", "b", "t"),
)
"""In the order of the joints: Universal Robots' driver and pendant, Yaskawa with six joints and with seven."""


def joints_called(texts: Sequence[str], count: int) -> dict[int, int]:
    """The joint of each column that a maker's name states, where all joints of one maker's set are there.

    Args:
        texts: names of the columns in small letters, their words parted by one blank.
        count: of the robot's joints.
    """
    plain = [re.sub(r"(?:^joint )|(?: joint)?(?: (?:angle|pos|position|value))?$", "", text) for text in texts]
    plain = [re.sub(r"^wrist(\d)$", r"wrist \1", text) for text in plain]
    for names in _CALLED:
        at = {k: names.index(text) for k, text in enumerate(plain) if text in names}
        if len(names) == count and sorted(at.values()) == list(range(count)):
            return at
    return {}


def logged_unit(text: str) -> str | None:
    """Unit of a joint's column in Universal Robots' real-time data, whose manual has radians; None of any other column."""
    return "rad" if re.fullmatch(r"(?:actual|target) q ?\[?[0-5]\]?", text) else None
