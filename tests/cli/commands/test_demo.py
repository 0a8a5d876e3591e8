"""The demonstration: its page, its files, and what it prints where."""

import contextlib
import io
import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

import taskcal as tc
from taskcal.campaigns.campaign import Campaign
from taskcal.cli import main
from taskcal.identification.calibration import Calibration
from taskcal.identification.identify import identify
from taskcal.robot.effects import SOFT, WarmUp
from taskcal.robot.effects.gears import GEARS
from taskcal.robot.error_model import ErrorModel
from taskcal_demo.closed_loop import prepare_closed_loop
from tests.cli.conftest import Run


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "new" / "folder"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """What `--json` says of a run, and its folder."""
    folder = tmp_path_factory.mktemp("demo") / "new"
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main(["demo", "--json", "--count", "20", "--seed", "4", "--output", str(folder)]) == 0
    return json.loads(out.getvalue()), folder


@pytest.mark.slow
def test_it_leaves_a_page_and_data_that_read_back(whole: tuple[dict[str, Any], Path]) -> None:
    found, folder = whole
    assert found["seed"] == 4
    assert found["elimination"]["one orientation"]["rank"] == 24
    assert found["elimination"]["±20°"]["rank"] == 25
    assert (found["mechanism"]["mobility"], found["mechanism"]["overconstraint"]) == (6, 3)
    assert sorted(path.name for path in folder.iterdir()) == sorted(Path(file).name for file in found["files"].values())
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert page.count("<svg") > 5
    assert len(page) < 2e6
    model = tc.ErrorModel(tc.load_robot("abb-irb6660-205-1.9"))
    for label, name in (("one orientation", "one-orientation"), ("±20°", "several-orientations")):
        campaign = tc.read_campaign(folder / f"campaign-{name}.csv", model.robot)
        calibration = tc.load_calibration(folder / f"calibration-{name}.json")
        assert len(campaign) == 20
        residual = tc.validate(calibration, campaign).maximum * 1e3
        said = next(f for f in found["fits"] if f["campaign"] == label and f["parameters"] == len(model))
        assert residual == pytest.approx(said["residual"]["max_mm"], abs=1e-5)


@pytest.mark.slow
def test_demo_prints_tables_and_is_reproducible_from_seed(
    run: Run, whole: tuple[dict[str, Any], Path], tmp_path: Path
) -> None:
    """The demo prints its tables and next steps, and the same seed gives the same files."""
    first, folder = whole[1], tmp_path / "b"
    ended = run("demo", "--count", "20", "--seed", "4", "-o", str(folder))
    assert ended.status == 0
    for part in (
        "45 parameters",
        "overconstrained",
        "Of the published 33",
        "Residuals",
        "Errors on new poses",
        "Summary",
    ):
        assert part in ended.out
    assert str(folder / "report.html") in ended.out
    assert "taskcal identify --robot" in ended.out
    for name in ("campaign-one-orientation.csv", "campaign-several-orientations.csv"):
        assert (first / name).read_bytes() == (folder / name).read_bytes()


def test_a_file_where_the_folder_should_be_is_1(run: Run, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("mine")
    ended = run("demo", "-o", str(tmp_path / "taken"))
    assert ended.status == 1
    assert ended.out == ""
    assert "--output" in ended.err
    assert (tmp_path / "taken").read_text() == "mine"


def test_too_few_poses_are_wrong_usage(run: Run, folder: Path) -> None:
    assert run("demo", "--count", "2", "-o", str(folder)).status == 2
    assert not folder.exists()


def test_unkind_truths_without_the_closed_loop_are_wrong_usage(run: Run, folder: Path) -> None:
    ended = run("demo", "--unkind", "-o", str(folder))
    assert ended.status == 2
    assert "--full" in ended.err
    assert not folder.exists()


@pytest.mark.long
def test_demo_closed_loop_program_can_be_reproduced(run: Run, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With named effects and a short program, for the search and the planning take minutes."""

    def named_effects(model: ErrorModel, campaign: Campaign) -> Calibration:
        return identify(model + SOFT + GEARS + WarmUp().referred(campaign.conditions), campaign)

    small = partial(prepare_closed_loop, poses=40, rows=2, candidates=50)
    monkeypatch.setattr("taskcal_demo.closed_loop.prepare_closed_loop", small)
    monkeypatch.setattr("taskcal_demo.closed_loop.find_effects", named_effects)
    ended = run("demo", "--full", "--unkind", "--robots", "1", "--count", "10", "--json", "-o", str(folder))
    assert ended.status == 0
    unkind = ended.json["closed_loop_unkind"]
    assert list(unkind) == ["axis_wobble", "twice_as_large"]
    assert [list(some[0]) for some in unkind.values()] == [list(ended.json["closed_loop"][0])] * 2
    (robot,) = ended.json["closed_loop"]
    assert robot["before_max_mm"] > 1.0 > 0.5 > robot["touched_off_max_mm"] > 2.0 * robot["after_max_mm"]
    assert robot["effects"] == ["compliance (expected σ 3 mrad)", GEARS.name, "warming up in 60 min"]
    files = {label: Path(path) for label, path in ended.json["files"].items()}
    again = run(
        "correct", "-c", files["calibration for milling"], "--cell", files["cell"], files["touched-off program"], "-o",
        folder / "again.mod", "--json",
    )  # fmt: skip
    assert again.status == 0
    assert (folder / "again.mod").read_bytes() == files["corrected program"].read_bytes()
    assert "From measurement to a corrected program" in files["page of the closed loop"].read_text(encoding="utf-8")
