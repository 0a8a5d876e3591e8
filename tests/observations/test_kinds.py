import pytest

from taskcal.errors import TaskcalError
from taskcal.observations import Sockets, Standalone, kinds

DISTANCE = {"a": "p", "b": "q", "distance": 0.1, "uncertainty": 1e-5, "statement": ""}


@pytest.mark.parametrize("kind", kinds(), ids=lambda kind: kind.key)
def test_a_tracker_alone_needs_a_frame_of_its_own(kind):
    assert kind.in_tracker == (not issubclass(kind, Standalone))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"sockets": "p"}, "sockets: is not a list"),
        ({"mood": 1}, "'mood' is not a known key"),
        ({"distances": [{**DISTANCE, "distance": "far"}]}, "distances 1, distance: is not a number"),
        ({"distances": [{"a": "p"}]}, "distances 1, b: is missing"),
    ],
)
def test_a_kind_is_not_made_of_what_is_none_of_its_fields(change, said):
    stated = {"sockets": ["p", "q"], "distances": [DISTANCE]}
    assert Sockets.of_description(stated).describe() == stated
    with pytest.raises(TaskcalError, match=said):
        Sockets.of_description(stated | change)
