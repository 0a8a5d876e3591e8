"""The doctor on what was observed without a tracker."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.diagnosis.diagnose import diagnose, tried_rows
from taskcal.observations import kinds
from taskcal.registration.registration import register_observations
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from tests.laws.observations import cube_campaign, observed_with_points, socket_campaign, wire_campaign

ROBOT = load_robot("ur5")


def campaign(measure, seed=0, rows=40):
    """Of a UR5 with defects of its tolerances' size."""
    rng, model = np.random.default_rng(seed), ErrorModel(ROBOT)
    return measure(rng, model, rng.normal(size=len(model)) * model.tolerances, rows, noise=2e-5)[0]


@pytest.fixture(scope="module")
def sockets():
    return campaign(socket_campaign)


def test_a_sound_campaign_of_sockets_has_no_findings(sockets):
    told = []
    found = diagnose(sockets, ROBOT, progress=lambda *counted: told.append(counted))
    assert told == [("mistakes, 1 at a time", done, len(told)) for done in range(len(told))]
    assert found.findings == ()
    assert "without a tracker (socket)" in found.scope


def test_only_sockets_are_quick_enough_to_try_all_mistakes():
    assert [kind.key for kind in kinds() if kind.quick] == ["socket"]


def test_tracker_beside_sockets_is_diagnosed_alone():
    """A left-handed frame of the tracker is found in its own rows, and the scope names the targets that were not examined."""
    model, mixed, _ = observed_with_points("socket", 2, rows=40)
    points = mixed.points.copy()
    points[:, 0] = points[:, 0, [1, 0, 2]]
    found = diagnose(replace(mixed, points=points), model.robot)
    assert [finding.id for finding in found.findings] == ["left-handed"]
    assert "only what a tracker measured (smr) is examined; " in found.scope
    assert mixed.targets[1] in found.scope
    seen = mixed.valid[:, 0]
    np.testing.assert_allclose(found.campaign.points[:, 0], mixed.points[seen, 0], atol=1e-12)


@pytest.mark.long
def test_a_sound_campaign_of_tracker_and_sockets_stays_as_it_is():
    model, mixed, _ = observed_with_points("socket", 2, rows=40)
    sound = diagnose(mixed, model.robot)
    assert sound.findings == ()
    assert sound.campaign is mixed


MISTAKES = {
    "joint-sign": (("J3",), lambda q: q * [1, 1, -1, 1, 1, 1]),
    "joint-zero": (("J2",), lambda q: q - [0, np.pi / 2, 0, 0, 0, 0]),
    "joint-order": (("J3", "J4"), lambda q: q[:, [0, 1, 3, 2, 4, 5]]),
    "joints-in-radians": (ROBOT.joint_names, np.radians),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_joint_mistake_shows_in_the_misses_of_sockets(sockets, name):
    subject, wrong = MISTAKES[name]
    found = diagnose(replace(sockets, q=wrong(sockets.q)), ROBOT)
    first = found.findings[0]
    assert (first.id, first.subject) == (name, subject)
    assert first.error_after < 0.3 * first.error_before
    np.testing.assert_allclose(found.campaign.q, sockets.q, atol=1e-9)


@pytest.mark.long
def test_two_mistakes_are_found_together(sockets):
    found = diagnose(replace(sockets, q=sockets.q[:, [0, 1, 3, 2, 4, 5]] * [1, -1, 1, 1, 1, 1]), ROBOT)
    assert {(f.id, f.subject) for f in found.findings[:2]} == {("joint-order", ("J3", "J4")), ("joint-sign", ("J2",))}


@pytest.mark.long
def test_sockets_of_other_rows_are_no_sound_campaign(sockets):
    shuffled = replace(sockets, q=np.random.default_rng(1).permutation(sockets.q))
    (only,) = diagnose(shuffled, ROBOT).findings
    assert only.id == "other-robot"
    assert "check which socket" in only.fix
    assert only.error_after is None


def test_doctor_says_too_few_rows_of_sockets_alone(sockets):
    (only,) = diagnose(sockets.take(np.arange(3)), ROBOT).findings
    assert only.id == "too-few-rows"


@pytest.mark.long
def test_the_length_of_a_wire_shows_the_sign_of_a_joint():
    wire = campaign(wire_campaign)
    first = diagnose(replace(wire, q=wire.q * [1, 1, -1, 1, 1, 1]), ROBOT).findings[0]
    assert (first.id, first.subject) == ("joint-sign", ("J3",))
    assert first.error_after < 0.1 * first.error_before < ROBOT.reach


@pytest.mark.long
def test_touches_show_the_sign_of_a_joint():
    model = ErrorModel(ROBOT)
    touches, _ = cube_campaign(np.random.default_rng(4), model, np.zeros(len(model)), 60, noise=2e-5)
    first = diagnose(replace(touches, q=touches.q * [1, 1, -1, 1, 1, 1]), ROBOT).findings[0]
    assert (first.id, first.subject) == ("joint-sign", ("J3",))
    assert first.error_after < 1e-4


def test_enough_is_looked_at_of_each_of_many_anchors():
    model = ErrorModel(ROBOT)
    wire = wire_campaign(np.random.default_rng(4), model, np.zeros(len(model)), 120)[0]
    (kind,) = wire.observations
    of = kind.of + 3 * (np.arange(120) >= 60)
    many = replace(wire, observations=(replace(kind, anchors=("a", "b", "c", "d", "e", "f"), of=of),))
    rows = tried_rows(many)
    assert np.bincount(of[rows]).min() >= 12
    assert len(tried_rows(wire)) < len(rows) < 120
    register_observations(model.poses(many.q[rows]), many.take(rows), model)
