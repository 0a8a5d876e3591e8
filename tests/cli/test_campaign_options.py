"""What commands are told of a campaign."""

from pathlib import Path

import numpy as np
import pytest
import typer

from taskcal.cli.options.campaign import CampaignOptions, DriftChoice, MeasuredOptions
from taskcal.errors import TaskcalError
from taskcal.robot.catalogue import load_robot
from tests.cli.conftest import IRB6660, Run


def test_without_a_word_all_is_used(cell: Path) -> None:
    read = CampaignOptions().read(cell / "three.csv", load_robot(IRB6660))
    assert read.rows == tuple(range(30))
    assert read.campaign is read.whole
    assert read.campaign.targets == ("smr1", "smr2", "smr3")
    assert read.drift is None


def test_rows_and_targets_are_chosen(cell: Path) -> None:
    options = CampaignOptions(rows="3:8", targets="smr3,smr1")
    read = options.read(cell / "three.csv", load_robot(IRB6660), targets=["smr2"])
    assert set(read.campaign.targets) == {"smr1", "smr3"}
    np.testing.assert_array_equal(read.campaign.q, read.whole.q[3:8])
    assert [read.campaign.row_of(i) for i in range(5)] == list(read.rows) == [3, 4, 5, 6, 7]


def test_the_targets_of_the_command_count_where_the_user_names_none(cell: Path) -> None:
    assert CampaignOptions().read(cell / "three.csv", load_robot(IRB6660), targets=["smr2"]).campaign.targets == (
        "smr2",
    )


@pytest.mark.parametrize(("field", "option"), [("targets", "--targets"), ("reference_points", "--reference-points")])
@pytest.mark.parametrize("text", ["a,,b", "a,a", ""])
def test_a_wrong_list_is_refused_before_anything_is_read(field: str, option: str, text: str) -> None:
    with pytest.raises(typer.BadParameter) as refused:
        CampaignOptions(**{field: text})
    assert refused.value.param_hint == option


def test_reference_points_that_the_campaign_does_not_have_are_named(cell: Path) -> None:
    with pytest.raises(TaskcalError, match="wall"):
        CampaignOptions(reference_points="wall").read(cell / "three.csv", load_robot(IRB6660))


def test_nests_names_reference_points_too(run: Run, cell: Path, tmp_path: Path) -> None:
    ended = run("identify", "--robot", IRB6660, cell / "three.csv", "-o", tmp_path / "cal.json", "--nests", "wall")
    assert ended.status == 1
    assert "'wall'" in ended.err


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"rows": "0:9"}, "--rows"),
        ({"targets": "a"}, "--targets"),
        ({"reference_points": "a"}, "--reference-points"),
        ({"drift": DriftChoice.ignore}, "--drift"),
    ],
)
def test_how_to_read_a_campaign_asks_for_one(options: dict[str, str], named: str) -> None:
    with pytest.raises(typer.BadParameter, match="--campaign") as refused:
        MeasuredOptions(**options)  # pyright: ignore[reportArgumentType]
    assert refused.value.param_hint == named
    assert MeasuredOptions(campaign=Path("c.csv"), **options).campaign == Path("c.csv")  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize("command", ["select", "sensitivity", "plan", "report"])
def test_a_command_without_a_campaign_refuses_its_options(run: Run, cell: Path, tmp_path: Path, command: str) -> None:
    asked: dict[str, list[object]] = {
        "select": ["--robot", IRB6660, "--task", cell / "list.toml"],
        "sensitivity": ["--robot", IRB6660, "--task", cell / "list.toml"],
        "plan": ["--robot", IRB6660, "--task", cell / "list.toml", "-o", tmp_path / "plan.csv"],
        "report": [cell / "cal.json"],
    }
    ended = run(command, *asked[command], "--rows", "0:9")
    assert (ended.status, ended.out) == (2, "")
    assert "--campaign" in ended.err


def test_sensitivity_uses_the_rows_that_were_chosen(run: Run, cell: Path) -> None:
    asked = ("sensitivity", "--robot", IRB6660, "--campaign", cell / "one.csv", "--json")
    assert run(*asked, "--rows", "0:20").json["poses"] == 20
    assert run(*asked).json["poses"] == 60
