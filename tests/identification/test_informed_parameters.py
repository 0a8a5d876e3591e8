"""Whether a fit learnt anything, by how far its standard errors fell below the prior's."""

import numpy as np

from taskcal.identification.checks.checks import tells_nothing

TOLERANCES, SCALE, ERROR = np.array([1e-3, 2e-4]), 0.7, 1e-3
PRIOR = SCALE * TOLERANCES


def test_rows_are_uninformative_if_no_variance_falls():
    """Rows are uninformative if every parameter stays as uncertain as before."""
    assert tells_nothing(PRIOR, TOLERANCES, SCALE, SCALE, ERROR)
    assert tells_nothing(1.01 * PRIOR, TOLERANCES, SCALE, SCALE, ERROR)


def test_one_parameter_that_is_learnt_is_enough():
    assert not tells_nothing(PRIOR * [1.0, 0.5], TOLERANCES, SCALE, SCALE, ERROR)


def test_information_is_judged_at_most_probable_scale():
    """The information gained is judged against the most probable scale."""
    half = 0.5 * PRIOR
    assert tells_nothing(half, TOLERANCES, SCALE, 1e-2 * SCALE, ERROR)
    # what the rows tell is three quarters of all: beside a prior of a standard deviation s, 1/√(1 + 3 s²) is left of it
    just = 0.95
    scale = SCALE * np.sqrt((1.0 / just**2 - 1.0) / 3.0)
    assert tells_nothing(half, TOLERANCES, SCALE, 0.999 * scale, ERROR)
    assert not tells_nothing(half, TOLERANCES, SCALE, 1.001 * scale, ERROR)


def test_a_robot_without_error_or_parameters_is_a_good_one():
    assert not tells_nothing(PRIOR, TOLERANCES, SCALE, SCALE, 1e-4)
    assert not tells_nothing(np.empty(0), np.empty(0), SCALE, SCALE, ERROR)
