"""Errors of nested models on rows left out, against fits of each of them."""

from dataclasses import replace

import numpy as np
import pytest

from taskcal.identification.holdout import predict_left_out, split_postures
from taskcal.identification.identify import identify
from taskcal.planning.selection import left_out_errors
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

MODEL = ErrorModel(load_robot("abb-irb120")) + EncoderGain()


@pytest.mark.parametrize("pose", [False, True], ids=["points", "poses"])
def test_the_errors_are_those_of_fits_without_the_rows(pose):
    limits = np.clip(MODEL.robot.limits, -1.0, 1.0)
    rng = np.random.default_rng(0)
    q = rng.uniform(limits[:, 0], limits[:, 1], (36, 6))
    campaign, _ = simulate(MODEL, q, rng=rng, pose=pose, model_error=1e-4, lost=0.0 if pose else 0.1)
    wrong = campaign.points.copy()
    wrong[7] += 0.05
    campaign = replace(campaign, points=wrong)
    whole = identify(MODEL, campaign, prior_scale=1.0)
    assert [row.row for row in whole.left_out] == [7]
    parts = split_postures(q, 3, 0)
    nested = [np.arange(len(MODEL)), np.arange(3, 20), np.zeros(0, dtype=int)]
    found = left_out_errors(whole, campaign, nested, MODEL.tolerances, parts, None)
    held = whole.model_error if pose else whole.model_error[0]
    for kept, errors in zip(nested, found, strict=True):
        keep = [MODEL.names[i] for i in kept]

        def fit(part, keep=keep):
            rows = part.without(np.isin(part.ids, campaign.ids[7:8]))
            return identify(MODEL, rows, keep=keep, model_error=held, prior_scale=1.0, gross_errors="keep")

        expected = predict_left_out(fit, campaign, parts)
        np.testing.assert_array_equal(np.isnan(errors), np.isnan(expected))
        # the whole model is nonlinear by some micrometres over the millimetres that the smallest one leaves
        np.testing.assert_allclose(errors, expected, rtol=0.01, atol=6e-6)
