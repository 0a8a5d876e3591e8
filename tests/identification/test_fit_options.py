"""The options of a fit: one frozen value, checked as it is made, by keywords or whole."""

import re
from dataclasses import FrozenInstanceError, fields, replace

import numpy as np
import pytest

from taskcal.errors import UnknownName
from taskcal.estimation.prior import Huber, Squared
from taskcal.identification.effects import EffectSearch, ExplainChoices, explain, select_effects
from taskcal.identification.identify import identify
from taskcal.identification.options import FitChoices, FitOptions
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from tests.laws.campaigns import measure
from tests.laws.robots import industrial, industrial_positions


@pytest.fixture(scope="module")
def measured():
    rng = np.random.default_rng(5)
    model = ErrorModel(robot_from(industrial(rng)))
    x = rng.normal(size=len(model)) * model.tolerances
    return model, measure(rng, model, industrial_positions(rng, 40), x, sigma=2e-5)[0]


def test_keywords_are_the_fields_of_the_value() -> None:
    names = {f.name for f in fields(FitOptions)}
    assert set(FitChoices.__annotations__) == names | {"options"}
    assert set(ExplainChoices.__annotations__) == names | {"options"} | {f.name for f in fields(EffectSearch)}


def test_keywords_replace_what_is_in_the_whole() -> None:
    whole = FitOptions(keep=("J2",), loss=Huber(1.2), prior_scale=2.0)
    some = FitOptions.of(options=whole, prior_scale=3.0, keep=(name for name in ["J3", "J4"]))
    assert (some.keep, some.loss, some.prior_scale) == (("J3", "J4"), Huber(1.2), 3.0)
    assert (whole.keep, whole.prior_scale) == (("J2",), 2.0)
    assert FitOptions.of(options=whole, loss=None).loss == Squared()
    with pytest.raises(FrozenInstanceError):
        whole.prior_scale = 1.0


def test_a_fit_by_keywords_is_the_fit_by_the_value(measured) -> None:
    model, campaign = measured
    keep, fixed = [name for name in model.names if name.startswith("J2.")], {"model_error": 1e-4, "prior_scale": 1.5}
    by_name = identify(model, campaign, keep=keep, loss=Huber(), **fixed)
    whole = identify(model, campaign, options=FitOptions(keep=tuple(keep), loss=Huber(), **fixed))
    np.testing.assert_array_equal(by_name.z, whole.z)
    assert by_name.provenance.options == whole.provenance.options
    assert by_name.provenance.options["keep"] == keep == list(by_name.kept)


def test_explain_is_the_selection_by_keywords(measured) -> None:
    model, campaign = measured
    options, search = FitOptions(model_error=0.0, prior_scale=1.0), EffectSearch(effects=[EncoderGain()], folds=2)
    whole = select_effects(model, campaign, search, options=options)
    by_name = explain(model, campaign, effects=[EncoderGain()], folds=2, options=options)
    assert [stage.parameters for stage in whole.stages] == [len(model), len(model) + 6]
    assert by_name.summary() == whole.summary()
    assert by_name.calibration.provenance.options["prior_scale"] == 1.0


BEYOND = [
    ({"model_error": -1e-4}, "model_error is -0.0001; give 'estimate', or metres from 0 to 1"),
    ({"model_error": 1e305}, "model_error is 1e+305; give 'estimate', or metres from 0 to 1"),
    ({"model_error": (1e-4, float("inf"))}, "model_error is (0.0001, inf)"),
    ({"model_error": float("nan")}, "model_error is nan"),
    ({"prior_scale": 0.0}, "prior_scale is 0.0; give 'estimate', or a factor from 1e-06 to 1e+06"),
    ({"prior_scale": 1e-320}, "prior_scale is 1e-320"),
    ({"prior_scale": 1e7}, "prior_scale is 10000000.0"),
    ({"outlier_level": 0.0}, "outlier_level is 0.0; give a chance between 0 and 1"),
    ({"outlier_level": 1.0}, "outlier_level is 1.0"),
]


@pytest.mark.parametrize(("option", "message"), BEYOND, ids=lambda value: str(value)[:30])
def test_fit_options_reject_out_of_range_numbers_everywhere(measured, option, message) -> None:
    """A number that is impossible for any campaign is rejected at every entry point."""
    makers = (
        lambda: FitOptions(**option),
        lambda: FitOptions.of(**option),
        lambda: replace(FitOptions(), **option),
        lambda: identify(*measured, **option),
        lambda: explain(*measured, **option),
    )
    for make in makers:
        with pytest.raises(ValueError, match=re.escape(message)):
            make()


def test_bounds_themselves_are_taken() -> None:
    for option in ({"model_error": 0.0}, {"model_error": (1.0, 1.0)}, {"prior_scale": 1e-6}, {"prior_scale": 1e6}):
        assert FitOptions(**option)


def test_fit_options_name_valid_options_if_unknown() -> None:
    """An unknown option is rejected with a list of the valid options."""
    with pytest.raises(TypeError, match="no option 'nose' of a fit; there are keep, prior, loss, noise"):
        FitOptions.of(nose=1.0)


def test_parameters_of_an_effect_are_kept_beside_those_named(measured) -> None:
    assert FitOptions().keeping(["E1.gain"]).keep is None
    assert FitOptions(keep=("J2",)).keeping(["E1.gain"]).keep == ("J2", "E1.gain")
    model, campaign = measured
    with pytest.raises(UnknownName):
        identify(model, campaign, keep=["J77"])


def test_a_file_holds_every_number_of_the_loss(measured) -> None:
    assert FitOptions().described(*measured)["loss"] == {"kind": "squared"}
    assert FitOptions(loss=Huber(1.2)).described(*measured)["loss"] == {"kind": "huber", "threshold": 1.2}
