"""Studies: the same rows from every engine and after every interruption, and what the models are worth."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from taskcal.analysis.identifiability import published_kept
from taskcal.errors import FileError, FitError, TaskcalError, UnknownName
from taskcal.identification import fit as fitting
from taskcal.identification.identify import identify
from taskcal.io.json_file import sealed, without_seal
from taskcal.planning import study as studying
from taskcal.planning.expected_error import design
from taskcal.planning.selection import select
from taskcal.planning.study import study
from taskcal.report.study import describe_failed, draw_study, tabulate_study
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import Task, reach_task
from taskcal.virtual.cell import simulate
from taskcal_demo.procedure import reference_task
from tests.reading import virtual_task

CASES = {"counts": (8,), "plans": ("random", "grid"), "models": ("all", "published"), "seed": 3}


@pytest.fixture(scope="module", autouse=True)
def _quickly_prepared():
    """Random plans are drawn from few poses, and the same poses are reached only once for all studies."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(studying, "POOL_POSES", 100)
        for name in ("measuring_task", "reach_task"):
            patch.setattr(studying, name, cache(getattr(studying, name)))
        yield


@pytest.fixture(scope="module")
def model():
    return ErrorModel(load_robot("abb-irb6660-205-1.9"))


@pytest.fixture(scope="module")
def task(model) -> Task:
    """The reference task as a list of poses whose joints are known."""
    reached = reach_task(model, reference_task(), 40)
    return Task(name="listed", poses=reached.T, joints=reached.q)


@pytest.fixture(scope="module")
def rows(model, task):
    return study(model, task, robots=4, engine="sequential", **CASES).rows


def test_study_counts_uninformative_robots_as_unchanged(model, task, tmp_path):
    """With so large a model error some campaigns are refused; they must not end the study."""
    case = {"counts": (12,), "plans": ("random",), "seed": 3, "model_error": 5e-3, "engine": "sequential"}
    made = study(model, task, robots=3, resume=tmp_path / "study.json", **case)
    assert [row["learnt"] for row in made.rows] == [False, True, True]
    assert made.unlearnt == 1
    again = study(model, task, robots=3, resume=tmp_path / "study.json", **case)
    assert again.rows == made.rows


FEW = {**CASES, "counts": (3, 8), "plans": ("random",)}
"""Three poses cannot be fitted, whichever robot they are of."""


@pytest.fixture(scope="module")
def partly(model, task):
    return study(model, task, robots=2, engine="sequential", **FEW)


def test_a_campaign_that_is_not_fitted_is_a_row_with_the_reason(partly):
    assert [row["count"] for row in partly.failed] == [3] * 4
    assert all("too few" in row["failed"] and row["rms_mm"] is None for row in partly.failed)
    assert partly.unlearnt == 0
    few, enough = partly.summary()[::2]
    assert (few["robots"], few["failed"], few["median_mm"]) == (0, 2, None)
    assert (enough["robots"], enough["failed"]) == (2, 0)
    assert enough["median_mm"] > 0.0
    assert tabulate_study(partly, "listed").rows[0][3:5] == ("0", "–")
    said = describe_failed(partly)
    assert said.startswith("4 of 8 campaigns, which no figure counts. robots 0 (2 campaigns), 1 (2 campaigns): ")
    draw_study(partly)


@pytest.mark.parametrize("engine", ["threading", "loky"])
def test_robots_that_fail_do_not_end_a_study_anywhere(model, task, partly, engine):
    assert study(model, task, robots=2, engine=engine, workers=2, **FEW).rows == partly.rows


def test_a_fit_that_does_not_converge_is_not_tried_again(model, task, tmp_path, monkeypatch):
    fit, tried = studying.attempt, []

    def one_fails(model, campaign, options):
        tried.append(len(campaign))
        if len(tried) == 3:
            raise FitError("no minimum after 100 iterations")
        return fit(model, campaign, options)

    monkeypatch.setattr(studying, "attempt", one_fails)
    case = {**CASES, "plans": ("random",), "models": ("all",), "engine": "sequential", "resume": tmp_path / "s.json"}
    made = study(model, task, robots=4, **case)
    assert [(row["robot"], row["failed"]) for row in made.failed] == [(2, "no minimum after 100 iterations")]
    (line,) = made.summary()
    assert line["median_mm"] == pytest.approx(np.median([row["rms_mm"] for row in made.rows if not row["failed"]]))
    assert study(model, task, robots=4, **case).rows == made.rows
    assert len(study(model, task, robots=5, **case).failed) == 1
    assert len(tried) == 5


def test_a_study_of_which_nothing_is_fitted_says_why(model, task):
    with pytest.raises(FitError, match=r"none of the 4 campaigns could be fitted: .* too few"):
        study(model, task, robots=2, engine="sequential", **{**FEW, "counts": (3,)})


def test_every_robot_plan_count_and_model_has_its_row(rows):
    keys = [(row["robot"], row["plan"], row["count"], row["model"]) for row in rows]
    assert len(set(keys)) == len(keys) == 4 * 2 * 2
    assert {row["robot"] for row in rows} == {0, 1, 2, 3}
    assert all(0 < row["rms_mm"] <= row["max_mm"] for row in rows)
    assert len({row["rms_mm"] for row in rows}) == len(rows)  # every robot is another, and measured anew


def test_a_study_fits_without_judging_growth_and_predicts_as_identify_does(model, task, rows, monkeypatch):
    """Growth beyond the measured range takes as long as the fit, and moves no prediction."""
    made, fits = [], studying.attempt

    def kept(model, campaign, options):
        made.append((campaign, options, fits(model, campaign, options)))
        return made[-1][-1]

    with monkeypatch.context() as patch:
        patch.setattr(studying, "attempt", kept)
        patch.setattr(fitting, "growth_of", None)  # called by none
        assert study(model, task, robots=1, engine="sequential", **CASES).rows == rows[: len(rows) // 4]
    campaign, options, fitted = made[0]
    whole = identify(model, campaign, options=options)
    assert whole.range_growth == fitted.with_growth().range_growth > fitted.calibration.range_growth == 0.0
    np.testing.assert_array_equal(whole.z, fitted.calibration.z)
    np.testing.assert_array_equal(whole.z_spread, fitted.calibration.z_spread)


@pytest.mark.parametrize(("engine", "workers"), [("threading", 2), ("loky", 2)])
def test_engine_and_workers_do_not_change_the_rows(model, task, rows, engine, workers):
    assert study(model, task, robots=4, engine=engine, workers=workers, **CASES).rows == rows


def test_fewer_robots_are_the_first_of_more(model, task, rows):
    assert study(model, task, robots=2, engine="sequential", **CASES).rows == rows[: len(rows) // 2]


def test_another_seed_draws_other_robots(model, task, rows):
    other = study(model, task, robots=1, engine="sequential", **{**CASES, "seed": 4}).rows
    assert not {row["rms_mm"] for row in rows} & {row["rms_mm"] for row in other}


def test_an_interrupted_study_goes_on_where_it_was(model, task, rows, tmp_path):
    path, seen = tmp_path / "study.json", []

    def interrupt(done: int, total: int) -> None:
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        study(model, task, robots=4, engine="sequential", resume=path, progress=interrupt, **CASES)
    assert sorted(json.loads(path.read_text())["robots"]) == ["0", "1"]
    # what is there is not computed again
    marked = json.loads(path.read_text())
    marked["robots"]["0"][0]["max_mm"] = 77.0
    path.write_text(json.dumps(sealed(without_seal(marked)[0])))
    resumed = study(
        model, task, robots=4, engine="sequential", resume=path, progress=lambda done, _: seen.append(done), **CASES
    ).rows
    assert seen == [2, 3, 4]
    assert resumed[0]["max_mm"] == 77.0
    assert resumed[1:] == rows[1:]


@pytest.fixture(scope="module")
def begun(model, task, tmp_path_factory) -> str:
    """The file of a study of one robot."""
    path = tmp_path_factory.mktemp("begun") / "study.json"
    study(model, task, robots=1, engine="sequential", resume=path, **CASES)
    return path.read_text()


@pytest.mark.parametrize(
    "changed",
    [
        {"seed": 5},
        {"model_error": 1e-4},
        {"counts": (9,)},
        {"models": ("all",)},
        {"plans": ("grid",)},
        {"robot": "scaled"},
    ],
)
def test_a_file_of_another_study_is_refused(model, task, begun, tmp_path, changed):
    path = tmp_path / "study.json"
    path.write_text(begun)
    if "robot" in changed:
        tolerances = replace(model.robot.tolerances, translation=2e-3)
        description = {**model.robot.description, "tolerance": {"translation_mm": 2.0, "rotation_mrad": 0.3}}
        model, changed = ErrorModel(replace(model.robot, tolerances=tolerances, description=description)), {}
    with pytest.raises(FileError, match="holds a study of other settings; name another file"):
        study(model, task, robots=1, engine="sequential", resume=path, **{**CASES, **changed})
    assert path.read_text() == begun


@pytest.mark.parametrize("model_error", [0.0, pytest.param(None, marks=pytest.mark.long), 2e-4])
def test_stated_and_achieved_errors_agree_with_a_model_error(model, task, model_error):
    """Robots that are off by a model error are measured and used with it, and the closed form says how well that goes."""
    made = study(
        model, task, robots=24, counts=(20,), plans=("grid",), model_error=model_error, engine="sequential", seed=1
    )
    u = 5e-5 if model_error is None else model_error
    assert made.model_error == pytest.approx(u)
    assert made.model_error_origin.startswith("Gutiérrez" if model_error is None else "as given")
    q = studying.reach_task(model, studying.measuring_task(model, task), 20, 0).q
    campaign, _ = simulate(model, q, rng=np.random.default_rng(0), x=np.zeros(len(model)))
    goal = studying.reach_task(model, task, 200, 1)
    stated = design(model, campaign, goal, model_error=(u,)).expected_error(np.arange(len(model)))
    (line,) = made.summary()
    assert 0.9 < line["rms_mm"] / (stated * 1e3) < 1.1
    assert 0.9 < line["rms_with_model_error_mm"] / (np.hypot(stated, np.sqrt(3.0) * u) * 1e3) < 1.1


@pytest.mark.parametrize("content", ["", "{", "[]", "{}", '{"study": "x", "robots": {"first": []}}', "id,J1\n"])
def test_a_file_that_holds_no_study_is_refused(model, task, tmp_path, content):
    path = tmp_path / "study.json"
    path.write_text(content)
    with pytest.raises(FileError, match="does not hold a study"):
        study(model, task, robots=1, engine="sequential", resume=path, **CASES)
    assert path.read_text() == content


def test_an_edited_study_is_refused_by_the_key(model, task, begun, tmp_path):
    path, content = tmp_path / "study.json", json.loads(begun)
    content["robots"]["0"][0]["rms_mm"] *= 1e-3
    path.write_text(json.dumps(content))
    with pytest.raises(FileError, match=r"was edited .*: 'robots' changed; restore it, or remove it to start afresh"):
        study(model, task, robots=1, engine="sequential", resume=path, **CASES)


def test_unknown_names_are_refused_with_the_known_ones(model, task):
    with pytest.raises(UnknownName, match=r"model 'al'.*'all'"):
        study(model, task, robots=1, counts=(8,), plans=("grid",), models=("al",))
    with pytest.raises(UnknownName, match=r"engine 'threads'.*threading"):
        study(model, task, robots=1, counts=(8,), plans=("grid",), engine="threads")
    with pytest.raises(TaskcalError, match=r"plans\[0\] is 'planed'.*'planned'"):
        study(model, task, robots=1, counts=(8,), plans=iter(["planed"]))
    plain = ErrorModel(load_robot("ur5"))
    q = np.random.default_rng(0).uniform(-1, 1, (20, 6))
    with pytest.raises(TaskcalError, match="nothing is published of ur5"):
        study(
            plain, Task(name="listed", poses=plain.poses(q), joints=q), robots=1, counts=(8,), plans=("grid",),
            models=("published",),
        )  # fmt: skip


def test_the_summary_counts_over_the_robots(model, task):
    made = study(model, task, robots=5, engine="sequential", counts=(10,), plans=("grid",))
    (line,) = made.summary()
    values = [row["rms_mm"] for row in made.rows]
    assert line["median_mm"] == sorted(values)[2]
    assert line["rms_mm"] == pytest.approx(np.sqrt(np.mean(np.square(values))))
    assert min(values) <= line["p05_mm"] <= line["median_mm"] <= line["p95_mm"] <= max(values)
    assert list(made.to_frame()["rms_mm"]) == values


def test_planned_poses_are_worth_more_than_random_ones(model):
    made = study(model, reference_task(), robots=4, engine="sequential", counts=(20,), plans=("planned", "random"))
    planned, random = made.summary()
    assert (planned["plan"], random["plan"]) == ("planned", "random")
    assert planned["rms_mm"] < 0.8 * random["rms_mm"]


@pytest.mark.long
def test_selected_model_matches_full_and_beats_published(model):
    """One orientation measured; errors inside it and up to 40° outside, over 60 true robots."""
    task = reference_task()
    chosen = select(model, task, model_error=0.0)
    expected = {nested.size: nested.expected for nested in chosen.ladder}
    assert expected[len(chosen.kept)] <= 1.02 * expected[len(model)]
    fits = {"all": {}, "selected": {"keep": chosen.kept}, "published": {"keep": published_kept(model), "prior": None}}
    measured = reach_task(model, task, 60).q
    new = [reach_task(model, reference_task(np.radians(angle)), 100, 9).q for angle in (0.0, 40.0)]
    squares = {name: [] for name in fits}
    for seed in range(60):
        campaign, truth = simulate(model, measured, rng=np.random.default_rng(seed))
        for name, options in fits.items():
            found = identify(model, campaign, gross_errors="keep", **options)
            squares[name].append([np.mean(((found.predict(q) - truth.points(q)) ** 2).sum(axis=2)) for q in new])
    rms = {name: np.sqrt(np.mean(each, axis=0)) for name, each in squares.items()}
    worse = {name: np.mean(np.array(each) > np.array(squares["all"]), axis=0) for name, each in squares.items()}
    inside, outside = rms["selected"] / rms["all"]
    assert inside < 1.03, rms
    assert outside < 1.1, rms
    inside, outside = rms["published"] / rms["all"]
    assert inside > 1.05, rms
    assert outside > 2.0, rms
    assert np.all(worse["published"] > 0.7), worse


def test_study_compares_instruments_after_frame_teaching(tmp_path):
    """Instruments are compared by the task error after the frames were taught."""
    ways = {"observe": ("tracker", "socket", "camera"), "counts": (30,), "plans": ("random",), "seed": 3}
    more = {"robots": 3, "engine": "sequential", "model_error": 1e-4, "resume": tmp_path / "study.json"}
    seen = study(virtual_task.MODEL, virtual_task.TASK, **ways, **more)
    assert [(row["robot"], row["observe"]) for row in seen.rows[:4]] == [
        (0, "tracker"), (0, "socket"), (0, "camera"), (1, "tracker"),
    ]  # fmt: skip
    assert len(seen.before) == 3
    for row in seen.rows:
        assert 0.0 < row["rms_mm"] < 0.8e3 * seen.before[row["robot"]]
    assert study(virtual_task.MODEL, virtual_task.TASK, **ways, **more).rows == seen.rows
    with pytest.raises(FileError, match="of other settings"):
        study(virtual_task.MODEL, virtual_task.TASK, **{**ways, "observe": ("socket",)}, **more)
    with pytest.raises(TaskcalError, match="plans for a tracker alone"):
        study(virtual_task.MODEL, virtual_task.TASK, **{**ways, "plans": ("planned",)}, **more)


def test_a_row_says_how_many_poses_were_asked_for(model, task, monkeypatch):
    """Where fewer can be had, as of a small pool, the number stays what the table is sorted by."""
    monkeypatch.setattr("taskcal.planning.study.POOL_POSES", 25)
    made = study(model, task, robots=1, counts=(40,), plans=("random",), engine="sequential")
    assert [row["count"] for row in made.rows] == [40]


def test_an_accuracy_is_judged_at_single_poses():
    """With the model error that each of them has, not by the geometry alone; and its quantiles are those of the robots."""
    rng = np.random.default_rng(0)
    geometry = rng.uniform(0.1, 0.3, 20)
    single = np.hypot(geometry, 0.25)
    rows = tuple(
        {"robot": i, "observe": "tracker", "plan": plan, "count": 10, "model": "all", "max_mm": 1.0, "failed": ""}
        | {"rms_mm": factor * geometry[i], "rms_with_model_error_mm": factor * single[i]}
        for i in range(20)
        for plan, factor in (("grid", 1.0), ("random", 2.0))
    )
    accuracy = float(np.median(single))
    made = studying.Study(rows=rows, robots=20, seed=0, accuracy=1e-3 * accuracy, before=tuple(1e-3 * single))
    for line, factor in zip(made.summary(), (1.0, 2.0), strict=True):
        assert line["share_accurate"] == np.mean([value <= accuracy for value in factor * single])
        assert line["rms_with_model_error_mm"] ** 2 == pytest.approx(np.mean((factor * single) ** 2))
        assert line["p05_mm"] == pytest.approx(factor * np.quantile(geometry, 0.05))
        assert line["p95_mm"] == pytest.approx(factor * np.quantile(geometry, 0.95))
    assert made.summary()[0]["share_accurate"] == 0.5
    spread = [made.spread_before()[key] for key in ("p05", "median", "p95")]
    np.testing.assert_allclose(spread, 1e-3 * np.quantile(single, [0.05, 0.5, 0.95]))
