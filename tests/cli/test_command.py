"""Former names of options, and the list of effects under a command's help."""

import re
from pathlib import Path

import pytest

from taskcal.cli.command import RENAMED, with_new_names
from tests.cli.conftest import IRB6660, Run


@pytest.mark.parametrize("former", RENAMED)
@pytest.mark.parametrize("value", [["0.1"], []], ids=["apart", "joined"])
def test_a_former_name_works_and_is_warned_of(
    capsys: pytest.CaptureFixture[str], former: str, value: list[str]
) -> None:
    name = RENAMED[former]
    written, meant = ([former, *value], [name, *value]) if value else ([f"{former}=0.1"], [f"{name}=0.1"])
    assert with_new_names(["plan", *written], {name}) == ["plan", *meant]
    warning = capsys.readouterr().err
    assert warning == f"warning: {former} is called {name} now; the old name goes with the next release\n"


@pytest.mark.parametrize(
    ("arguments", "options"),
    [
        (["--accuracy", "1"], {"--other"}),
        (["--accuracy", "1"], {"--accuracy", "--accuracy-mm"}),
        (["--", "--accuracy"], {"--accuracy-mm"}),
        (["--accuracy-mm", "1"], {"--accuracy-mm"}),
        (["--accurac", "1"], {"--accuracy-mm"}),
    ],
    ids=["of another command", "still its own", "a file", "today's", "misspelt"],
)
def test_nothing_else_is_replaced(capsys: pytest.CaptureFixture[str], arguments: list[str], options: set[str]) -> None:
    assert with_new_names(arguments, options) == arguments
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("command", "former"),
    [
        ("identify", "--nests"),
        ("identify", "--model-error"),
        ("identify", "--target-within"),
        ("register", "--nests"),
        ("validate", "--nests"),
        ("sensitivity", "--model-error"),
        ("select", "--accuracy"),
        ("select", "--model-error"),
        ("plan", "--extend"),
        ("plan", "--model-error"),
        ("study", "--model-error"),
    ],
)
def test_every_command_that_had_a_former_name_still_takes_it(run: Run, command: str, former: str) -> None:
    ended = run(command, former, "1", "--help")
    assert ended.status == 0
    assert f"{former} is called {RENAMED[former]} now" in ended.err
    assert RENAMED[former] in ended.out


def test_a_former_name_gives_the_same_result(run: Run, cell: object) -> None:
    asked = ("sensitivity", "--robot", IRB6660, "--campaign", f"{cell}/one.csv", "--json")
    former, today = run(*asked, "--model-error", "0.05"), run(*asked, "--model-error-mm", "0.05")
    assert former.out == today.out
    assert today.json["told_apart"]["model_error_mm"] == pytest.approx(0.05)
    assert (former.err, today.err) == (
        "warning: --model-error is called --model-error-mm now; the old name goes with the next release\n",
        "",
    )


def test_the_documentation_lists_the_former_names() -> None:
    page = (Path(__file__).parents[2] / "docs" / "reference" / "command-line.md").read_text(encoding="utf-8")
    assert dict(re.findall(r"^\| `(--[a-z-]+)` \| `(--[a-z-]+)` \|$", page, re.MULTILINE)) == RENAMED


@pytest.mark.parametrize("command", ["identify", "plan", "select"])
def test_the_help_ends_with_the_effects(run: Run, command: str) -> None:
    assert "compliance" in run(command, "--help").out.split("Effects:")[1]


def test_the_help_of_a_command_without_effects_does_not(run: Run) -> None:
    assert "Effects:" not in run("validate", "--help").out
