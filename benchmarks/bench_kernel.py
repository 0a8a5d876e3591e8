"""The compiled walk against fresh memory, against plain NumPy and against C++ written by hand for one robot."""

from dataclasses import dataclass

import numpy as np
import pytest

from benchmarks import plain_walk
from benchmarks.hand_written import HandWritten, MeasuredPoints, build
from taskcal import observations
from taskcal.identification.layout import Layout
from taskcal.identification.problem import Problem, Seen, whitener
from taskcal.kernels.chain import ErrorFrame, Fixed
from taskcal.registration.registration import Registration
from taskcal.virtual.cell import TRACKER_POSE, draw_defects, simulate

NEAR_MEMORY = 3.0
"""Sensitivities take less than this many times the writing of their array."""


@pytest.fixture(scope="module")
def x(model):
    return draw_defects(model, np.random.default_rng(2))


def test_sensitivities_against_fresh_memory(race, model, joints, smoke):
    n = 1000 if smoke else 1_000_000
    q = joints(n)

    def write() -> np.ndarray:
        out = np.empty((n, 3, len(model)))
        out.fill(1.0)
        return out

    race(
        "sensitivities, 10⁶ poses",
        lambda: model.jacobian(q, angular=False),
        {"fresh memory": write},
        below=NEAR_MEMORY,
    )


@pytest.mark.guard
@pytest.mark.parametrize("count", [60, 100_000])
def test_poses_against_numpy(race, model, joints, x, smoke, count):
    q, e, xi, steps = joints(300 if smoke else count), model.error_frames(x), x[-3:], list(model.steps)

    def plain() -> np.ndarray:
        return plain_walk.poses(steps, model.robot, q, e, xi)

    np.testing.assert_allclose(model.poses(q, x), plain(), rtol=0.0, atol=1e-12)
    race(f"poses, {count}", lambda: model.poses(q, x), {"NumPy": plain})


@pytest.mark.guard
@pytest.mark.parametrize("count", [60, 100_000])
def test_sensitivities_against_numpy(race, model, joints, x, smoke, count):
    q, e, xi, steps = joints(300 if smoke else count), model.error_frames(x), x[-3:], list(model.steps)

    def plain() -> np.ndarray:
        out = np.empty((len(q), 3, len(model)))
        for rows, _, J in plain_walk.sensitivities(steps, model.robot, q, e, xi):
            out[rows] = J.transpose(2, 1, 0)
        return out

    np.testing.assert_allclose(model.jacobian(q, x, angular=False), plain(), rtol=0.0, atol=1e-12)
    race(f"sensitivities, {count}", lambda: model.jacobian(q, x, angular=False), {"NumPy": plain})


@pytest.fixture(scope="module")
def library(tmp_path_factory):
    found = build(tmp_path_factory.mktemp("hand-written"))
    if found is None:
        pytest.skip("no g++ here: nothing written by hand to race against")
    return found


def test_sensitivities_against_hand_written_ones(race, model, joints, x, smoke, library):
    """Both write into the same memory, which is there already."""
    q = joints(1003 if smoke else 1_000_000)
    for values in (x, 0.0 * x):
        other = HandWritten.of(library, model, values)
        J = model.jacobian(q[:1003], values, angular=False)
        np.testing.assert_allclose(other.sensitivities(q[:1003], np.empty_like(J)), J, rtol=0.0, atol=1e-13)
    out = model.jacobian(q, angular=False)
    race(
        "sensitivities, 10⁶ poses, warm",
        lambda: model.jacobian(q, angular=False, out=out),
        {"C++": lambda: other.sensitivities(q, out)},
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Points:
    """A campaign of points at true parameters, as a fit sees it: 45 parameters, tracker frame and target."""

    problem: Problem
    z: np.ndarray
    whitener: np.ndarray

    def streamed(self) -> tuple[float, np.ndarray, np.ndarray]:
        return self.problem.rows(self.z).equations(self.whitener)

    def agrees(self, cost: float, g: np.ndarray, H: np.ndarray) -> None:
        """With the streamed normal equations, each element by the size of its columns."""
        own_cost, own_g, own_H = self.streamed()
        scale = np.sqrt(np.maximum(np.diag(H), 1.0))  # three of the tool's parameters move nothing
        assert own_cost == pytest.approx(cost, rel=1e-9)
        np.testing.assert_allclose(own_g / scale, g / scale, rtol=0.0, atol=1e-9 * np.sqrt(cost))
        np.testing.assert_allclose(own_H / scale / scale[:, None], H / scale / scale[:, None], rtol=0.0, atol=1e-9)


@pytest.fixture(scope="module")
def points(model, joints, x):
    def simulated(n: int) -> Points:
        campaign = simulate(model, joints(n), rng=np.random.default_rng(3))[0]
        here = Registration(
            T_tracker_base=TRACKER_POSE, T_tool_target=np.eye(4)[None], rms=0.0, unobservable=np.zeros((3, 3))
        )
        layout = Layout(
            model=model,
            estimated=np.arange(len(model)),
            registration=here,
            targets=campaign.targets,
            kinds=(observations.Point(),),
        )
        problem = Problem(layout=layout, q=campaign.q, seen=Seen.of(campaign), noise=campaign.covariances())
        z = layout.start()
        z[: len(x)] = x
        return Points(problem=problem, z=z, whitener=whitener(problem.noise))

    return simulated


@pytest.mark.guard
@pytest.mark.parametrize("count", [60, 100_000])
def test_normal_equations_against_numpy(race, model, points, x, smoke, count):
    """JᵀWJ and JᵀWr of whitened points."""
    case = points(300 if smoke else count)
    z, white, q, measured = case.z, case.whitener, case.problem.q, case.problem.seen.position
    steps = [Fixed(TRACKER_POSE), ErrorFrame(), *model.steps]
    e = np.concatenate([np.zeros((1, 6)), model.error_frames(x)])
    # the base frame comes first on the walk, after the parameters in z
    order = np.concatenate([6 + np.arange(len(model)), np.arange(6), 6 + len(model) + np.arange(3)])

    def plain() -> tuple[float, np.ndarray, np.ndarray]:
        cost, g, H = 0.0, np.zeros(len(z)), np.zeros((len(z), len(z)))
        for rows, end, J in plain_walk.sensitivities(steps, model.robot, q, e, x[-3:], extra=3):
            J[-3:] = end.R.transpose(1, 0, 2)
            W = white[rows, 0]
            flat = (W @ J.transpose(2, 1, 0)).reshape(-1, len(z))
            r = (W @ (measured[rows, 0] - end.p.T)[:, :, None]).reshape(-1)
            cost += 0.5 * float(r @ r)
            g += flat.T @ r
            H += flat.T @ flat
        return cost, g[order], H[np.ix_(order, order)]

    case.agrees(*plain())
    race(f"normal equations, {count}", case.streamed, {"NumPy": plain})


def test_normal_equations_against_hand_written_ones(race, model, points, x, smoke, library):
    case, other = points(1003 if smoke else 100_000), HandWritten.of(library, model, x)
    measured = MeasuredPoints(
        base=TRACKER_POSE,
        base_error=case.z[len(x) : len(x) + 6],
        target=case.z[len(x) + 6 :],
        points=case.problem.seen.position,
        whiteners=case.whitener,
    )

    def by_hand() -> tuple[float, np.ndarray, np.ndarray]:
        return other.normal_equations(case.problem.q, measured)

    case.agrees(*by_hand())
    race("normal equations, 100000", case.streamed, {"C++": by_hand})
