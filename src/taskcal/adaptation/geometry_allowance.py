"""What a task's accuracy leaves to the identified geometry, beside the model error of each single pose."""

import math


def allow_geometry(accuracy: float | None, model_error: float) -> float | None:
    """The largest error of the geometry with which a single pose still meets the accuracy.

    The model error is taken for white: at a pose of the task it is as large as at a measured one, and independent of what
    identification leaves, so that both add in squares.

    Args:
        accuracy: rms in space at a single pose, metres; None where none is stated.
        model_error: standard deviation per axis, metres.

    Returns:
        rms in space, metres; zero if the model error alone takes the whole accuracy; None where none is stated.
    """
    return None if accuracy is None else math.sqrt(max(accuracy**2 - 3.0 * model_error**2, 0.0))
