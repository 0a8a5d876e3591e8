"""The residual field against the process it stands for, below and beyond the rows that it keeps as a whole."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.distance import cdist
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from taskcal.identification import field
from taskcal.identification.field import ResidualField

DEVIATION = np.array([1e-4, 2e-4, 0.5e-4])


def draw(rng, lengths, noise, count):
    """Joint positions and residuals there: a random function of these lengths, by random waves, and noise."""
    q = rng.uniform(-1.0, 1.0, (count, len(lengths)))
    waves, phases = rng.normal(size=(len(lengths), 500)) / lengths[:, None], rng.uniform(0, 2 * np.pi, 500)
    values = np.sqrt(2 / 500) * np.cos(q @ waves + phases) @ rng.normal(size=(500, 3))
    return q, (values + noise * rng.normal(size=values.shape)) * DEVIATION


def known(q, values, lengths, noise):
    """A field whose hyper-parameters are given, and what the textbook says of new poses."""

    def correlation(a, b):
        return np.exp(-0.5 * cdist(a / lengths, b / lengths, "sqeuclidean"))

    K = cho_factor(correlation(q, q) + noise**2 * np.eye(len(q)))
    weights = cho_solve(K, values)
    made = ResidualField(q=q, weights=weights, lengths=lengths, deviation=DEVIATION, noise=noise * DEVIATION)

    def exact(at):
        k = correlation(at, q)
        left = 1.0 - np.einsum("nk,kn->n", k, cho_solve(K, k.T))
        return k @ weights, (left[:, None] + noise**2) * DEVIATION**2

    return made, exact


def test_correction_and_variance_are_those_of_the_process():
    rng = np.random.default_rng(0)
    q, values = draw(rng, np.array([0.7, 1.5, 0.9]), 0.2, 80)
    found, unseen = known(q, values, np.array([0.7, 1.5, 0.9]), 0.2)[0], rng.uniform(-1, 1, (30, 3))
    kernel = ConstantKernel(1.0) * RBF(found.lengths) + WhiteKernel(0.2**2)
    reference = GaussianProcessRegressor(kernel, optimizer=None, alpha=0.0).fit(q, values)
    mean, deviation = reference.predict(unseen, return_std=True)
    np.testing.assert_allclose(found.mean(unseen), mean, rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(found.variance(unseen), deviation**2 * found.deviation**2, rtol=1e-8)


@pytest.mark.slow
@given(
    seed=st.integers(0, 10**6),
    lengths=st.lists(st.floats(0.1, 10.0), min_size=1, max_size=4).map(np.array),
    noise=st.floats(0.05, 2.0),
)
def test_beyond_its_limit_the_correction_is_that_of_all_rows_and_the_variance_never_too_small(seed, lengths, noise):
    rng = np.random.default_rng(seed)
    q, values = draw(rng, lengths, noise, 120)
    made, exact = known(q, values, lengths, noise)
    at = rng.uniform(-1.5, 1.5, (40, len(lengths)))
    mean, variance = exact(at)
    with pytest.MonkeyPatch.context() as patched:
        for name, value in {"MAX_DENSE_ROWS": 100, "LOW_RANK": 30, "NEIGHBOURS": 20}.items():
            patched.setattr(field, name, value)
        np.testing.assert_allclose(made.mean(at), mean, atol=1e-9 * DEVIATION.max())
        assert np.all(made.variance(at) >= variance * (1 - 1e-9))
        assert np.all(made.variance(at) <= (1 + noise**2) * DEVIATION**2 * (1 + 1e-9))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lengths", "noise"),
    [
        pytest.param([0.9, 1.1, 1.7, 3.7, 0.9, 1.4], 0.6, id="smooth"),
        pytest.param([0.8, 0.15, 0.75, 1.1, 1.2, 60.0], 0.95, id="rough in one joint"),
        pytest.param([0.3, 0.3, 0.3, 0.3, 0.3, 0.3], 0.3, id="rough"),
    ],
)
def test_four_thousand_rows_tell_nearly_as_much_as_the_process_knows(lengths, noise):
    """Lengths as they are found on measured robots, in units of the joints' ranges."""
    rng = np.random.default_rng(0)
    q, values = draw(rng, np.array(lengths), noise, 4200)
    made, exact = known(q[:4000], values[:4000], np.array(lengths), noise)
    mean, variance = exact(q[4000:])
    assert len(made.q) > field.MAX_DENSE_ROWS
    np.testing.assert_allclose(made.mean(q[4000:]), mean, atol=1e-9 * DEVIATION.max())
    ratio = made.variance(q[4000:]) / variance
    assert ratio.min() > 1.0 - 1e-9
    assert np.median(ratio) < 1.02
    assert ratio.max() < 1.1


@pytest.mark.slow
def test_the_variance_has_no_steps(monkeypatch):
    """Along a way on which the nearest rows change all the time, steps shrink with the way between the poses."""
    for name, value in {"MAX_DENSE_ROWS": 100, "LOW_RANK": 1, "NEIGHBOURS": 20}.items():
        monkeypatch.setattr(field, name, value)
    rng, lengths = np.random.default_rng(0), np.array([0.4, 0.6])
    made, _ = known(*draw(rng, lengths, 0.3, 200), lengths, 0.3)

    def largest_step(count):
        way = np.linspace([-0.9, -0.7], [0.8, 0.9], count)
        return np.abs(np.diff(made.variance(way)[:, 0])).max()

    assert largest_step(4000) < 0.2 * largest_step(400)


def test_many_measurements_at_one_pose_count(monkeypatch):
    for name, value in {"MAX_DENSE_ROWS": 100, "LOW_RANK": 1, "NEIGHBOURS": 20}.items():
        monkeypatch.setattr(field, name, value)
    rng, lengths = np.random.default_rng(0), np.array([0.4, 0.6])
    q, values = draw(rng, lengths, 0.3, 160)
    q[:50] = [0.3, 0.3]
    made, exact = known(q, values, lengths, 0.3)
    variance = exact(q[:1])[1]
    assert np.all(made.variance(q[:1]) < 1.1 * variance)


def test_far_from_all_rows_nothing_is_known():
    rng, lengths = np.random.default_rng(0), np.array([0.4, 0.6])
    made, _ = known(*draw(rng, lengths, 0.3, field.MAX_DENSE_ROWS + 1), lengths, 0.3)
    far = np.array([[30.0, 0.0], [0.0, -40.0]])
    np.testing.assert_allclose(made.mean(far), 0.0, atol=1e-15)
    np.testing.assert_allclose(made.variance(far), (made.deviation**2 + made.noise**2) * np.ones((2, 1)), rtol=1e-12)


@pytest.mark.slow
def test_a_field_of_many_rows_is_the_same_when_read_again():
    rng = np.random.default_rng(0)
    q, values = draw(rng, np.array([0.5, 0.8]), 0.3, field.MAX_DENSE_ROWS + 200)
    made, _ = known(q, values, np.array([0.5, 0.8]), 0.3)
    read = ResidualField.from_json(json.loads(json.dumps(made.to_json())))
    at = rng.uniform(-1, 1, (50, 2))
    np.testing.assert_array_equal(read.mean(at), made.mean(at))
    np.testing.assert_array_equal(read.variance(at), made.variance(at))


def test_poses_may_be_none_or_many():
    rng, lengths = np.random.default_rng(0), np.array([0.5, 0.8])
    made, exact = known(*draw(rng, lengths, 0.3, 60), lengths, 0.3)
    at = rng.uniform(-1, 1, (2 * field.BATCH_ROWS + 3, 2))
    np.testing.assert_allclose(made.mean(at), exact(at)[0], atol=1e-9 * DEVIATION.max())
    assert made.mean(at[:0]).shape == made.variance(at[:0]).shape == (0, 3)


@pytest.mark.parametrize("name", ["q", "weights", "lengths", "noise"])
def test_arrays_that_do_not_belong_together_are_refused(name):
    rng, lengths = np.random.default_rng(0), np.array([0.5, 0.8])
    data = known(*draw(rng, lengths, 0.3, 30), lengths, 0.3)[0].to_json()
    data[name] = data[name][:-1]
    with pytest.raises(ValueError, match="do not belong together"):
        ResidualField.from_json(data)
