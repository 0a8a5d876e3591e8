"""Rows that the doctor's findings concern."""

import numpy as np

from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from taskcal_studio.pages.measurements_page import concerned_rows


def test_findings_map_row_ids_and_ignore_other_subjects() -> None:
    """Rows are found by their ids, and other subjects are not rows."""
    rng = np.random.default_rng(0)
    campaign, _ = simulate(ErrorModel(load_robot("ur5")), rng.uniform(-1.0, 1.0, (6, 6)), rng=rng)
    part = campaign.take([1, 3, 5])
    findings = [
        {"id": "gross-rows", "subject": [part.ids[2], "of another file"]},
        {"id": "rows-shifted", "subject": [part.ids[0]]},
        {"id": "joint-sign", "subject": ["J3"]},
    ]
    assert concerned_rows(findings, part) == {2: "gross-rows"}
    assert concerned_rows([], part) == {}
