import pytest

from taskcal.errors import TaskcalError
from taskcal.observations import Sockets, Standalone, kinds

DISTANCE = {"a": "p", "b": "q", "distance": 0.1, "uncertainty": 1e-5, "statement": ""}


@pytest.mark.parametrize(
    ("members", "said"),
    [
        ({"key": "plane"}, "cannot be called 'plane': Planes of taskcal.observations.plane is"),
        ({"key": "rod", "instrument": "wire"}, "cannot be called 'wire': Lengths of taskcal.observations.distance is"),
        ({"key": "rod", "needed": ("l", "m"), "columns": {"l": ("l",)}}, r"needs the column 'm'.*in its columns \(l\)"),
        ({"key": "rod", "label": "rod"}, r"needs the column 'rod'.*in its columns \(none\)"),
    ],
)
def test_a_kind_that_cannot_be_entered_says_why(members, said):
    """The name of another, or a column that it does not read; it stays out of the registry."""
    before = kinds()
    with pytest.raises(TaskcalError, match=said):
        type("Rods", (Standalone,), {"__module__": __name__, **members})
    assert kinds() == before


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
