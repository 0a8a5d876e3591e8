"""A calibration's page, tables and figures."""

import re
from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from taskcal.geometry import se3
from taskcal.identification.calibration import Calibration
from taskcal.identification.held_out import HeldOut, LeftOut, Outlier
from taskcal.identification.identify import identify
from taskcal.identification.residual_analysis import Explained, ResidualAnalysis
from taskcal.identification.validation import Validation, validate
from taskcal.observations import Point
from taskcal.report.calibration import (
    calibration_page,
    calibration_sections,
    describe_held_out,
    describe_outliers,
    describe_unobservable,
    draw_against,
    draw_parameters,
    draw_residuals,
    draw_shares,
    held_out_section,
    residual_analysis_section,
    tabulate_errors,
    tabulate_judged,
    tabulate_left_out,
    tabulate_outliers,
    verdict,
)
from taskcal.report.content import Chart, TextTable
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.task.task import reach_task
from taskcal.virtual.cell import Truth, simulate
from taskcal_demo.procedure import reference_task
from tests.report.drawn import axis_titles, series

MODEL = ErrorModel(load_robot("ur5"))


Q = np.random.default_rng(0).uniform(-1.5, 1.5, size=(24, 6))


def page_of(calibration: Calibration) -> str:
    return calibration_page(calibration, calibration_sections(calibration)).html()


@pytest.fixture(scope="module")
def of_poses():
    campaign, _ = simulate(MODEL, Q, rng=np.random.default_rng(1), pose=True)
    return campaign, identify(MODEL, campaign, keep=[], model_error=(4e-4, 3e-4))


def test_page_states_the_validation_of_fitted_rows(of_poses):
    campaign, calibration = of_poses
    summary = validate(calibration, campaign).summary()
    again = Validation.of_residuals(
        calibration.residuals, calibration.T_tracker_base[:3, :3], calibration.layout.observed
    ).summary()
    assert again == pytest.approx(summary)
    table = tabulate_errors({"tool": summary}, of="target")
    page = page_of(calibration)
    assert table.header[0] == "target"
    assert "max mrad" in table.header
    assert all(cell in page for cell in (*table.header[1:], *table.rows[0]))


def test_page_states_model_error_of_rotation(of_poses):
    page = page_of(of_poses[1])
    assert "0.4 mm and 0.3 mrad per axis" in page
    campaign, _ = simulate(MODEL, Q, rng=np.random.default_rng(1))
    of_points = page_of(identify(MODEL, campaign, keep=[]))
    assert " mrad per axis" not in of_points
    assert "from poses" in of_points


def test_errors_table_omits_absent_columns():
    table = tabulate_errors({"a": {"mean_mm": 1.0, "n": 3}, "b": {"mean_mm": 2.0, "max_mrad": 0.5}})
    assert table.header == ("rows", "mean mm", "max mrad", "points")
    assert table.rows == (("a", "1.000", "–", "3"), ("b", "2.000", "0.500", "–"))


def test_page_has_the_terminals_tables() -> None:
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (30, 6)), rng=rng)
    outliers = (Outlier(row=7, line=9, id="p7", target="tool", studentised=6.2, residual=1.5e-3),)
    left_out = (LeftOut(row=3, line=None, id="p3", distance=0.25, studentised=900.0),)
    calibration = replace(identify(model, campaign, keep=["J2"]), outliers=outliers, left_out=left_out)
    assert [row[:6] for row in tabulate_outliers(calibration).rows] == [("7", "9", "p7", "tool", "1.500", "6.2")]
    assert tabulate_left_out(calibration).rows == (("3", "–", "p3", "250.00", "900"),)
    page = page_of(calibration)
    for table in (tabulate_outliers(calibration), tabulate_left_out(calibration)):
        assert all(cell in page for row in table.rows for cell in row[2:])
        assert table.title in page


def outliers_of(count: int) -> tuple[Outlier, ...]:
    return tuple(
        Outlier(row=i, line=i + 2, id=f"p{i}", target="tool", studentised=9.0 - i, residual=1e-3) for i in range(count)
    )


def test_outliers_table_says_reading_or_model_error() -> None:
    table = tabulate_judged(outliers_of(3), (True, False, True), "error mm", mostly=False)
    assert [row[-1] for row in table.rows] == ["model error", "reading", "model error"]
    assert "measuring again does not help" in table.note
    assert "measure again, or leave out" in table.note
    assert len(tabulate_judged(outliers_of(3), (True,) * 3, "error mm", mostly=False, count=2)) == 2


def test_outliers_of_most_points_advise_no_measurement() -> None:
    """Where most points are outliers, none of them is at fault."""
    table = tabulate_judged(outliers_of(3), (True, False, True), "error mm", mostly=True)
    assert {row[-1] for row in table.rows} == {""}
    for text in (table.note, describe_outliers((True, False, True), mostly=True)):
        assert "measure again" not in text
        assert "not those that were calibrated" in text


@pytest.mark.parametrize(
    ("shared", "said"),
    [
        ((), "none"),
        ((False,), "1 outlier, 1 isolated: measure again, or leave out"),
        ((True, True), "2 outliers, 2 with similar errors nearby: model error, do not measure again"),
    ],
    ids=["none", "reading", "model"],
)
def test_outliers_are_counted_by_cause(shared: tuple[bool, ...], said: str) -> None:
    assert describe_outliers(shared, mostly=False) == said


@pytest.mark.parametrize(
    ("before", "after", "held_out", "said"),
    [
        (1.299, 0.617, 9, "falls from 1.299 mm, nominal (registered), to 0.617 mm, calibrated (ratio 2.1, 9 held-out points)."),
        (0.2, 0.3, 4, "does not fall from 0.200 mm, nominal (registered), to 0.300 mm, calibrated (ratio 0.7, 4 held-out points)."),
        (0.2, 0.1, None, "(ratio 2.0, fitted rows, optimistic: none were held out)."),
        (0.2, 0.0, 9, "to 0.000 mm, calibrated (9 held-out points)."),
    ],
    ids=["better", "worse", "fitted", "exact"],
)  # fmt: skip
def test_verdict_names_prediction_error_and_sample(
    before: float, after: float, held_out: int | None, said: str
) -> None:
    text = verdict("ur5", before, after, held_out)
    assert text.startswith("ur5: the mean 3D prediction error ")
    assert text.endswith(said)
    assert "accurate" not in text


def of_lengths(mm, part, folds=0, by="neighbours"):
    residuals = np.asarray(mm, dtype=float)[:, None, None] * np.array([1e-3, 0.0, 0.0])
    return HeldOut(
        by=by, folds=folds, rows=np.arange(len(mm)), part=np.asarray(part), residuals=residuals, nominal=10 * residuals,
        kinds=(Point,),
    )  # fmt: skip


def test_describe_held_out_states_mean_and_standard_error():
    sentence = describe_held_out(of_lengths([0.1, 0.1, 0.3, 0.3], [0, 0, 1, 1]))
    assert "2 groups of neighbouring poses, excluded from the fit" in sentence
    assert "mean 0.200 mm, standard error 0.100 mm" in sentence
    assert "from 0.100 to 0.300 mm" in sentence
    assert "3 folds of blocks" in describe_held_out(of_lengths([0.1, 0.2, 0.3], [0, 1, 2], folds=3, by="blocks"))
    assert "has no standard error" in describe_held_out(of_lengths([0.1, 0.2], [0, 0]))


def test_held_out_section_or_advice(fitted):
    calibration, _ = fitted
    nothing = held_out_section(calibration)
    assert "--folds 5" in nothing.blocks[0].words
    shown = held_out_section(replace(calibration, held_out=of_lengths([0.1, 0.1, 0.3, np.nan], [0, 0, 1, 2])))
    _, errors, parts = shown.blocks
    assert [row[0] for row in errors.rows] == ["nominal (registered)", "calibrated"]
    assert errors.rows[0][5] == "1.667"
    assert parts.rows == (("0", "2", "0.100", "0.100"), ("1", "1", "0.300", "0.300"))


@pytest.mark.parametrize("by", ["rows", "chosen"])
def test_held_out_section_omits_many_parts(fitted, by):
    many = of_lengths(np.linspace(0.1, 0.2, 100), np.arange(100), by=by)
    assert len(held_out_section(replace(fitted[0], held_out=many)).blocks) == 2


IRB6660 = ErrorModel(load_robot("abb-irb6660-205-1.9"))


FAR_TARGETS_M = {"a": np.array([0.6, -0.7, 0.4]), "b": np.array([0.65, -0.7, 0.4]), "c": np.array([0.6, -0.6, 0.45])}


def fitted(q, targets):
    campaign, _ = simulate(IRB6660, q, rng=np.random.default_rng(0), targets=targets)
    return identify(IRB6660, campaign, target_within=2.0)


def said(calibration):
    return describe_unobservable(calibration.layout.registration)


def one_orientation():
    return reach_task(IRB6660, reference_task(), 40).q


def about_one_axis():
    """The tool turns about its own axis alone."""
    q = one_orientation()
    q[:, 5] += np.linspace(-1.5, 1.5, len(q))
    return q


def turning_axis(q):
    """The direction in the tool frame that no pose turns."""
    R = IRB6660.poses(q)[:, :3, :3]
    turns = se3.log(R[0].T @ R[1:])
    return np.linalg.svd(turns)[2][0]


def test_no_warning_if_orientations_are_rich():
    calibration = fitted(reach_task(IRB6660, reference_task(np.radians(20.0)), 40).q, {"a": FAR_TARGETS_M["a"]})
    assert said(calibration) == ("",)
    assert calibration.T_tool_target[0, :3, 3] == pytest.approx(FAR_TARGETS_M["a"], abs=5e-3)


def test_unobservable_target_is_held_at_the_tool_point():
    calibration = fitted(one_orientation(), {"a": FAR_TARGETS_M["a"]})
    assert said(calibration) == ("offset not identifiable from these poses; held at the TCP",)
    assert np.linalg.norm(calibration.T_tool_target[0, :3, 3]) < 1e-5


def test_unobservable_direction_of_a_target_is_named():
    q = about_one_axis()
    calibration = fitted(q, {"a": FAR_TARGETS_M["a"]})
    (sentence,) = said(calibration)
    assert sentence.endswith("held at the TCP there")
    axis = turning_axis(q)
    place = calibration.T_tool_target[0, :3, 3]
    assert np.linalg.norm(place) > 0.5
    assert abs(axis @ place) < 2e-3
    named = sentence.split("along ")[1].split(" of the tool")[0]
    direction = np.eye(3)["xyz".index(named)] if named in "xyz" else np.array(named.strip("()").split(), dtype=float)
    assert abs(direction @ axis) > 0.999


def test_unobservable_mean_of_several_targets():
    calibration = fitted(one_orientation(), FAR_TARGETS_M)
    (sentence,) = set(said(calibration))
    assert sentence == "common offset of all targets not identifiable from these poses; held at the TCP"
    places = calibration.T_tool_target[:, :3, 3]
    assert np.linalg.norm(places.mean(axis=0)) < 1e-5
    expected = np.array(list(FAR_TARGETS_M.values()))
    assert np.linalg.norm(places[1] - places[0]) == pytest.approx(np.linalg.norm(expected[1] - expected[0]), abs=5e-4)


def test_page_names_unobservable_targets():
    calibration = fitted(one_orientation(), FAR_TARGETS_M)
    page = page_of(calibration)
    unlocated = r"<dt>target {}</dt><dd>at [^<]*; common offset of all targets not identifiable"
    assert all(re.search(unlocated.format(name), page) for name in FAR_TARGETS_M)
    assert ": offset not identifiable" not in page


@pytest.fixture(scope="module")
def truth_and_fits(model: ErrorModel, poses: Mapping[str, np.ndarray]) -> tuple[Truth, dict[str, Calibration]]:
    campaign, truth = simulate(model, poses["all"], rng=np.random.default_rng(4))
    return truth, {"frames only": identify(model, campaign, keep=()), "whole": identify(model, campaign)}


def test_residuals_figure_shows_one_model_at_a_time(truth_and_fits: tuple[Truth, dict[str, Calibration]]) -> None:
    fits = truth_and_fits[1]
    views = draw_residuals({"a": fits, "b": fits}, "whole")
    assert list(views) == ["whole", "frames only"]
    figure = views["whole"]
    assert len(series(figure)) == 6
    lengths = np.linalg.norm([one.y for one in series(figure)[:3]], axis=0)
    np.testing.assert_allclose(lengths, 1e3 * np.linalg.norm(fits["whole"].residuals[:, 0], axis=1))
    assert "mm" in axis_titles(figure)


def test_residuals_figure_shows_a_target_of_lengths() -> None:
    """A target of which angles alone were measured has no residual in millimetres."""
    angles, wire = (SimpleNamespace(width=w, angles=a, along_axes=False) for w, a in ((2, 2), (1, 0)))
    residuals = np.arange(24.0).reshape(2, 2, 6)
    some = SimpleNamespace(residuals=residuals, ids=("1", "2"), layout=SimpleNamespace(observed=(angles, wire)))
    (drawn,) = series(draw_residuals({"a": {"m": some}})["m"])
    np.testing.assert_allclose(drawn.y, 1e3 * residuals[:, 1, 0])


def test_parameters_are_drawn_in_millimetres_and_milliradians(
    truth_and_fits: tuple[Truth, dict[str, Calibration]],
) -> None:
    truth, fits = truth_and_fits
    figure = draw_parameters({"whole": fits["whole"]}, truth.x)["whole"]
    calibration, place = fits["whole"], {name: i for i, name in enumerate(fits["whole"].model.names)}
    for trace in series(figure):
        at = [place[name] for name in trace.labels]
        values = truth.x if trace.name == "truth" else calibration.estimate
        np.testing.assert_allclose(trace.x, 1e3 * values[at])
        if trace.name != "truth":
            np.testing.assert_allclose(trace.high - trace.x, 2e3 * calibration.standard_errors[at])
    assert sorted(name for trace in series(figure) for name in trace.labels) == sorted(2 * calibration.model.names)
    assert "geometric error (mm)" in axis_titles(figure)
    assert "geometric error (mrad)" in axis_titles(figure)


def test_parameters_figure_has_a_panel_for_each_unit(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    calibration, _ = fitted
    figure = draw_parameters({"fit": calibration})["fit"]
    titles = [panel.x.label for panel in figure.panels]
    assert titles == ["geometric error (mm)", "geometric error (mrad)", "effect (mrad/m)", "effect (mrad/rad)"]
    drawn = np.concatenate([trace.x for trace in series(figure)])
    np.testing.assert_allclose(np.sort(drawn), np.sort(calibration.estimate * 1e3))


def test_residual_analysis_figures_show_the_first_quantity(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    _, found = fitted
    first = found.explained[0]
    assert first.regressor.name == "position of J3"
    (shares,) = draw_shares(found).panels
    assert shares.y.categories[0] == "position of J3: turn of J3"
    assert shares.series[0].x[0] == pytest.approx(100 * first.share)
    (panel,) = next(iter(draw_against(found).values())).panels
    assert panel.y.label == "residual (mrad)"
    assert panel.x.label == "position of J3 (°)"
    points, line = panel.series
    assert np.all(np.diff(line.x) >= 0.0)
    near = np.interp(points.x, line.x, line.y)
    assert np.corrcoef(near, points.y)[0, 1] > 0.9
    assert 0.5 < np.ptp(line.y) < 3.0  # a milliradian to both sides, less what geometry takes up


def test_shares_are_full_if_significant(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    """A large share by chance, a sure share of next to nothing, and one that is both large and sure."""
    kinds = [r.regressor for r in fitted[1].explained]
    told = [(0.05, 0.20), (0.015, 0.03), (0.004, 0.01), (-0.1, None)]
    nothing = replace(
        fitted[1],
        explained=tuple(Explained(regressor=k, share=s, p_value=p) for k, (s, p) in zip(kinds, told, strict=False)),
    )
    something = replace(
        fitted[1], explained=(Explained(regressor=kinds[0], share=0.012, p_value=0.01), *nothing.explained)
    )
    for found, full in ((nothing, 0), (something, 1)):
        assert series(draw_shares(found))[0].hollow.count(False) == full
        words = str([getattr(block, "items", ()) for block in residual_analysis_section(found).blocks])
        assert ("No tested quantity explains 1 % of it significantly." in words) == (full == 0)
        assert words.count("of the variance") == full


def test_residual_analysis_section_names_significant_quantities(fitted: tuple[Calibration, ResidualAnalysis]) -> None:
    _, found = fitted
    section = residual_analysis_section(found)
    words = str([getattr(block, "items", ()) for block in section.blocks])
    assert "position of J3, by the turn of J3" in words
    assert "move as one body" in words
    assert sum(isinstance(block, Chart) for block in section.blocks) == 2
    table = next(block for block in section.blocks if isinstance(block, TextTable))
    assert len(table) == len(found.explained)
