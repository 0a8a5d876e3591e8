"""What is measured next and when it is proven: by the rows alone, and honest in spite of many looks."""

from contextlib import closing
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import taskcal as tc
from taskcal.errors import CampaignError
from taskcal.live.journal import Journal, Row
from taskcal.live.steering import (
    DRIFT_SIGMAS,
    FALSE_STOP,
    KEPT_OUT_EVERY,
    MIN_KEPT_OUT,
    REPEATABILITY_M,
    START_ROWS,
    UNIT_ROWS,
    Aim,
    Steering,
    error_bound,
    level_of,
    rows_to_look,
)
from taskcal.live.virtual import VirtualCell
from taskcal.observations.base import TrackerNoise

ROBOT = tc.load_robot("ur5")
MODEL = tc.ErrorModel(ROBOT)
AIM = Aim(model=MODEL, task=tc.default_task(MODEL), tolerance=1e-5, seed=3, candidates=150, effects=False)
"""A tolerance that is never met."""


def _measure(steering: Steering, cell: VirtualCell, rng: np.random.Generator, rows: int) -> None:
    """Measure some rows, exactly at their poses."""
    for _ in range(rows):
        step, _ = steering.next(steering.update())
        point = cell.points(step.q[None])[0]
        point = rng.multivariate_normal(point, TrackerNoise().covariance(point))
        row = Row(
            number=step.number, purpose=step.purpose, station=1, time_s=20.0 * step.number, joints=step.q, point=point
        )
        assert steering.surprise(row) is None
        steering.journal.append(row)


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Steering:
    """A campaign of 24 rows."""
    journal = Journal(tmp_path_factory.mktemp("live") / "c.csv", ROBOT)
    journal.begin(AIM.settings)
    steering = Steering(AIM, journal)
    _measure(steering, VirtualCell.drawn(ROBOT, 3), np.random.default_rng(0), 24)
    journal.close()
    return steering


def test_kept_out_poses_are_neither_fitted_nor_chosen(measured: Steering) -> None:
    """Every fifth row after the start is kept out; the calibration is that of the others alone, as identified offline."""
    rows = measured.journal.rows
    kept = [row.id for row in rows if row.purpose == "kept-out"]
    assert kept == [f"{k}-kept-out" for k in range(START_ROWS + 1, 25) if k % KEPT_OUT_EVERY == 0]
    assert [row.number for row in rows if row.purpose == "reference"] == [21]
    calibration = measured.calibration()
    chosen = [row.number - 1 for row in rows if row.purpose == "chosen"]
    offline = tc.identify(MODEL, tc.read_campaign(measured.journal.path, ROBOT).take(chosen))
    np.testing.assert_allclose(calibration.z, offline.z, atol=1e-12)
    assert calibration.held_out is not None
    np.testing.assert_allclose(calibration.held_out.validation.errors, measured.kept_out_errors(), rtol=1e-6)


def test_resuming_gives_the_same_next_pose(measured: Steering) -> None:
    """What is next is a function of the rows and the notes: a new process chooses what the old one would."""
    journal = Journal(measured.journal.path, ROBOT)
    journal.resume(AIM.settings)
    again = Steering(AIM, journal)
    (step, error), (same, expected) = (one.next(one.update()) for one in (measured, again))
    assert (step.number, step.purpose) == (same.number, same.purpose) == (25, "kept-out")
    np.testing.assert_array_equal(step.q, same.q)
    assert error is expected is None
    best, best_again = measured._best(None), again._best(None)
    assert best[0] == best_again[0]
    assert best[1] == pytest.approx(best_again[1], rel=1e-9)


def test_the_next_pose_is_worth_more_than_most(measured: Steering) -> None:
    """The expected error falls by the next pose, and by more than by nine of ten others."""
    state = measured.update()
    assert state.budget is not None
    pose, after = measured._best(None)
    assert after < state.budget.after
    fit, gained = measured._fit, measured._gained(measured._fitting())[0]
    assert fit is not None
    others = []
    for k in range(0, 150, 3):
        X = fit.choice.judged.rows(fit.choice.measurable.q[k : k + 1], np.ones((1, 1), dtype=bool))
        X = X.reshape(-1, X.shape[2])
        others.append(measured._budget_with(gained + X.T @ X).after)
    assert np.mean(np.array(others) < after) <= 0.1
    assert ROBOT.inside_limits(fit.choice.measurable.q[[pose]])[0]


def test_wrong_rows_and_drift_are_noticed(measured: Steering) -> None:
    """Half a millimetre is a surprise and a drift, whatever its direction; the noise of the tracker is neither."""
    first = measured.journal.rows[0]
    rng = np.random.default_rng(1)
    noise = np.sqrt(np.trace(TrackerNoise().covariance(first.point)) / 3.0)
    limit = DRIFT_SIGMAS * noise * np.sqrt(6.0) + REPEATABILITY_M
    for _ in range(20):
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        reference = replace(first, purpose="reference", point=first.point + noise * rng.normal(size=3))
        assert measured.surprise(reference) is None
        assert measured.drift(reference) is None
        off = replace(reference, point=first.point + 5e-4 * direction)
        assert measured.surprise(off) == pytest.approx(5e-4, abs=2e-4)
        assert limit < 5e-4
        assert measured.drift(off) is not None


@pytest.mark.parametrize(
    ("factor", "said"),
    [(np.pi / 180.0, "radians were taken for degrees"), (180.0 / np.pi, "degrees were taken for radians"), (1.0, None)],
)
def test_joints_in_another_unit_are_refused_at_the_fifth_row(tmp_path: Path, factor: float, said: str | None) -> None:
    """Whichever was taken for the other, also where all values are within the limits; sound rows are not refused."""
    journal = Journal(tmp_path / "c.csv", ROBOT)
    journal.begin(AIM.settings)
    steering, cell = Steering(AIM, journal), VirtualCell.drawn(ROBOT, 3)
    scale = np.radians(3.0 if factor > 1.0 else 90.0)  # 3° taken for radians are within the limits
    q = scale * np.random.default_rng(1).uniform(-1.0, 1.0, (UNIT_ROWS, 6))
    for k, point in enumerate(cell.points(q)):
        assert steering.update().rows == k
        row = Row(number=k + 1, purpose="chosen", station=1, time_s=20.0 * k, joints=factor * q[k], point=point)
        journal.append(row)
    with closing(journal):
        if said is None:
            assert steering.update().rows == UNIT_ROWS
        else:
            with pytest.raises(CampaignError, match=said):
                steering.update()


@pytest.mark.parametrize("count", [6, 12])
def test_the_bound_is_too_low_as_seldom_as_it_says(count: int) -> None:
    """Of errors along one line, the worst case, as often as the level says; of errors in space more seldom."""
    rng = np.random.default_rng(count)
    line = np.abs(rng.normal(size=(20_000, count)))
    space = np.linalg.norm(rng.normal(size=(20_000, count, 3)), axis=2) / np.sqrt(3.0)
    level = 0.05
    low = [np.mean([error_bound(errors, level) < 1.0 for errors in some[:4000]]) for some in (line, space)]
    assert low[0] == pytest.approx(level, abs=0.012)
    assert low[1] < 0.2 * level


def test_all_looks_together_are_wrong_no_more_often_than_said() -> None:
    """The levels of any number of looks add up to less than the probability of a false stop, and nearly to it."""
    total = sum(level_of(look) for look in range(1, 2000))
    assert 0.99 * FALSE_STOP < total < FALSE_STOP


@pytest.mark.parametrize("share", [0.3, 0.6, 0.85])
@pytest.mark.parametrize("look", [1, 3])
def test_a_look_is_made_where_expected_errors_pass_it(share: float, look: int) -> None:
    """With as many errors of the expected size the bound keeps the tolerance, and with one fewer it does not."""
    n, level = rows_to_look(share, 1.0, look), level_of(look)
    assert error_bound(np.full(n, share), level) <= 1.0
    assert n == MIN_KEPT_OUT or error_bound(np.full(n - 1, share), level) > 1.0


def test_a_campaign_of_another_aim_is_refused(measured: Steering, tmp_path: Path) -> None:
    """Settings hold what the choice of poses depends on."""
    assert AIM.task.workspace is not None
    larger = replace(AIM.task.workspace, size=AIM.task.workspace.size * 1.1)
    for name, other in (
        ("seed", replace(AIM, seed=4)),
        ("task", replace(AIM, task=replace(AIM.task, workspace=larger))),
    ):
        with pytest.raises(tc.TaskcalError, match=f"another {name}"):
            Journal(measured.journal.path, ROBOT).resume(other.settings)


@pytest.mark.parametrize("count", [1, 3, 4])
@pytest.mark.parametrize("seed", [1, 2])
def test_wrong_rows_are_named_and_resuming_goes_on_with_the_right_ones(tmp_path: Path, seed: int, count: int) -> None:
    """Rows with the point of the pose before, fewer than half of them: kept out, all of them and no other, and the fit is right."""
    path, cell, rng = tmp_path / "c.csv", VirtualCell.drawn(ROBOT, seed), np.random.default_rng(seed)
    wrong = sorted(1 + rng.permutation(START_ROWS)[:count])
    journal = Journal(path, ROBOT)
    journal.begin(AIM.settings)
    steering, before, said = Steering(AIM, journal), np.ones(3), list[str]()
    while len(journal.rows) < START_ROWS + 8:
        try:
            state = steering.update()
        except CampaignError as error:
            said.append(str(error))
            journal.close()
            journal = Journal(path, ROBOT)
            journal.resume(AIM.settings)
            steering = Steering(AIM, journal)
            continue
        step, _ = steering.next(state)
        point = cell.points(step.q[None])[0] + 1e-5 * rng.normal(size=3)
        number, seen = step.number, before if step.number in wrong else point
        journal.append(
            Row(number=number, purpose=step.purpose, station=1, time_s=20.0 * number, joints=step.q, point=seen)
        )
        before = point
    assert 1 <= len(said) <= count
    for text, numbers in zip(said, journal.noted("excluded"), strict=True):
        assert f"{', '.join(map(str, numbers))} contradict" in text
        assert "--resume" in text
    excluded = [number for numbers in journal.noted("excluded") for number in numbers]
    assert sorted(excluded) == wrong
    calibration = steering.calibration()
    off = np.linalg.norm(calibration.predict(calibration.q)[:, 0] - cell.points(calibration.q), axis=1)
    assert off.max() < 1e-3
    journal.close()


def test_rows_of_which_most_are_wrong_are_refused(tmp_path: Path) -> None:
    """Which are right cannot be told: none is kept out, and it is said after ten rows, not after the fit."""
    cell, journal = VirtualCell.drawn(ROBOT, 1), Journal(tmp_path / "c.csv", ROBOT)
    journal.begin(AIM.settings)
    steering, before = Steering(AIM, journal), np.ones(3)
    for number in range(1, 2 * UNIT_ROWS + 1):
        step, _ = steering.next(steering.update())
        journal.append(Row(number=number, purpose="chosen", station=1, time_s=0.0, joints=step.q, point=before))
        before = cell.points(step.q[None])[0]
    with closing(journal), pytest.raises(CampaignError, match="no more than half agree"):
        steering.update()
    assert not journal.noted("excluded")
