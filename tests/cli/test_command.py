"""The list of effects under a command's help."""

import pytest

from tests.cli.conftest import Run


@pytest.mark.parametrize("command", ["identify", "plan", "select"])
def test_the_help_ends_with_the_effects(run: Run, command: str) -> None:
    assert "compliance" in run(command, "--help").out.split("Effects:")[1]


def test_the_help_of_a_command_without_effects_does_not(run: Run) -> None:
    assert "Effects:" not in run("validate", "--help").out
