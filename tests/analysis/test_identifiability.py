"""Elimination: its relations against the columns, its ranks against derivatives written out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.analysis.identifiability import NEGLIGIBLE, eliminate, identifiability
from taskcal.geometry import se3
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.robots import generators, industrial, industrial_positions, irb6660_description, irb6660_positions


@pytest.mark.parametrize("components", ["position", "pose"])
@pytest.mark.parametrize("frames", [False, True])
def test_the_relations_carry_the_columns_of_the_kept_over_to_all(components, frames):
    @settings(max_examples=10)
    @given(generators)
    def law(rng):
        model = ErrorModel(robot_from(industrial(rng)))
        found = identifiability(model, industrial_positions(rng, 40), components=components, frames=frames)
        kept = [found.names.index(name) for name in found.kept]
        assert found.dependent
        assert found.agrees
        B = found.relations()
        np.testing.assert_array_equal(B[:, kept], np.eye(len(kept)))
        size = np.linalg.norm(found.matrix, axis=0)
        off = np.linalg.norm(found.matrix[:, kept] @ B - found.matrix, axis=0)
        assert (off <= 1e-7 * size.max()).all()

    law()


@given(generators, st.integers(2, 8))
def test_relations_of_made_columns_are_those_they_were_made_with(rng, p):
    J = np.linalg.qr(rng.normal(size=(30, p)))[0] * 10.0 ** rng.uniform(-3, 3, p)
    made = rng.uniform(0.5, 2.0, (p, 3)) * rng.choice([-1.0, 0.0, 1.0], (p, 3)) / np.linalg.norm(J, axis=0)[:, None]
    names = tuple(f"a{i}" for i in range(p + 3))
    found = eliminate(np.c_[J, J @ made], names, np.ones(p + 3), poses=10)
    zero = ~made.any(axis=0)
    assert found.zero == tuple(names[p + k] for k in np.flatnonzero(zero))
    np.testing.assert_allclose(found.relations(), np.c_[np.eye(p), np.where(zero, 0.0, made)], rtol=1e-9, atol=1e-12)


def test_rounding_column_has_no_effect():
    """A column counts against the largest: rounding leaves 1e-16 of it, the smallest that counts is 1e-9."""
    rng = np.random.default_rng(0)
    J = np.linalg.qr(rng.normal(size=(30, 4)))[0]
    names = ("large", "other", "small", "rounding")
    for size in (1e-3, 1.0, 1e6):
        scaled = size * J * [1.0, 1.0, 10.0 * NEGLIGIBLE, 0.1 * NEGLIGIBLE]
        found = eliminate(scaled, names, np.ones(4), poses=10)
        assert found.zero == ("rounding",)
        assert found.kept == ("large", "other", "small")
        assert found.rank == found.pivoted_rank == 3
        assert found.singular_values[3] == 0.0
    nothing = eliminate(np.zeros((30, 4)), names, np.ones(4), poses=10)
    assert (nothing.zero, nothing.kept, nothing.rank, nothing.pivoted_rank) == (names, (), 0, 0)


@pytest.mark.parametrize("components", ["position", "pose"])
def test_rank_with_frames_is_that_of_differences(components):
    """Of base, robot and target moved one after another, without the columns that are written down for them."""
    rng = np.random.default_rng(3)
    model = ErrorModel(robot_from(industrial(rng)))
    q, x = industrial_positions(rng, 30), rng.normal(size=len(model)) * model.tolerances
    pose = components == "pose"
    reach, h, p = model.robot.reach, 1e-5, len(model)
    middle = model.poses(q, x)

    def moved(z):
        base, target = se3.error_transform(z[p : p + 6]), se3.error_transform(z[p + 6 :])
        T = base @ model.poses(q, x + z[:p]) @ target
        turned = se3.log(T[:, :3, :3] @ np.swapaxes(middle[:, :3, :3], 1, 2)) * reach
        return np.concatenate([T[:, :3, 3], turned] if pose else [T[:, :3, 3]], axis=1).reshape(-1)

    steps = h * np.eye(p + 12)[: p + (12 if pose else 9)]
    J = np.stack([(moved(step) - moved(-step)) / (2.0 * h) for step in steps], axis=1)
    size = np.linalg.norm(J, axis=0)
    alive = size > 1e-7 * size.max()
    s = np.linalg.svd(J[:, alive] / size[alive], compute_uv=False)
    found = identifiability(model, q, x, components=components, frames=True)
    assert found.rank == found.pivoted_rank == len(found.kept) == int((s > 1e-6 * s[0]).sum())
    assert (
        found.names[p:]
        == tuple(f"{frame}.{c}" for frame in ("base", "target") for c in ("tx", "ty", "tz", "rx", "ry", "rz"))[
            : J.shape[1] - p
        ]
    )
    assert set(found.zero) == {name for name, counts in zip(found.names, alive, strict=True) if not counts}
    np.testing.assert_allclose(found.matrix.T @ found.matrix, J.T @ J, atol=1e-5 * size.max() ** 2)


def with_rod(millimetres):
    description = irb6660_description()
    return ErrorModel(robot_from({**description, "four_bar": {**description["four_bar"], "rod_mm": millimetres}}))


def test_longer_rod_adds_rank_and_nothing_distinguishable():
    """A rod a tenth of a millimetre longer adds to the exact rank and nothing that is told apart."""
    q = irb6660_positions(np.random.default_rng(0), 60)
    ideal, longer = (identifiability(with_rod(rod), q) for rod in (700.0, 700.1))
    assert (ideal.rank, longer.rank) == (25, 26)
    before, after = ideal.distinguishable(noise=0.26e-3), longer.distinguishable(noise=0.26e-3)
    assert before.count == after.count == 24
    added = after.directions[0]
    assert added.leading == pytest.approx({"loop.crank": 0.5**0.5, "loop.rocker": 0.5**0.5}, rel=1e-3)
    assert 1.0 - added.left < 1e-4
    assert len(after.lost) == len(before.lost) + 1
    left = [direction.left for direction in after.directions[1:]]
    np.testing.assert_allclose(left, [direction.left for direction in before.directions], rtol=1e-3)


@given(generators, st.integers(2, 6), st.floats(-5.0, 0.0))
def test_what_is_left_of_a_direction_is_what_a_posterior_leaves(rng, p, exponent):
    """Against the covariance of the parameters by its formula, (T⁻² + JᵀJ/σ²)⁻¹, of every direction and across them."""
    noise, tolerances = 10.0**exponent, 10.0 ** rng.uniform(-3.0, 0.0, p)
    J = rng.normal(size=(20, p))
    names = tuple(f"a{i}" for i in range(p))
    told = eliminate(J, names, tolerances, poses=10).distinguishable(noise=noise)
    scaled = J * tolerances
    posterior = np.linalg.inv(np.eye(p) + scaled.T @ scaled / noise**2)
    v = np.array([[direction.coefficients[name] for name in names] for direction in told.directions])
    left = np.array([direction.left for direction in told.directions])
    np.testing.assert_allclose(v @ posterior @ v.T, np.diag(left**2), rtol=1e-6, atol=1e-9 * left[0] ** 2)
    assert (np.diff(left) <= 0.0).all()
    assert told.count == (left**2 < 0.5).sum()
    assert [direction.left for direction in told.lost] == left[left**2 >= 0.5].tolist()
    assert told.summary()["rank"] == told.count + len(told.lost) == p


@pytest.mark.parametrize("noise", [0.0, -1e-3, np.nan, np.inf])
def test_noise_that_is_no_positive_number_is_refused(noise):
    found = eliminate(np.eye(3), ("a", "b", "c"), np.ones(3), poses=1)
    with pytest.raises(ValueError, match=r"noise of .*positive standard deviation per axis in metres"):
        found.distinguishable(noise=noise)
