"""What happened in the course of a campaign is named, whatever the order of its postures; where nothing happened, nothing is."""

import re
from dataclasses import replace

import numpy as np
import pytest

from taskcal.diagnosis.diagnose import diagnose
from taskcal.identification.calibration import COURSE_IN_DOUBT
from taskcal.identification.checks.digits import few_digits_of
from taskcal.identification.identify import identify
from taskcal.virtual.cell import simulate
from tests.identification.courses import ORDERS, ROBOTS, healthy, is_right, said, spoil

HAPPENED = {
    "drift": 2e-3,
    "there and back": 2e-3,
    "sinus": 2e-3,
    "move": 5e-3,
    "slip": 1e-2,
    "encoder": np.radians(0.5),
    "clocks": 3e-3,
}


@pytest.mark.parametrize("kind", HAPPENED)
def test_what_happened_is_named_with_its_row(kind):
    """Cause, joint or target, and row, on robots of several kinds, rows at random and in the order of postures."""
    for seed, order in enumerate(("drawn", "J1", "path")):
        model, sound = healthy(ROBOTS[(3 * seed + len(kind)) % len(ROBOTS)], seed, order=order)
        spoilt = spoil(model, sound, kind, HAPPENED[kind], seed)
        found = said(model, spoilt.campaign)
        assert is_right(spoilt, found), (kind, order, found[1:])
        (remark,) = [one for one in found[0].remarks if one.startswith(COURSE_IN_DOUBT)]
        assert spoilt.row is None or f"row {found[3]} (id " in remark


@pytest.mark.parametrize("kind", ["encoder", "slip", "move"])
def test_rows_held_out_at_an_event_are_on_neither_side_of_it(kind):
    """What happened among them is said to lie between those that were fitted, and no advice has a row that lies after it before."""
    model, sound = healthy("ur5e", 3)
    spoilt = spoil(model, sound, kind, HAPPENED[kind], 3)
    held_out = np.isin(np.arange(len(sound)), (0, spoilt.row, spoilt.row + 1))
    (remark,) = [
        one for one in identify(model, spoilt.campaign.take(~held_out)).remarks if one.startswith(COURSE_IN_DOUBT)
    ]
    assert f"between row {spoilt.row - 1} (id " in remark
    assert f"and row {spoilt.row + 2} (id " in remark
    if kind != "move":
        assert f"--rows 1:{spoilt.row} and --rows {spoilt.row + 2}:{len(sound)}" in remark


def test_a_drift_goes_on_among_rows_that_are_held_out():
    """It is as even as it was, whichever rows are missing."""
    for seed, name in enumerate(("ur5e", "kuka-kr16-2", "abb-irb120")):
        model, sound = healthy(name, seed)
        campaign = spoil(model, sound, "drift", HAPPENED["drift"], seed).campaign
        n = len(campaign)
        for missing in (slice(n // 7, n // 2), slice(n // 2, 3 * n // 4), slice(0, n, 3)):
            some = campaign.take(np.delete(np.arange(n), missing))
            (remark,) = [one for one in identify(model, some).remarks if one.startswith(COURSE_IN_DOUBT)]
            assert re.search(r"moved by about [12]\.\d mm from the first row", remark), remark


@pytest.mark.parametrize("order", ORDERS)
def test_nothing_is_said_where_nothing_happened(order):
    """Gear errors, compliance and lost motion in the order of postures are no drift, no move and no jump."""
    for seed, strength in enumerate((0.0, 1.0, 3.0)):
        name = ROBOTS[(3 * seed + len(order)) % len(ROBOTS)]
        calibration = said(*healthy(name, 40 + seed, order=order, strength=strength))[0]
        assert not any(one.startswith(COURSE_IN_DOUBT) for one in calibration.remarks)


@pytest.mark.long
def test_of_many_healthy_campaigns_at_most_one_in_a_hundred_is_accused():
    names = [
        said(*healthy(ROBOTS[seed % 10], 1000 + seed, order=order, strength=strength, rows=rows))[1]
        for k, order in enumerate(ORDERS)
        for seed in range(10 * k, 10 * k + 10)
        for strength, rows in ((1.0, 60), (3.0, 40), (1.0, 120))
    ]
    assert len(names) == 210
    assert sum(map(bool, names)) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["drift", "encoder", "clocks"])
def test_the_doctor_says_the_same(kind):
    model, sound = healthy("ur5", 3)
    spoilt = spoil(model, sound, kind, HAPPENED[kind], 3)
    first = diagnose(spoilt.campaign, model.robot).findings[0]
    assert first.id == spoilt.id
    (remark,) = [one for one in identify(model, spoilt.campaign).remarks if one.startswith(COURSE_IN_DOUBT)]
    without_sizes = [
        re.sub(r"[\d.]+ ?(mm|°|%)", "", words) for words in (first.fix, remark.removeprefix(COURSE_IN_DOUBT))
    ]
    assert without_sizes[1].startswith(without_sizes[0])


@pytest.mark.parametrize(
    ("name", "joints", "points"),
    [("ur5e", 0.1, None), ("kuka-kr16-2", 0.1, None), ("abb-irb120", 0.01, None), ("ur5", None, 1e-3)],
)
def test_few_digits_are_named_where_they_explain_what_is_left(name, joints, points):
    """Not where the robot stood at round values, nor where much else is left."""

    def rounded(campaign):
        q = campaign.q if joints is None else np.radians(np.round(np.degrees(campaign.q) / joints) * joints)
        p = campaign.points if points is None else np.round(campaign.points / points) * points
        return replace(campaign, q=q, points=p)

    model, sound = healthy(name, 5, strength=0.0, error=1e-5)
    found = few_digits_of(identify(model, rounded(sound)))
    assert found.of == ("points" if joints is None else "joints")
    assert found.step == ("1 mm" if joints is None else f"{joints:g}°")
    assert any("write more digits" in remark for remark in identify(model, rounded(sound)).remarks)
    assert few_digits_of(identify(model, sound)) is None
    if joints == 0.1:
        stood, _ = simulate(model, rounded(sound).q, rng=np.random.default_rng(0), model_error=1e-5)
        assert few_digits_of(identify(model, stood)) is None
    much = replace(
        rounded(sound), points=sound.points + 3e-3 * np.random.default_rng(1).normal(size=sound.points.shape)
    )
    assert few_digits_of(identify(model, much)) is None
