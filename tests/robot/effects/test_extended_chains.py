"""Effects that add joints to the chain: beside each other, each has coordinates of its own."""

import json
from dataclasses import dataclass
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings

from taskcal.errors import TaskcalError
from taskcal.geometry import se3
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.kernels import walk
from taskcal.kernels.chain import ErrorFrame, Fixed, Joint
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions
from taskcal.robot.effects import Effect, LinearTerm, Thermal, WarmUp
from taskcal.robot.effects import base as registry
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.virtual.cell import simulate
from taskcal_demo.true_robot import ElasticLinks
from tests.laws import plain, statics
from tests.laws.robots import Case, cases, generators
from tests.robot.effects.test_random_robots import slopes
from tests.robot.effects.warm_robots import positions


@dataclass(frozen=True, kw_only=True)
class Stand(Effect, abstract=True):
    """A stand that turns under the base, more where the first axis is at zero."""

    key, label = "stand", "stand"

    def term(self, robot):
        own = len(robot.joints)
        return LinearTerm(
            names=(f"{self.key}.move",),
            units=("rad",),
            tolerances=(self.tolerance,),
            pairs=np.array([[own, 0]]),
            coordinates=own + 1,
            basis=lambda q: 1.0 + np.cos(q[:, :1]),
        )

    def extend(self, robot, steps):
        return (Joint("revolute", len(robot.joints)), *steps)


@dataclass(frozen=True, kw_only=True)
class Elbow(Stand, abstract=True):
    """A turn behind the first joint, about its axis, and a slide before the last one: joints are counted as they are met."""

    key, label = "elbow", "elbow"

    def term(self, robot):
        own = len(robot.joints)
        return LinearTerm(
            names=("elbow.turn", "elbow.slide"),
            units=("rad", "m"),
            tolerances=(self.tolerance, self.tolerance),
            pairs=np.array([[own, 0], [own + 1, 1]]),
            coordinates=own + 2,
            basis=lambda q: np.stack([np.ones(len(q), q.dtype), np.sin(q[:, 0])], axis=1),
        )

    def extend(self, robot, steps):
        out, met = [], 0
        for step in steps:
            met += isinstance(step, Joint)
            if isinstance(step, Joint) and met == len(robot.joints):
                out.append(Joint("prismatic", len(robot.joints) + 1))
            out.append(step)
            if isinstance(step, Joint) and met == 1:
                out.append(Joint("revolute", len(robot.joints)))
        return tuple(out)


@dataclass(frozen=True, kw_only=True)
class Wrist(Stand, abstract=True):
    """A tool that turns about its own axis."""

    key, label = "wrist", "wrist"

    def extend(self, robot, steps):
        return (*steps, Joint("revolute", len(robot.joints)))


LINKS = ElasticLinks(turns=(1e-9,), shifts=(1e-10,))
EFFECTS = (Thermal(), WarmUp(reference=0.0), LINKS, Stand(), Elbow(), Wrist())
PAIRS = [pair for pair in permutations(EFFECTS, 2) if {type(effect) for effect in pair} != {Thermal, WarmUp}]


def heavy(case: Case):
    return robot_from(statics.weighed(case.description, np.random.default_rng(0)))


def told(q) -> Conditions:
    return Conditions(temperature=np.full(len(q), 45.0), time=np.full(len(q), 5000.0))


def values(effects, robot, rng, size):
    """Of the effects' parameters: normal, of a share of their tolerances."""
    return [size * rng.normal(size=len(t.names)) * t.tolerances for t in (effect.term(robot) for effect in effects)]


@settings(max_examples=5)
@given(cases(poses=2), generators)
def test_model_moves_by_the_sum_of_two_small_effects(case: Case, rng: np.random.Generator):
    """Of every pair in either order; to second order, motions of a millionth add."""
    robot = heavy(case)
    rest = ErrorModel(robot).poses(case.q, case.x)

    def twist(effects, x):
        T = ErrorModel(robot, effects=effects).poses(case.q, np.concatenate([case.x, *x]), told(case.q))
        turned = se3.log(T[:, :3, :3] @ np.swapaxes(rest[:, :3, :3], 1, 2))
        return np.concatenate([T[:, :3, 3] - rest[:, :3, 3], turned], axis=1)

    for pair in PAIRS:
        x = values(pair, robot, rng, 3e-3)
        alone = sum(twist((effect,), (value,)) for effect, value in zip(pair, x, strict=True))
        np.testing.assert_allclose(twist(pair, x), alone, rtol=0.0, atol=2e-9, err_msg=str(pair))


@settings(max_examples=5)
@given(cases(poses=2), generators)
def test_model_composes_large_motions_at_the_ends_of_the_chain(case: Case, rng: np.random.Generator):
    """A tool's turn in either order; a stand's, added last, under all that stands on it."""
    robot, move = heavy(case), float(rng.normal())
    turn = np.stack([se3.rotation("z", angle) for angle in move * (1.0 + np.cos(case.q[:, 0]))])
    for effect in (*EFFECTS[:3], Elbow()):
        (own,) = values([effect], robot, rng, 100.0)
        beneath = ErrorModel(robot, effects=(effect,)).poses(case.q, np.concatenate([case.x, own]), told(case.q))
        for effects, x, expected in (
            ((effect, Stand()), (own, [move]), turn @ beneath),
            ((effect, Wrist()), (own, [move]), beneath @ turn),
            ((Wrist(), effect), ([move], own), beneath @ turn),
        ):
            found = ErrorModel(robot, effects=effects).poses(case.q, np.concatenate([case.x, *x]), told(case.q))
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-9)


@settings(max_examples=2)
@given(cases(poses=2), generators)
def test_jacobian_is_the_derivative_beside_another_effect(case: Case, rng: np.random.Generator):
    robot, q = heavy(case), case.q
    for pair in PAIRS:
        model = ErrorModel(robot, effects=pair)
        x = np.concatenate([case.x, *values(pair, robot, rng, 1.0)])
        scale = np.array([1e-4 if p.unit in ("m/N", "rad/Nm") else 0.1 for p in model.parameters])
        T = model.poses(q, x, told(q))
        at = model.walk(q, x, prepared=model.prepare(q, told(q)))
        found = scale * walk.columns(model.chain, at.s, at.e, model.layout(), at.factor, angular=True)
        expected = slopes(lambda step, m=model, x=x, s=scale: m.poses(q, x + s * step, told(q)), len(model))
        for row in range(len(q)):
            twists = plain.twists(T[row], expected[row])
            np.testing.assert_allclose(found[row], twists, rtol=0.0, atol=1e-8 * (1.0 + np.abs(twists).max()))


@settings(max_examples=3)
@given(cases(poses=2), generators)
def test_joint_jacobian_has_the_motion_of_added_joints(case: Case, rng: np.random.Generator):
    """Joints that effects add move with those of the robot."""
    for pair in permutations((Thermal(), Stand(), Elbow(), Wrist()), 2):
        model = ErrorModel(case.robot, effects=pair)
        x = np.concatenate([case.x, *values(pair, case.robot, rng, 300.0)])
        T, found = model.poses(case.q, x), model.joint_jacobian(case.q, x)
        expected = slopes(lambda step, m=model, x=x: m.poses(case.q + step, x), case.q.shape[1])
        for row in range(len(T)):
            twists = plain.twists(T[row], expected[row])
            np.testing.assert_allclose(found[row], twists, rtol=0.0, atol=1e-8 * (1.0 + np.abs(twists).max()))


@pytest.mark.parametrize("pair", [(Thermal(), Stand()), (Stand(), Thermal())], ids=["behind", "before"])
def test_idle_thermal_leaves_the_poses_of_another_effect(pair):
    alone = ErrorModel(load_robot("abb-irb120")) + Stand()
    both = ErrorModel(alone.robot, effects=pair)
    q = positions(alone)
    x = np.zeros(len(both))
    x[both.names.index("stand.move")] = 3e-3
    expected = alone.poses(q, np.append(np.zeros(len(alone) - 1), 3e-3))
    np.testing.assert_allclose(both.poses(q, x, told(q)), expected, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("pair", [(Thermal(), Elbow()), (Elbow(), Thermal())], ids=["behind", "before"])
def test_calibration_of_two_effects_loads_as_it_was_saved(tmp_path, monkeypatch, pair):
    monkeypatch.setattr(registry, "_KINDS", {**registry._KINDS, "Elbow": Elbow})
    rng = np.random.default_rng(0)
    model = ErrorModel(load_robot("abb-irb120"), effects=pair)
    q = rng.uniform(-1.0, 1.0, (40, 6))
    warm = Conditions(temperature=rng.uniform(18.0, 30.0, 40))
    campaign, truth = simulate(model, q, rng=rng, conditions=warm)
    found = identify(model, campaign)
    found.save(tmp_path / "cal.json")
    again = load_calibration(tmp_path / "cal.json")
    assert [effect["kind"] for effect in json.loads((tmp_path / "cal.json").read_text())["effects"]] == [
        type(effect).__name__ for effect in pair
    ]
    np.testing.assert_array_equal(again.predict(q, warm), found.predict(q, warm))
    assert np.linalg.norm(found.predict(q, warm) - truth.points(q, warm), axis=2).mean() < 5e-5


def extended(steps_of, coordinates=7, moved=6):
    """An effect whose chain and term are as given, on a robot of six joints."""

    class Odd(Stand, abstract=True):
        def term(self, robot):
            return LinearTerm(
                names=("odd",),
                units=("m",),
                tolerances=(1.0,),
                pairs=np.array([[moved, 0]]),
                coordinates=coordinates,
                basis=lambda q: np.ones((len(q), 1)),
            )

        def extend(self, robot, steps):
            return steps_of(steps)

    return Odd()


SLIDE = Joint("prismatic", 6)


@pytest.mark.parametrize(
    ("effect", "words"),
    [
        (extended(lambda s: s), r"adds joints with the numbers \[\], and its term moves \[6\]"),
        (extended(lambda s: (Joint("prismatic", 7), *s)), r"numbers \[7\], and its term moves \[6\]"),
        (extended(lambda s: (SLIDE, SLIDE, *s)), r"numbers \[6, 6\], and its term moves \[6\]"),
        (extended(lambda s: (SLIDE, *s), coordinates=6, moved=5), r"numbers \[6\], and its term moves \[\]"),
        (extended(lambda s: (SLIDE, *s), moved=7), "moves coordinate 7 and states 7"),
        (extended(lambda s: (SLIDE, *s), moved=-1), "moves coordinate -1 and states 7"),
        (extended(lambda s: (SLIDE, Joint(), *s)), "drops, repeats or adds steps that are not its own"),
        (extended(lambda s: (SLIDE, ErrorFrame(), *s)), "drops, repeats or adds steps that are not its own"),
        (extended(lambda s: (SLIDE, *[t for t in s if t.__class__ is not Fixed])), "drops, repeats or adds"),
    ],
)
def test_effect_is_refused_whose_joints_are_not_its_own(effect, words):
    with pytest.raises(TaskcalError, match=words):
        ErrorModel(load_robot("abb-irb120"), effects=(Thermal(), effect))
