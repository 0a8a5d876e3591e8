"""``--drift`` of taskcal identify and validate."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from taskcal.reading.reader import read_campaign
from taskcal.reading.writer import write_campaign
from taskcal.robot.catalogue import load_robot
from tests.cli.conftest import IRB6660, Run

NESTS = np.array([[3.0, -1.5, -0.3], [3.5, -1.7, -0.3], [3.2, -2.3, -0.35]])


@pytest.fixture(params=["moving", "still"])
def nested(request: pytest.FixtureRequest, cell: Path, tmp_path: Path) -> tuple[str, Path]:
    """A campaign with three reference points beside a base that wanders away, or does not."""
    robot = load_robot(IRB6660)
    campaign = read_campaign(cell / "one.csv", robot)
    rng = np.random.default_rng(0)
    moved = np.linspace(0.0, 1e-3, len(campaign))[:, None] * [1.0, 0.0, 0.5] * (request.param == "moving")
    seen = NESTS + moved[:, None] + rng.normal(scale=3e-6, size=(len(campaign), 3, 3))
    reference_points = {f"base{i + 1}": seen[:, i] for i in range(3)}
    path = tmp_path / "nested.csv"
    write_campaign(
        path, replace(campaign, points=campaign.points + moved[:, None], reference_points=reference_points), robot
    )
    return request.param, path


def test_drift_of_reference_points_is_compensated_and_reported(
    run: Run, nested: tuple[str, Path], tmp_path: Path
) -> None:
    """Moving reference points are followed, and the user is informed."""
    kind, path = nested
    cal = tmp_path / "cal.json"
    ended = run("identify", "--robot", IRB6660, path, "-o", cal, "--json")
    done = ended.json["drift"]
    assert done["followed"] == (kind == "moving")
    assert done["noise_mm"] == pytest.approx(0.003, rel=0.25)
    told = (
        "the reference points moved by up to 0.5"
        if kind == "moving"
        else "the reference points moved no more than their noise"
    )
    assert told in " ".join(ended.err.split())
    assert ended.json["fitted"]["rms_mm"] < 0.05
    checked = run("validate", cal, path, "--json")
    assert checked.json["rms_mm"] == pytest.approx(ended.json["fitted"]["rms_mm"], rel=1e-6)


def test_reference_points_may_be_ignored(run: Run, nested: tuple[str, Path], tmp_path: Path) -> None:
    kind, path = nested
    ended = run("identify", "--robot", IRB6660, path, "-o", tmp_path / "cal.json", "--drift", "ignore", "--json")
    assert ended.json["drift"] is None
    assert ("course in doubt: tracker or base moved" in ended.err) == (kind == "moving")
    assert kind == "moving" or ended.err == ""
    assert (ended.json["fitted"]["rms_mm"] > 0.1) == (kind == "moving")
