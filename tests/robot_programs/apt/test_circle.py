"""Arcs through three points, against points made by turning a spoke."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.apt.circle import Arc, arc_through, circle_tokens, read_arc
from robot_programs.apt.syntax import parse
from taskcal.geometry import se3
from tests.laws.robots import generators

SWEEPS = st.floats(0.3, 5.9).filter(lambda sweep: abs(sweep - np.pi) > 0.05)


def circle(rng: np.random.Generator):
    R, center, radius = se3.exp(rng.normal(size=3)), rng.normal(size=3) * 0.1, rng.uniform(0.01, 0.3)
    return center, radius, lambda angle: center + radius * R @ np.array([np.cos(angle), np.sin(angle), 0.0]), R


@given(generators, SWEEPS, st.floats(0.2, 0.8))
def test_an_arc_through_three_points_is_their_circle(rng, sweep, share):
    center, radius, point, R = circle(rng)
    arc = arc_through(point(0.0), point(share * sweep), point(sweep))
    assert isinstance(arc, Arc)
    np.testing.assert_allclose(arc.center, center, atol=1e-9)
    np.testing.assert_allclose([arc.radius, arc.sweep], [radius, sweep], rtol=1e-7)
    np.testing.assert_allclose(arc.direction, R[:, 1], atol=1e-7)  # along the circle, as it begins


@given(generators, SWEEPS)
def test_an_arc_s_statement_is_read_back(rng, sweep):
    center, radius, point, R = circle(rng)
    text = lambda p: ",".join(f"{v * 1e3:.9f}" for v in p)  # noqa: E731
    second = ",2,INTOF" if sweep > np.pi else ""
    (statement,) = parse(
        f"TLON,GOFWD/(CIRCLE/{text(center)},{radius * 1e3:.9f}),ON{second},(LINE/{text(center)},{text(point(sweep))})"
    )
    tokens = circle_tokens(statement)
    assert tokens is not None
    arc = read_arc(tokens, R[:, 1] * 7.0, point(0.0), 1e-3)
    assert isinstance(arc, Arc)
    np.testing.assert_allclose(arc.via, point(0.5 * sweep), atol=1e-8)
    np.testing.assert_allclose(arc.end, point(sweep), atol=1e-9)
    assert arc.second == (sweep > np.pi)


def test_what_makes_no_arc_says_why():
    a, b = np.zeros(3), np.array([0.1, 0.0, 0.0])
    assert arc_through(a, 0.5 * (a + b), b) == "the arc is straight"


@pytest.mark.parametrize("text", ["TLON,GOFWD/(CIRCLE/0,0,0),ON,(LINE/0,0,0,1,0,0)", "TLON,GOFWD/1,2,3"])
def test_a_statement_of_another_form_has_no_circle(text):
    (statement,) = parse(text)
    assert circle_tokens(statement) is None
