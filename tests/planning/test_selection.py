"""The choice of parameters for a task, and its reasons."""

import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.errors import CampaignError, ReachError
from taskcal.geometry import se3
from taskcal.identification.hyperparameters import Hyperparameters
from taskcal.identification.identify import identify
from taskcal.identification.layout import Layout
from taskcal.observations import Point
from taskcal.planning.expected_error import Design
from taskcal.planning.selection import MAX_ERROR_RATIO, _relations, select, selection_steps
from taskcal.registration.registration import Registration
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import Harmonics
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


@pytest.fixture(scope="module")
def listed(model) -> Task:
    """The task as a list of poses whose joints are known."""
    reached = reach_task(model, reference_task(np.radians(20.0)), 30)
    return Task(name="listed", poses=reached.T, joints=reached.q)


def test_the_chosen_model_is_the_smallest_that_suffices(model):
    chosen = select(model, reference_task(), model_error=0.0)
    full = chosen.ladder[0].expected
    sizes = [nested.size for nested in chosen.ladder if nested.expected <= MAX_ERROR_RATIO * full]
    assert len(chosen.kept) == min(sizes) < 25
    assert set(chosen.kept) | set(chosen.dropped) == set(model.names)
    assert not set(chosen.kept) & set(chosen.dropped)
    assert chosen.before > 20 * full


def test_every_dropped_parameter_carries_a_reason_that_holds(model):
    chosen = select(model, reference_task(np.radians(20.0)), model_error=0.0)
    assert "no effect" in chosen.dropped["tool.rx"]
    assert chosen.dropped["J4.tz"] == "equal to J3.ty"
    assert chosen.dropped["J4.rz"] == "equal to 0.28·J1.ty + J3.ry"
    assert all(reason for reason in chosen.dropped.values())


@pytest.mark.parametrize("scale", [1.0, 1e4])
def test_a_dropped_parameter_equals_what_adds_to_it(model, scale):
    """Coefficients are those of the columns; what adds nothing at the size of its own column is left out, whatever its unit."""
    p = len(model)
    one, small, other = np.random.default_rng(0).normal(size=(3, 40))
    small, other = 1e-4 * small / scale, 7.0 * other
    J = np.zeros((40, p))
    J[:, :5] = np.stack([one, small, other, one - 2e2 * scale * small, 3.0 * one + 1e-2 * scale * small], axis=1)
    some = np.zeros((0, p))
    by = Design(
        model=model,
        information=J.T @ J,
        influence=J.T @ J,
        prior=np.ones(p),
        frames=0.0,
        layout=Layout(
            model=model,
            estimated=np.arange(p),
            registration=Registration(
                T_tracker_base=np.eye(4), T_tool_target=np.eye(4)[None], rms=0.0, unobservable=np.zeros((3, 3))
            ),
            targets=("tool",),
            kinds=(Point(),),
        ),
        free=np.zeros(0, dtype=int),
        follow=some,
        frame_covariance=np.zeros((0, 0)),
    )
    found = _relations(by, [3, 4, 5], [0, 1, 2])
    a, b = model.names[:2]
    assert found.keys() == {3, 4}
    assert found[3] == pytest.approx({a: 1.0, b: -2e2 * scale})
    assert found[4] == pytest.approx({a: 3.0})
    assert _relations(by, [2], [0, 1]) == {}


def test_selection_references_published_and_identifiable_set(model):
    """The published and the identifiable set are references of the same selection."""
    chosen = select(model, reference_task())
    assert chosen.references["published"][0] == 33
    assert chosen.references["identifiable"][0] == 24
    assert all(e >= chosen.ladder[0].expected * (1 - 1e-9) for _, e in chosen.references.values())


def test_its_steps_are_told_as_they_were_foreseen(model, listed):
    told = []
    select(model, listed, count=10, progress=told.append)
    assert tuple(told) == selection_steps(None)


def test_an_accuracy_is_met_by_the_smallest_model_that_meets_it(model):
    loose = select(model, reference_task(), accuracy=1e-4)
    assert len(loose.kept) < len(select(model, reference_task()).kept)
    by_size = {nested.size: nested.expected for nested in loose.ladder}
    assert by_size[len(loose.kept)] <= 1e-4 < by_size[len(loose.kept) - 1]


def test_selection_rejects_accuracy_below_noise(model):
    """An accuracy below the noise is rejected with the accuracy that is achievable."""
    with pytest.raises(CampaignError, match=r"out of reach.*0\.00\d mm rms"):
        select(model, reference_task(), accuracy=1e-6, model_error=0.0)


def test_assumed_model_error_is_reported_and_shrinks_selection(model):
    """An assumed model error is reported and leaves fewer parameters worth their variance."""
    assumed, exact = (select(model, reference_task(), count=60, model_error=u) for u in (None, 0.0))
    assert len(assumed.kept) < len(exact.kept)
    assert assumed.ladder[0].expected > 2.0 * exact.ladder[0].expected
    assert assumed.summary()["model_error_mm"] == pytest.approx(0.05)
    assert assumed.model_error_origin == model.robot.model_error.source
    assert (exact.model_error, exact.model_error_origin) == (0.0, "as given")


def test_a_campaign_cross_validates_every_size(model):
    task = reference_task(np.radians(20.0))
    measured = reach_task(model, task, 40, seed=2)
    campaign, _ = simulate(model, measured.q, rng=np.random.default_rng(0))
    chosen = select(model, task, campaign, folds=3)
    crossed = [nested.cross_validated for nested in chosen.ladder]
    assert all(value is not None for value in crossed)
    assert crossed[-1] > 5 * crossed[0]
    assert 10 < len(chosen.kept) < 26


def test_an_unreachable_workspace_says_so(model):
    task = reference_task()
    far = replace(task.workspace, center=np.array([6.0, 0.0, 1.0]))
    with pytest.raises(ReachError, match="does not reach"):
        select(model, replace(task, workspace=far))


def test_elimination_step_states_error_of_reduced_model(model):
    """The ladder starts with all and ends with none; each size lacks one more; the choice lies on it."""
    chosen = select(model, reference_task(), count=60)
    assert [nested.size for nested in chosen.ladder] == list(range(len(model), -1, -1))
    order = [nested.dropped_next for nested in chosen.ladder[:-1]]
    assert sorted(order) == sorted(model.names)
    assert chosen.ladder[-1].dropped_next == ""
    assert set(order[: len(model) - len(chosen.kept)]) == set(chosen.dropped)
    assert np.all(np.diff([nested.expected for nested in chosen.ladder]) >= -1e-12)
    assert chosen.ladder[-1].expected == pytest.approx(chosen.before, rel=1e-9)
    again = select(model, reference_task(), count=60)
    assert (again.kept, again.summary()) == (chosen.kept, chosen.summary())


def test_selection_without_published_set_compares_identifiable():
    """A robot without a published set is compared with the identifiable set alone."""
    plain = ErrorModel(load_robot("ur5"))
    q = np.random.default_rng(0).uniform(-1.2, 1.2, (60, 6))
    chosen = select(plain, Task(name="listed", poses=plain.poses(q), joints=q))
    assert set(chosen.references) == {"identifiable"}
    assert len(chosen.kept) <= chosen.references["identifiable"][0]


def test_too_few_rows_for_the_folds_are_refused(model):
    campaign, _ = simulate(model, reach_task(model, reference_task(), 12).q, rng=np.random.default_rng(0))
    with pytest.raises(CampaignError, match=r"12 rows are too few for cross-validation in 7 folds; measure more"):
        select(model, reference_task(), campaign, folds=7)


def test_known_hyperparameters_state_the_model_error(model, listed):
    known = Hyperparameters.of_deviations((1e-4,), 2.0)
    assert select(model, listed, hyperparameters=known).model_error == pytest.approx(1e-4)


def test_pose_campaign_states_model_error_in_mrad(model, listed):
    """A campaign of full poses also states its model error in milliradians."""
    campaign, _ = simulate(model, listed.joints[:16], rng=np.random.default_rng(2), pose=True)
    off = se3.exp(1e-3 * np.random.default_rng(3).normal(size=(16, 3)))
    campaign = replace(campaign, rotations=off @ campaign.rotations)
    chosen = select(model, listed, campaign, folds=2)
    found = identify(model, campaign).model_error
    assert chosen.summary()["model_error_mrad"] == pytest.approx(found[1] * 1e3)
    assert found[1] > 1e-4
    assert "model_error_mrad" not in select(model, listed).summary()


@pytest.mark.parametrize(
    ("effect", "expected"),
    [
        (Harmonics(orders=(1, 2, 3, 4)), ("costs", False)),
        (Harmonics(orders=(1, 2, 3, 4), tolerance=1e-6), ("moves", True)),
    ],
    ids=["harmonics", "small harmonics"],
)
def test_the_figures_of_every_reason_are_those_of_the_design(listed, effect, expected):
    """What a group moves is the root of its members' squares; what a step costs is the next size's error over this one's."""
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"), effects=(effect,))
    chosen = select(model, listed, count=40)
    seen = set()
    steps = {nested.dropped_next: k for k, nested in enumerate(chosen.ladder)}
    for group, members in chosen.groups.items():
        reason = chosen.dropped.get(members[0], "")
        own = model.indices(members)
        alone = np.sqrt(max(np.diag(chosen.design.influence)[own] @ chosen.design.prior[own] ** 2, 0.0))
        k = steps[group]
        if found := re.search(r"moves the task by ([\d.e-]+) mm rms", reason):
            assert float(found[1]) == pytest.approx(1e3 * alone, rel=0.06)
            seen.add(("moves", len(own) > 1))
        elif found := re.search(r"error of ([\d.]+) mm changes by ([+-][\d.]+) %", reason):
            now, then = chosen.ladder[k].expected, chosen.ladder[k + 1].expected
            assert float(found[1]) == pytest.approx(1e3 * now, abs=6e-4)
            assert float(found[2]) == pytest.approx(100.0 * (then - now) / now, abs=6e-3)
            seen.add(("costs", len(own) > 1))
    assert expected in seen
