"""Fit options, as the command line is told them."""

import pytest
import typer

from taskcal.cli.options.fit import FitCommandOptions, FramesChoice, GrossErrorsChoice, LossChoice, PriorChoice
from taskcal.errors import TaskcalError
from taskcal.estimation.prior import Huber
from taskcal.identification.options import FitOptions
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.cli.conftest import IRB6660


@pytest.fixture(scope="module")
def model() -> ErrorModel:
    return ErrorModel(load_robot(IRB6660))


@pytest.fixture(scope="module")
def campaign(model: ErrorModel):
    import numpy as np

    rng = np.random.default_rng(0)
    return simulate(model, rng.uniform(-0.5, 0.5, (5, 6)), rng=rng)[0]


def test_by_default_the_fit_is_the_library_s(model, campaign) -> None:
    options, default = vars(FitCommandOptions().options(model, campaign)), vars(FitOptions())
    assert type(options.pop("loss")) is type(default.pop("loss"))
    assert options == default


def test_millimetres_become_metres_and_words_what_they_mean(model, campaign) -> None:
    options = FitCommandOptions(
        keep="J2,J3",
        prior=PriorChoice.none,
        loss=LossChoice.huber,
        frames=FramesChoice.fixed,
        model_error_mm=0.05,
        gross_errors=GrossErrorsChoice.keep,
        target_within_mm=1500.0,
        mpe_to_sigma=0.577,
    ).options(model, campaign)
    assert (options.keep, options.prior, options.frames, options.gross_errors) == (("J2", "J3"), None, "fixed", "keep")
    assert isinstance(options.loss, Huber)
    assert options.model_error == pytest.approx(50e-6)
    assert options.target_within == pytest.approx(1.5)
    assert options.noise is not None
    assert options.noise.mpe_to_sigma == pytest.approx(0.577)


def test_published_and_none_stand_for_sets(model, campaign) -> None:
    assert FitCommandOptions(keep="none").options(model, campaign).keep == ()
    published = FitCommandOptions(keep="published").options(model, campaign).keep
    assert published is not None
    assert set(published) == set(model.names) - set(model.robot.published.dropped)


def test_nothing_published_is_said(campaign) -> None:
    other = ErrorModel(load_robot("ur10"))
    with pytest.raises(TaskcalError, match="names no publication"):
        FitCommandOptions(keep="published").options(other, campaign)


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        ({"prior": PriorChoice.none, "prior_scale": 2.0}, "--prior-scale / --prior"),
        ({"model_error_mm": -1.0}, "--model-error-mm"),
        ({"model_error_mm": float("nan")}, "--model-error-mm"),
        ({"prior_scale": 0.0}, "--prior-scale"),
        ({"mpe_to_sigma": 0.0}, "--mpe-to-sigma"),
        ({"keep": "J1,J1"}, "--keep"),
        ({"lengths_only": True, "keep": "published"}, "--lengths-only / --keep"),
    ],
)
def test_what_cannot_be_meant_is_refused(options, hint) -> None:
    with pytest.raises(typer.BadParameter) as refused:
        FitCommandOptions(**options)
    assert refused.value.param_hint == hint
