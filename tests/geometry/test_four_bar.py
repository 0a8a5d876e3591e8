from dataclasses import replace

import mpmath
import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from taskcal.errors import ClosureError
from taskcal.geometry.four_bar import FourBar, can_close, close_four_bar, curvature
from tests.laws.robots import generators

PARALLELOGRAM = FourBar(crank=0.5, rod=0.7, rocker=0.5, arm=0.7)


def rod_vector(bar: FourBar, alpha, kappa, theta):
    """From the crank's end to the rocker's, in the loop's plane."""

    def u(angle):
        return np.array([np.cos(angle), np.sin(angle)])

    return bar.arm * u(alpha) + bar.rocker * u(theta + bar.rocker_angle) - bar.crank * u(kappa + bar.crank_angle)


def mp_theta(lengths, angles, levers, near):
    """θ to 40 digits by Newton's method on the closure equation."""
    L1, L2, L3, d = lengths
    alpha, kappa = angles
    gamma, rho = levers

    def closure(theta):
        x = d * mpmath.cos(alpha) + L3 * mpmath.cos(theta + rho) - L1 * mpmath.cos(kappa + gamma)
        y = d * mpmath.sin(alpha) + L3 * mpmath.sin(theta + rho) - L1 * mpmath.sin(kappa + gamma)
        return x * x + y * y - L2 * L2

    return mpmath.findroot(closure, near)


@st.composite
def bars(draw):
    """Loops of any proportions at angles where they close with room to spare, in either assembly."""
    rng = draw(generators)
    L = rng.uniform(0.3, 1.0, 4)
    gamma, rho = rng.uniform(-np.pi, np.pi, 2)
    bar = FourBar(
        crank=L[0],
        rod=L[1],
        rocker=L[2],
        arm=L[3],
        crank_angle=gamma,
        rocker_angle=rho,
        assembly=draw(st.sampled_from([1, -1])),
    )
    alpha, kappa = rng.uniform(-np.pi, np.pi, 2)
    w = np.hypot(
        *(
            bar.arm * np.array([np.cos(alpha), np.sin(alpha)])
            - bar.crank * np.array([np.cos(kappa + gamma), np.sin(kappa + gamma)])
        )
    )
    assume(w > 0.1)
    assume(abs(bar.rod**2 - w**2 - bar.rocker**2) < 0.9 * 2 * bar.rocker * w)
    return bar, alpha, kappa


@given(bars())
def test_both_assemblies_satisfy_the_closure_and_differ(case):
    bar, alpha, kappa = case
    angles = []
    for assembly in (1, -1):
        chosen = replace(bar, assembly=assembly)
        theta = close_four_bar(chosen, np.array([alpha]), np.array([kappa])).angle[0]
        v = rod_vector(chosen, alpha, kappa, theta)
        np.testing.assert_allclose(np.linalg.norm(v), bar.rod, rtol=1e-12)
        lever = theta + bar.rocker_angle
        side = v @ [-np.sin(lever), np.cos(lever)]
        assert side * assembly > 0
        assert abs(theta - kappa) <= np.pi + 1e-12
        angles.append(theta)
    assert abs(np.exp(1j * angles[0]) - np.exp(1j * angles[1])) > 1e-3


@given(bars())
def test_derivatives_agree_with_those_taken_to_forty_digits(case):
    bar, alpha, kappa = case
    closed = close_four_bar(bar, np.array([alpha]), np.array([kappa]))
    lengths, angles = (bar.crank, bar.rod, bar.rocker, bar.arm), (alpha, kappa)
    levers = bar.crank_angle, bar.rocker_angle
    with mpmath.workdps(40):
        near = mpmath.mpf(float(closed.angle[0]))
        theta = mp_theta(lengths, angles, levers, near)
        assert abs(float(theta - near)) < 1e-12

        def moved(k, value):
            values = [mpmath.mpf(v) for v in (*lengths, *angles)]
            values[k] = value
            return mp_theta(values[:4], values[4:], levers, theta)

        expected = [
            float(mpmath.diff(lambda v, k=k: moved(k, v), mpmath.mpf((*lengths, *angles)[k]))) for k in range(6)
        ]
    got = [*closed.by_length[0], *closed.by_angle[0]]
    np.testing.assert_allclose(got, expected, rtol=1e-10, atol=1e-11)


@given(bars())
def test_second_derivatives_are_those_of_the_first(case):
    bar, alpha, kappa = case
    step = 1e-5
    # a and k moved up and down, one after the other
    moved = np.array([alpha, kappa])[:, None, None] + step * np.array([[[1, -1], [0, 0]], [[0, 0], [1, -1]]]).swapaxes(
        0, 1
    )
    first = close_four_bar(bar, *moved.reshape(2, 4)).by_angle.reshape(2, 2, 2)
    a, k = np.array([alpha]), np.array([kappa])
    got = curvature(bar, close_four_bar(bar, a, k), a, k)[0]
    np.testing.assert_allclose(got, (first[:, 0] - first[:, 1]) / (2 * step), rtol=1e-5, atol=1e-6 * np.abs(got).max())


@given(generators)
def test_a_parallelogram_passes_the_cranks_angle_on(rng):
    alpha = rng.uniform(-1.5, 1.5, 50)
    kappa = alpha + np.radians(rng.uniform(-80, 80, 50))
    closed = close_four_bar(PARALLELOGRAM, alpha, kappa)
    np.testing.assert_allclose(closed.angle, kappa, rtol=0, atol=1e-14)
    np.testing.assert_allclose(closed.by_angle, np.broadcast_to([0.0, 1.0], (50, 2)), atol=1e-12)
    np.testing.assert_allclose(closed.by_length[:, 0], -closed.by_length[:, 2], rtol=1e-12, atol=1e-13)


@given(bars(), st.floats(-0.02, 0.02))
def test_the_rocker_turns_as_smoothly_as_the_crank(case, turn):
    bar, alpha, kappa = case
    kappas = kappa + np.linspace(0.0, turn, 200)
    try:
        closed = close_four_bar(bar, np.full(200, alpha), kappas)
    except ClosureError:
        assume(False)
    steps = np.diff(np.unwrap(closed.angle))
    bound = 1.1 * np.abs(closed.by_angle[:, 1]).max() * abs(turn) / 199 + 1e-12
    assert np.abs(steps).max() <= bound


@pytest.mark.parametrize("turns", [-2, -1, 1, 2])
def test_the_rocker_follows_the_crank_through_whole_turns(turns):
    alpha, kappa = np.array([0.3]), np.array([0.5])
    once = close_four_bar(PARALLELOGRAM, alpha, kappa).angle
    again = close_four_bar(PARALLELOGRAM, alpha + 2 * np.pi * turns, kappa + 2 * np.pi * turns).angle
    np.testing.assert_allclose(again - once, 2 * np.pi * turns, atol=1e-12)


def test_open_loop_names_its_first_pose():
    """A loop that cannot close names the first such pose and its angles."""
    bar = replace(PARALLELOGRAM, rod=0.9)
    alpha = np.zeros(5)
    kappa = np.radians([0.0, 10.0, 75.0, 0.0, 80.0])
    with pytest.raises(ClosureError, match=r"does not close at pose 2: arm at 0\.000°, crank at 75\.000°"):
        close_four_bar(bar, alpha, kappa)


def test_levers_in_line_are_refused_as_singular():
    with pytest.raises(ClosureError, match="pose 0"):
        close_four_bar(PARALLELOGRAM, np.array([0.0]), np.array([np.pi / 2]))


@given(bars(), generators)
def test_angles_are_told_apart_by_whether_the_loop_closes_there(case, rng):
    bar, alpha, kappa = case
    alphas, kappas = alpha + rng.uniform(-3, 3, 60), kappa + rng.uniform(-3, 3, 60)
    closing = can_close(bar, alphas, kappas)
    close_four_bar(bar, alphas[closing], kappas[closing])
    for i in np.flatnonzero(~closing):
        with pytest.raises(ClosureError):
            close_four_bar(bar, alphas[i : i + 1], kappas[i : i + 1])
