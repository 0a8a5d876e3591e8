"""Segments of the tool: lines and arcs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.correction.path import Segments
from taskcal.geometry import se3

angles = st.floats(0.05, 6.2)
seeds = st.integers(0, 10_000)


def circle(seed):
    rng = np.random.default_rng(seed)
    R, center, radius = se3.exp(rng.normal(size=3)), rng.normal(size=3), rng.uniform(0.01, 0.5)
    return lambda angle: center + radius * R @ np.array([np.cos(angle), np.sin(angle), 0.0]), radius


@given(end=angles, sense=st.sampled_from([-1.0, 1.0]), share=st.floats(0.1, 0.9), seed=seeds)
def test_an_arc_runs_on_the_circle_through_its_via_point(end, sense, share, seed):
    point, radius = circle(seed)
    R = se3.exp(np.random.default_rng(seed).normal(size=3) * 0.4)
    segments = Segments(
        start=se3.pose(np.eye(3), point(0.0))[None],
        end=se3.pose(R, point(sense * end))[None],
        via=point(sense * end * share)[None],
    )
    u = np.linspace(0.0, 1.0, 7)
    T = segments.at(np.zeros(7, dtype=int), u)
    np.testing.assert_allclose(T[:, :3, 3], [point(sense * end * s) for s in u], atol=1e-7)
    np.testing.assert_allclose(segments.length, radius * end, rtol=1e-5)
    np.testing.assert_allclose(T[-1, :3, :3], R, atol=1e-12)
    # orientation keeps pace with the distance gone, about one axis
    np.testing.assert_allclose(se3.log(T[:, :3, :3]), u[:, None] * se3.log(R), atol=1e-9)


@given(seed=seeds, u=st.floats(0.0, 1.0))
def test_the_direction_is_the_derivative_of_the_place(seed, u):
    point, _ = circle(seed)
    start, end = se3.pose(np.eye(3), point(0.0)), se3.pose(np.eye(3), point(2.5))
    segments = Segments(
        start=np.stack([start, start]), end=np.stack([end, end]), via=np.stack([point(1.0), np.full(3, np.nan)])
    )
    rows, h = np.arange(2), 1e-6
    ahead, behind = (segments.at(rows, np.full(2, u + s))[:, :3, 3] for s in (h, -h))
    slope = (ahead - behind) / np.linalg.norm(ahead - behind, axis=1, keepdims=True)
    np.testing.assert_allclose(segments.direction(rows, np.full(2, u)), slope, atol=1e-6)
    assert segments.is_arc.tolist() == [True, False]


def test_a_point_on_the_chord_makes_a_line():
    start, end = se3.translation(x=0.1), se3.translation(x=0.3)
    segments = Segments(start=start[None], end=end[None], via=np.array([[0.2, 0.0, 0.0]]))
    assert not segments.is_arc[0]
    assert segments.length[0] == pytest.approx(0.2)
    np.testing.assert_allclose(segments.at(np.array([0]), np.array([0.25]))[0, :3, 3], [0.15, 0.0, 0.0])


def test_an_unknown_start_leaves_the_length_open():
    segments = Segments(start=np.full((1, 4, 4), np.nan), end=np.eye(4)[None], via=np.full((1, 3), np.nan))
    assert np.isnan(segments.length[0])
    assert not segments.is_arc[0]
