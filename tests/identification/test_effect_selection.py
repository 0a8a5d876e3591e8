"""What geometry cannot explain enters where the data prove it, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import chdtri

from taskcal.errors import FitError
from taskcal.identification.calibration import load_calibration
from taskcal.identification.effects import MIN_EVIDENCE_GAIN, explain, untried_effects
from taskcal.identification.group_search import find_group_model
from taskcal.identification.identify import identify
from taskcal.identification.options import EffectSearch, FitOptions
from taskcal.robot.catalogue import load_robot
from taskcal.robot.conditions import Conditions, conditions_in_order
from taskcal.robot.effects import SOFT, Backlash, Compliance, Coupling, EncoderGain, Harmonics, Overshoot, candidates
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal.virtual.cell import draw_defects, simulate
from tests.laws.urdfs import telescopic_column
from tests.realdata.scores import plain, splits

CHEAP = (EncoderGain(), Harmonics(orders=(1,), tolerance=1e-4), Compliance(), Coupling())
"""Few parameters, for tests that are not about those of many."""


def poses(robot, rng, count):
    limits = np.clip(robot.limits, -0.9, 0.9)
    return rng.uniform(limits[:, 0], limits[:, 1], (count, len(limits)))


@pytest.fixture(scope="module")
def robot():
    return load_robot("abb-irb120")


def errors_of(fits, truth, unseen):
    return np.array([np.linalg.norm(fit.predict(unseen) - truth.points(unseen), axis=2).mean() for fit in fits])


@pytest.mark.long
def test_auto_equals_geometry_if_robot_has_no_effects(robot):
    """For a robot without effects the prediction with `auto` is that of the geometric model."""
    model, ratios, picked = ErrorModel(robot), [], 0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        campaign, truth = simulate(model, poses(robot, rng, 60), rng=rng)
        found = explain(model, campaign)
        one, plain = errors_of((found.calibration, identify(model, campaign)), truth, poses(robot, rng, 100))
        ratios.append(one / plain)
        picked += bool(found.effects)
    assert np.median(ratios) < 1.02
    assert max(ratios) < 1.1
    assert picked <= 1


@pytest.mark.parametrize(
    ("true", "tried"),
    [
        pytest.param(Compliance(), CHEAP, id="Compliance among few"),
        *(
            pytest.param(effect, None, marks=pytest.mark.long, id=type(effect).__name__)
            for effect in (Compliance(), Harmonics(orders=(1,)), EncoderGain(), Backlash(), Overshoot())
        ),
    ],
)
def test_auto_predicts_nearly_as_well_as_known_effect(robot, true, tried):
    """What looking for all others costs is a few micrometres where nothing but the tracker errs besides."""
    model, errors = ErrorModel(robot), []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        q, unseen = poses(robot, rng, 80), poses(robot, rng, 100)
        conditions = conditions_in_order(robot, q)
        campaign, truth = simulate(model + true, q, rng=rng, conditions=conditions)
        found = explain(model, campaign, candidates=tried)
        fits = found.calibration, identify(model + true, campaign), identify(model, campaign)
        errors.append(errors_of(fits, truth, unseen))
    error, best, without = np.mean(errors, axis=0)
    assert error < best + 5e-6
    assert error < 0.8 * without


TWO = (Harmonics(orders=(1, 2, 9)), EncoderGain())


@pytest.mark.parametrize(
    ("true", "tried"),
    [
        pytest.param((), None, id="none", marks=pytest.mark.long),
        pytest.param(TWO, None, id="two", marks=pytest.mark.long),
        pytest.param(TWO, (*TWO, Compliance(), Coupling()), id="two among few"),
    ],
)
def test_stated_regions_hold_as_often_as_they_say(robot, true, tried):
    """Over virtual robots, of the true points at new poses."""
    model, inside = ErrorModel(robot), []
    truly = model
    for effect in true:
        truly = truly + effect
    for seed in range(5):
        rng = np.random.default_rng(seed)
        campaign, truth = simulate(truly, poses(robot, rng, 60), rng=rng)
        found, unseen = explain(model, campaign, candidates=tried).calibration, poses(robot, rng, 200)
        error = (found.predict(unseen) - truth.points(unseen))[:, 0]
        C = found.predict_covariance(unseen)[:, 0]
        square = np.einsum("ni,ni->n", error, np.linalg.solve(C, error[..., None])[..., 0])
        inside.append(np.mean(square < chdtri(3, 0.05)))
    assert 0.92 < np.mean(inside) <= 1.0


@pytest.mark.slow
def test_a_coupled_wrist_with_a_long_tool_is_found():
    description = load_robot("abb-irb120").description
    long = robot_from({**description, "tool": [{"tx_mm": 200.0}, {"ty_mm": 80.0}, {"tz_mm": 150.0}]})
    model = ErrorModel(long)
    for seed in range(2):
        rng = np.random.default_rng(seed)
        x = draw_defects(model + Coupling(), rng)
        x[-3:] = 1e-3, -5e-4, 1e-3
        campaign, _ = simulate(model + Coupling(), poses(long, rng, 60), rng=rng, x=x)
        found = explain(model, campaign, candidates=CHEAP, folds=3)
        assert found.effects == (Coupling(),)
        named = dict(zip(found.calibration.names, found.calibration.estimate, strict=True))
        assert named["J5.by_J4"] == pytest.approx(1e-3, abs=3e-4)


def test_candidates_suit_what_is_known_of_a_robot():
    def suited(robot):
        return {type(effect).__name__ for effect in candidates(robot, Conditions())}

    everywhere = {"EncoderGain", "Harmonics", "Compliance"}
    assert everywhere <= suited(load_robot("ur5"))
    assert not {"Coupling", "Spring", "MotorHarmonics"} & suited(load_robot("ur5"))  # its wrist's axes do not meet
    for name in ("abb-irb120", "fanuc-r2000ic-165f", "abb-irb6660-205-1.9", "barrett-wam"):
        assert "Coupling" in suited(load_robot(name))
    description = load_robot("ur5").description
    spring = {"rate_n_mm": 9.0, "free_length_mm": 100.0, "crank_mm": 90.0, "anchor_mm": 200.0, "aligned_deg": 0.0}
    joints = [{**description["joint"][0], "gear_ratio": 100.0}, *description["joint"][1:]]
    assert {"Spring", "MotorHarmonics"} <= suited(
        robot_from({**description, "joint": joints, "spring": {"joint": "J2", **spring}})
    )


def test_auto_keeps_likelier_of_effects_with_equal_parameters(robot):
    """Of two effects with the same parameters, only the likelier one is kept."""
    model, rng = ErrorModel(robot), np.random.default_rng(2)
    campaign, _ = simulate(model + SOFT, poses(robot, rng, 60), rng=rng)
    one = Harmonics(orders=(1,))
    found = explain(model + one, campaign, candidates=(*CHEAP, SOFT), folds=3)
    names = found.calibration.model.names
    assert len(names) == len(set(names))
    assert not {Compliance(), SOFT} <= set(found.calibration.model.effects)
    assert found.calibration.model.effects[0] == one


def test_effect_table_states_gain_of_all_and_of_each_effect(robot):
    """The table states the gain of all effects together and the contribution of each."""
    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + Harmonics(orders=(1,)), poses(robot, rng, 80), rng=rng)
    found = explain(model, campaign, candidates=CHEAP, folds=4)
    first, whole = found.steps
    assert (first.name, first.accepted, first.log_evidence) == ("geometry", True, None)
    assert whole.accepted
    assert whole.log_evidence > 10
    assert whole.worth == pytest.approx(first.cross_validated - whole.cross_validated)
    assert {stage.name for stage in found.worths} == {effect.name for effect in CHEAP}
    assert [stage.accepted for stage in found.worths] == [True, False, False, False]
    assert found.worths[0].name == "gear harmonics of order 1"
    assert found.worths[0].worth == pytest.approx(found.worths[0].cross_validated - whole.cross_validated)
    assert [effect.name for effect in found.effects] == ["gear harmonics of order 1"]
    assert found.calibration.model.effects == CHEAP
    assert 5e-6 < found.tracker < 5e-5


def test_effects_survive_saving(robot, tmp_path):
    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + EncoderGain() + Harmonics(), poses(robot, rng, 60), rng=rng)
    made = identify(model + EncoderGain(), campaign)
    made.save(tmp_path / "cal.json")
    loaded = load_calibration(tmp_path / "cal.json")
    unseen = poses(robot, rng, 30)
    assert loaded.model.effects == made.model.effects
    np.testing.assert_array_equal(loaded.predict(unseen), made.predict(unseen))
    np.testing.assert_array_equal(loaded.predict_covariance(unseen), made.predict_covariance(unseen))


def test_defects_are_drawn_for_effects_too(robot):
    model = ErrorModel(robot) + Harmonics()
    x = draw_defects(model, np.random.default_rng(0))
    assert np.all(x[len(ErrorModel(robot)) :] != 0.0)


ZEROS = tuple(f"J{number}.rz" for number in range(1, 7))


def soft_arm(seed, moving=None, still=(), rows=20):
    """A UR5 whose drives yield ten times as much as usual, of which some joints move and some parameters are exact."""
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(seed)
    q = poses(model.robot, rng, rows) / 0.6
    held = [j for j in range(6) if moving is not None and j not in moving]
    q[:, held] = np.array([0.3, -1.0, 1.2, -0.5, 0.7, 0.2])[held]
    true = model + Compliance()
    x = draw_defects(true, rng)
    x[len(model) :] *= 10.0
    x[model.indices(still)] = 0.0
    return model, *simulate(true, q, rng=rng, x=x), rng


def test_explain_finds_effects_where_geometry_explains_nothing():
    """Two joints of six move under a load: without effects only tracker frame and targets can be found."""
    model, campaign, truth, _ = soft_arm(1, moving=(1, 2), still=ErrorModel(load_robot("ur5")).names)
    alone = identify(model, campaign)
    assert not len(alone.estimated)
    assert "Only tracker frame and targets were fitted" in alone.remarks[0]
    found = explain(model, campaign, candidates=CHEAP)
    assert "compliance" in [effect.name for effect in found.effects]
    one, frames = errors_of((found.calibration, alone), truth, campaign.q)
    assert one < 0.1 * frames


def test_explain_falls_back_to_registration_if_uninformative():
    """`explain` falls back to the registration if no parameter explains the rows."""
    model, campaign, _, _ = soft_arm(1, moving=(1, 2), still=ErrorModel(load_robot("ur5")).names)
    found = explain(model, campaign, candidates=(EncoderGain(joints=("J6",)),))
    assert not len(found.calibration.estimated)
    assert "Only tracker frame and targets were fitted" in found.calibration.remarks[0]
    assert "effects were tried and are not part of the calibration" in found.calibration.remarks[-1]


def test_joint_zeros_alone_are_learnt_beside_parameters_not_kept():
    """What is considered beside them makes them uncertain, but does not keep them from explaining the rows."""
    model, campaign, truth, rng = soft_arm(2, rows=60)
    kept, alone = (identify(model, campaign, keep=keep) for keep in (ZEROS, ()))
    assert kept.kept == ZEROS
    assert not any("Only tracker frame" in remark for remark in kept.remarks)
    by_zeros, by_frames = errors_of((kept, alone), truth, poses(model.robot, rng, 100) / 0.6)
    assert by_zeros < by_frames


def test_explain_converges_at_fifteen_rows():
    """Folds of twelve rows have fewer numbers than unknowns, and their fits creep."""
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(4)
    q, true = poses(model.robot, rng, 15), model + Harmonics(orders=(1, 2))
    x = draw_defects(true, rng)
    x[len(model) :] *= 4.0
    campaign, _ = simulate(true, q, rng=rng, x=x)
    assert len(identify(model, campaign.take(np.arange(12))).estimated) == len(model)
    assert explain(model, campaign, candidates=CHEAP).calibration.estimated.any()


@pytest.mark.parametrize(
    ("at_ends", "said"),
    [
        pytest.param(False, "neighbouring poses left out together worse", id="groups"),
        pytest.param(True, "ends of the joints' ranges worse", id="ends"),
    ],
)
def test_effects_are_dropped_if_neighbours_or_ends_are_predicted_worse(robot, monkeypatch, at_ends, said):
    """Effects are dropped if geometry predicts groups of neighbouring poses, or the ends of the joints' ranges, better."""
    from taskcal.identification import effects as module

    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + Harmonics(orders=(1,)), poses(robot, rng, 60), rng=rng)
    assert explain(model, campaign, candidates=CHEAP).effects
    errors_of = module.errors_of_parts

    def better_without(fitted, parts, effects=()):
        errors = errors_of(fitted, parts, effects)
        return replace(errors, whole=0.01 * errors.whole) if not effects and (len(parts) == 12) == at_ends else errors

    monkeypatch.setattr(module, "errors_of_parts", better_without)
    found = explain(model, campaign, candidates=CHEAP)
    assert not found.effects
    assert found.calibration.model == model
    assert said in found.steps[-1].reason
    assert found.steps[-1].reason in found.calibration.remarks[-1]


def test_neighbours_that_are_worse_within_their_scatter_are_no_veto(robot, monkeypatch):
    from taskcal.identification import effects as module

    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + Harmonics(orders=(1,)), poses(robot, rng, 60), rng=rng)
    errors_of = module.errors_of_parts

    own: list[np.ndarray] = []
    share = np.array([0.1, 1.05, 1.05, 1.05, 1.05])  # one group far better without, the others a little worse

    def scattered(fitted, parts, effects=()):
        errors = errors_of(fitted, parts, effects)
        if effects:
            own.append(errors.whole)
        return errors if effects or len(parts) == 12 else replace(errors, whole=share * own[0])

    monkeypatch.setattr(module, "errors_of_parts", scattered)
    assert explain(model, campaign, candidates=CHEAP).effects
    assert np.mean(share * own[0]) < np.mean(own[0])


def test_a_robot_without_effects_gets_none_if_other_errors_are_likelier():
    """Errors of joints and weights of poses alone may be likelier and seem better: that is no effect."""
    model, campaign = plain(0)
    rows = next(iter(splits(model, campaign, (1, 0, 0))))[1]
    found = explain(model, campaign.take(rows))
    assert found.steps[-1].worth > 0.0
    assert found.steps[-1].log_evidence > MIN_EVIDENCE_GAIN
    assert found.steps[-1].reason.endswith("but without the evidence for it")
    assert not found.effects
    assert found.calibration.model == model


def test_an_effect_that_harms_the_ends_is_not_proven(robot, monkeypatch):
    from taskcal.identification import group_search as module

    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + EncoderGain(), poses(robot, rng, 60), rng=rng)
    assert explain(model, campaign, candidates=CHEAP).effects == (EncoderGain(),)
    validate = module.validate_groups

    def harmed(*arguments):
        errors = validate(*arguments)
        without = dict.fromkeys(errors.ends.without, 0.5 * errors.ends.whole)
        return replace(errors, ends=replace(errors.ends, without=without))

    monkeypatch.setattr(module, "validate_groups", harmed)
    found = explain(model, campaign, candidates=CHEAP)
    assert not found.effects
    assert "predicted better without" in next(
        stage.reason for stage in found.worths if stage.name == EncoderGain().name
    )


def test_a_socket_left_out_whole_is_found_from_its_own_rows():
    model, rng = ErrorModel(load_robot("ur5")), np.random.default_rng(0)
    q = poses(model.robot, rng, 80)
    campaign, _ = simulate(model + Harmonics(orders=(1,)), q, rng=rng, observe="socket", places=2)
    (kind,) = campaign.observations
    parts = [np.flatnonzero(kind.of == number) for number in np.unique(kind.of)]
    one = find_group_model(
        identify(model, campaign), campaign, CHEAP, (), parts, FitOptions(), seed=0, progress=lambda _: None
    )
    assert np.nanmean(one.errors.whole) < 2e-3


def test_a_robot_with_driven_joints_says_why_no_effect_was_tried(tmp_path):
    (tmp_path / "column.urdf").write_text(telescopic_column())
    model = ErrorModel(load_robot(tmp_path / "column.urdf"))
    rng = np.random.default_rng(0)
    limits = np.clip(model.robot.limits, -1.5, 1.5)
    campaign, _ = simulate(model, rng.uniform(*limits.T, (50, len(limits))), rng=rng, model_error=3e-4)
    found = explain(model, campaign)
    assert len(found.steps) == 1
    assert "others drive (lift2)" in found.untried["all effects"]
    assert "no effect was tried: all effects: column has joints that others drive" in found.calibration.remarks[-1]


def test_effects_that_are_not_tried_are_named_with_the_reason(robot):
    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model, poses(robot, rng, 40), rng=rng)
    untried = untried_effects(model, campaign, EffectSearch())
    assert untried["thermal expansion"] == "not every row states the temperature"
    assert untried["spring"] == "the robot file states no spring"
    assert "compliance" not in untried


@pytest.mark.parametrize(("gain", "enters"), [(2.9, False), (3.1, True)])
def test_effects_enter_with_evidence_of_more_than_three_alone(robot, monkeypatch, gain, enters):
    """Although they predict held-out rows better: where a model is hardly more probable, that may be chance."""
    from taskcal.identification import effects as module

    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model + Harmonics(orders=(1,)), poses(robot, rng, 60), rng=rng)
    found_by = module.find_group_model

    def as_probable(base, *arguments, **options):
        one = found_by(base, *arguments, **options)
        return replace(one, calibration=replace(one.calibration, log_evidence=base.log_evidence + gain))

    monkeypatch.setattr(module, "find_group_model", as_probable)
    found = explain(model, campaign, candidates=CHEAP)
    together = found.steps[-1]
    assert together.worth > 0.0
    assert together.log_evidence == pytest.approx(gain)
    assert together.accepted == enters == bool(found.calibration.model.effects)
    assert ("without the evidence for it" in together.reason) != enters


@pytest.mark.parametrize("advice", ["; check the campaign's rows", ". Measure more poses; check the rows"])
def test_a_model_that_cannot_be_fitted_is_remarked_by_its_reason(robot, monkeypatch, advice):
    """The geometry stays, and what the refusal advises about a model of effects is of no use there."""
    from taskcal.identification import effects as module

    def refuse(*arguments, **options):
        raise FitError(f"the fit of geometry and effects ran away{advice}")

    model, rng = ErrorModel(robot), np.random.default_rng(0)
    campaign, _ = simulate(model, poses(robot, rng, 40), rng=rng)
    monkeypatch.setattr(module, "find_group_model", refuse)
    found = explain(model, campaign, candidates=CHEAP, folds=3)
    assert found.effects == ()
    assert found.calibration.model == model
    assert found.calibration.remarks[-1].endswith(": the fit of geometry and effects ran away")
