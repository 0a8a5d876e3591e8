"""The options of a fit: one frozen value, checked as it is made, by keywords or whole."""

import re
from dataclasses import FrozenInstanceError, fields, replace
from inspect import signature

import numpy as np
import pytest

from taskcal.arguments import by_name, chosen_options
from taskcal.errors import UnknownName
from taskcal.identification.effects import ExplainOptions, explain, select_effects
from taskcal.identification.identify import identify
from taskcal.identification.options import EffectSearch, FitOptions
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.robot.robot_file import robot_from
from taskcal_groundwork.options import options_of
from tests.laws.campaigns import measure
from tests.laws.robots import industrial, industrial_positions


@pytest.fixture(scope="module")
def measured():
    rng = np.random.default_rng(5)
    model = ErrorModel(robot_from(industrial(rng)))
    x = rng.normal(size=len(model)) * model.tolerances
    return model, measure(rng, model, industrial_positions(rng, 40), x, sigma=2e-5)[0]


def test_keywords_are_the_fields_of_the_value() -> None:
    for function, kind in ((identify, FitOptions), (explain, ExplainOptions)):
        parameters, values = signature(function).parameters, {one.name: one for one in fields(kind)}
        assert list(parameters) == ["model", "campaign", "options", *values]
        assert all(parameters[name].default == one.default for name, one in values.items())
        assert all(one.option.help in str(function.__doc__) for one in options_of(kind))
    assert {f.name for f in (*fields(FitOptions), *fields(EffectSearch))} | {"progress"} == set(values)


def test_keywords_replace_what_is_in_the_whole() -> None:
    whole = FitOptions(keep=("J2",), frames="fixed", prior_scale=2.0)
    given = by_name(FitOptions)(
        lambda kind, model, campaign, options=None, **named: chosen_options(kind, options, **named)
    )
    some = given(None, None, options=whole, prior_scale=3.0, keep=(name for name in ["J3", "J4"]))
    assert (some.keep, some.frames, some.prior_scale) == (("J3", "J4"), "fixed", 3.0)
    assert (whole.keep, whole.prior_scale) == (("J2",), 2.0)
    assert given(None, None, whole) is whole
    with pytest.raises(FrozenInstanceError):
        whole.prior_scale = 1.0


def test_a_fit_by_keywords_is_the_fit_by_the_value(measured) -> None:
    model, campaign = measured
    keep, fixed = [name for name in model.names if name.startswith("J2.")], {"model_error": 1e-4, "prior_scale": 1.5}
    by_name = identify(model, campaign, keep=keep, **fixed)
    whole = identify(model, campaign, options=FitOptions(keep=tuple(keep), **fixed))
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
    ({"model_error": -1e-4}, "model_error: -0.1 mm is not from 0 mm to 1000 mm"),
    ({"model_error": 1e305}, "model_error: 1e+308 mm is not from 0 mm to 1000 mm"),
    ({"model_error": (1e-4, float("inf"))}, "model_error: inf mm is not from 0 mm"),
    ({"model_error": float("nan")}, "model_error is nan"),
    ({"prior_scale": 0.0}, "prior_scale: 0 is not from 1e-06 to 1e+06"),
    ({"prior_scale": 1e-320}, "prior_scale: 9.99989e-321 is not"),
    ({"prior_scale": 1e7}, "prior_scale: 1e+07 is not"),
    ({"outlier_level": 0.0}, "outlier_level: 0 is not between 0 and 1"),
    ({"outlier_level": 1.0}, "outlier_level: 1 is not"),
]


@pytest.mark.parametrize(("option", "message"), BEYOND, ids=lambda value: str(value)[:30])
def test_fit_options_reject_out_of_range_numbers_everywhere(measured, option, message) -> None:
    """A number that is impossible for any campaign is rejected at every entry point."""
    makers = (
        lambda: FitOptions(**option),
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
    with pytest.raises(TypeError, match="no option 'nose' of identify; there are keep, prior, frames"):
        identify(None, None, nose=1.0)


def test_parameters_of_an_effect_are_kept_beside_those_named(measured) -> None:
    assert FitOptions().keeping(["E1.gain"]).keep is None
    assert FitOptions(keep=("J2",)).keeping(["E1.gain"]).keep == ("J2", "E1.gain")
    model, campaign = measured
    with pytest.raises(UnknownName):
        identify(model, campaign, keep=["J77"])
