"""What an accuracy leaves to the geometry."""

from hypothesis import given
from hypothesis import strategies as st

from taskcal.planning.task_map import allow_geometry

lengths = st.floats(1e-6, 1e-3)


@given(lengths, lengths)
def test_geometry_and_model_error_add_in_squares_to_the_accuracy(accuracy: float, model_error: float) -> None:
    allowed = allow_geometry(accuracy, model_error)
    assert allowed is not None
    if 3.0 * model_error**2 >= accuracy**2:
        assert allowed == 0.0
    else:
        assert abs(allowed**2 + 3.0 * model_error**2 - accuracy**2) < 1e-12 * accuracy**2


def test_without_an_accuracy_nothing_is_asked_for() -> None:
    assert allow_geometry(None, 1e-5) is None
