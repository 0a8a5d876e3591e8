"""The rows of a campaign about an estimate: what every kind says, dense or streamed."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.identification import problem as problem_module
from taskcal.identification.layout import frame_precision, layout_of
from taskcal.identification.problem import problem_of, stated_rows, whitener
from taskcal.kernels import walk
from taskcal.registration.registration import register
from taskcal.virtual.cell import simulate
from tests.identification.arms import KINDS, arm
from tests.laws.observations import KINDS_WITHOUT_TRACKER, observed, observed_with_points

seeds = st.integers(0, 2**32 - 1)
ROWS = {"distance": 40, "cube": 30, "plane": 30}


def tracked(seed, kind, rows=25):
    """What a tracker measured."""
    rng, model = arm(seed)
    options = dict(KINDS[kind])
    options.pop("rotation_sigma", None)
    targets = {f"t{k}": rng.normal(size=3) * 0.1 for k in range(options.pop("targets", 1))}
    campaign, _ = simulate(model, rng.uniform(-2.0, 2.0, (rows, 6)), rng=rng, targets=targets, **options)
    return model, campaign


def problem_about(model, campaign, seed, *, fixed=False):
    """Its problem, and an estimate near the registered nominal robot."""
    layout = layout_of(model, np.arange(len(model)), register(model, campaign), campaign, fixed=fixed)
    z = layout.start() + 1e-3 * np.random.default_rng(seed).normal(size=len(layout.names))
    return problem_of(layout, campaign, None), z


def assert_same_equations(found, expected, tolerance):
    """Costs, gradients and information matrices by the size of their columns."""
    size = np.sqrt(np.diag(expected[2]) + 1e-300)
    np.testing.assert_allclose(found[0], expected[0], rtol=tolerance)
    np.testing.assert_allclose(
        found[1] / size, expected[1] / size, rtol=0, atol=tolerance * np.abs(expected[1] / size).max()
    )
    np.testing.assert_allclose(
        found[2] / np.outer(size, size), expected[2] / np.outer(size, size), rtol=0, atol=tolerance
    )


@pytest.mark.parametrize("kind", [*KINDS, *KINDS_WITHOUT_TRACKER])
@settings(max_examples=2)
@given(seeds)
def test_rows_hold_the_derivative_of_the_prediction(kind, seed):
    """Of a tracker's points and poses and of every other kind: by all entries of frames and kind, and by some parameters."""
    model, campaign = tracked(seed, kind) if kind in KINDS else observed(kind, seed, rows=ROWS.get(kind, 16))[:2]
    problem, z = problem_about(model, campaign, seed)
    at, h = problem.linearise(z), 1e-6
    parameters = np.random.default_rng(seed).choice(len(model), 8, replace=False)
    for i in (*parameters, *range(len(model), len(z))):
        step = h * np.eye(len(z))[i]
        moved = (problem.linearise(z - step).residual - problem.linearise(z + step).residual) / (2 * h)
        np.testing.assert_allclose(at.by_entry[:, :, i], moved, rtol=1e-5, atol=2e-7, err_msg=problem.layout.names[i])


@pytest.mark.parametrize("kind", KINDS)
def test_streamed_equations_are_those_of_dense_rows(kind):
    """Points in compiled passes, poses in parts; and propagated covariances."""
    problem, z = problem_about(*tracked(3, kind), 3)
    rows, W = problem.rows(z), whitener(problem.noise)
    assert_same_equations(rows.equations(W), rows.linearise().equations(W), 1e-11)
    C = np.diag(np.random.default_rng(0).uniform(1e-8, 1e-6, len(z)))
    for streamed, dense in zip(rows.propagate(C), rows.linearise().propagate(C), strict=True):
        np.testing.assert_allclose(streamed, dense, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("kind", KINDS_WITHOUT_TRACKER)
def test_rows_taken_in_parts_are_those_taken_at_once(kind, monkeypatch):
    """What rows refer to keeps its number; what is stated beside them is added once."""
    model, campaign, _ = observed_with_points(kind, 5)
    problem, z = problem_about(model, campaign, 5)
    rows, W = problem.rows(z), whitener(problem.noise)
    expected, C = rows.linearise().equations(W), np.diag(np.full(len(z), 1e-7))
    propagated = rows.linearise().propagate(C)
    monkeypatch.setattr(problem_module, "POSES", 7)
    assert_same_equations(rows.equations(W), expected, 1e-11)
    for parts, whole in zip(rows.propagate(C), propagated, strict=True):
        np.testing.assert_allclose(parts, whole, rtol=1e-9, atol=1e-15)
    r, A = stated_rows(problem.layout, z, problem.seen.kinds)
    with_stated = expected[0] + 0.5 * r @ r, expected[1] + A.T @ r, expected[2] + A.T @ A
    assert_same_equations(problem.equations(W)(z), with_stated, 1e-9)


@pytest.mark.parametrize("kind", ["socket", "board"])
def test_the_prior_of_the_frames_holds_what_no_row_tells(kind):
    """In the tool's axes, although a target that is turned moves in its own."""
    model, campaign, _ = observed(kind, 1)
    registration = replace(register(model, campaign), unobservable=np.diag([0.0, 0.0, 1.0]))
    layout = layout_of(model, np.arange(len(model)), registration, campaign, fixed=False)
    own, precision = registration.T_tool_target[0, :3, :3], frame_precision(layout)
    precision[:3, :3] = own @ precision[:3, :3] @ own.T
    loose = np.diag(precision)
    assert loose[2] > 1e9
    rounding = 0.0 if kind == "socket" else np.finfo(float).eps * loose[2]  # of turning the axes, above
    assert (np.delete(loose, 2) <= 1.0 + rounding).all()


@pytest.mark.parametrize("fixed", [False, True])
@pytest.mark.parametrize("kind", [*KINDS, *KINDS_WITHOUT_TRACKER])
def test_blocks_are_all_entries_beside_the_parameters(kind, fixed):
    """Each once and in its order, named and with a prior deviation; what is held has none, and is where it was registered."""
    model, campaign = tracked(1, kind) if kind in KINDS else observed_with_points(kind, 1)[:2]
    layout = problem_about(model, campaign, 1, fixed=fixed)[0].layout
    entries = np.arange(len(model), len(layout.names))
    np.testing.assert_array_equal(np.concatenate([block.columns for block in layout.blocks]), entries)
    z = np.random.default_rng(1).normal(size=len(layout.names))
    for block in layout.blocks:
        assert [layout.names[k] for k in block.columns] == [*block.names]
        assert len(block.deviations) == len(block.columns) == (0 if block.held else len(block.start))
        np.testing.assert_array_equal(block.of(layout.start()), block.start)
        np.testing.assert_array_equal(block.of(z), block.start if fixed else z[block.columns])
    assert [*map(len, (layout.bases, layout.places, layout.own))] == [1, len(campaign.targets), len(campaign.targets)]


@pytest.mark.parametrize("kind", [*KINDS, "socket"])
def test_frames_that_are_held_have_no_columns(kind):
    model, campaign = tracked(1, kind) if kind in KINDS else observed(kind, 1)[:2]
    problem, _ = problem_about(model, campaign, 1, fixed=True)
    layout, start = problem.layout, problem.layout.start()
    assert layout.names == model.names
    assert not len(stated_rows(layout, start, problem.seen.kinds).residual)
    at = problem.walked(start)
    np.testing.assert_allclose(
        walk.poses(at.chain, at.s, at.e), layout.registration.T_tracker_base @ model.poses(campaign.q), atol=1e-12
    )
    assert np.isfinite(problem.equations(whitener(problem.noise))(start)[0])
