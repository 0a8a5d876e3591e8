"""Of every public result `summary` is the report; `to_json` is what is kept in a file and read back."""

import dataclasses
import json
from typing import Any

import numpy as np

import taskcal as tc
from tests.public.test_repr import TYPES, results  # noqa: F401  (a fixture)

PERSISTED = {tc.Calibration}
"""With `load_calibration`."""

REPORTED = {
    tc.Calibration, tc.Correction, tc.Plan, tc.Selection, tc.Study, tc.Validation, tc.analysis.DistinguishableDirections,
    tc.export.ControllerOffsets, tc.export.Loss, tc.identification.Explanation, tc.identification.ResidualAnalysis,
    tc.performance.PathPerformance, tc.performance.PosePerformance,
}  # fmt: skip


def test_every_result_reports_by_summary() -> None:
    assert set(TYPES) >= REPORTED
    assert {cls.__name__ for cls in REPORTED if not callable(getattr(cls, "summary", None))} == set()


def test_only_what_is_read_back_has_to_json() -> None:
    own = {cls for cls in TYPES if "to_json" in vars(cls) and not issubclass(cls, tc.effects.Effect)}
    assert own == PERSISTED


def reports(results: dict[str, Any]) -> dict[str, Any]:  # noqa: F811
    calibration, campaign = results["calibration"], results["campaign"]
    told_apart = results["identifiability"].distinguishable(noise=1e-4)
    study = tc.Study(
        rows=(
            {
                "observe": "tracker",
                "plan": "random",
                "count": 30,
                "model": "all",
                "rms_mm": 0.1,
                "rms_with_model_error_mm": 0.2,
                "failed": "",
            },
        ),
        robots=1,
        seed=0,
    )
    return {
        **{
            name: results[name]
            for name in ("plan", "selection", "explanation", "validation", "correction", "calibration")
        },
        "study": study,
        "told apart": told_apart,
        "analysis": tc.identification.analyse_residuals(calibration, campaign, permutations=2),
        "offsets": tc.export.fit_offsets(calibration, campaign.q),
        "loss": tc.export.export_urdf(calibration, campaign.q).loss,
        "pose": tc.performance.assess_pose(np.random.default_rng(0).normal(size=(5, 3)) * 1e-5),
    }


def test_a_report_can_be_written_as_json(results: dict[str, Any]) -> None:  # noqa: F811
    for name, result in reports(results).items():
        assert dataclasses.is_dataclass(result), name
        text = json.dumps(result.summary(), allow_nan=False)
        assert len(text) > 30, name
