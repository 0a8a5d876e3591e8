"""Messages about the values of options."""

from pathlib import Path

import pytest

from taskcal.cli.command import in_users_words
from tests.cli.conftest import TASK, Run


@pytest.mark.parametrize(
    ("option", "said"),
    [
        (["--count", "many"], "'many' is not a whole number; write for example 10"),
        (["-n", "1.5"], "'1.5' is not a whole number"),
        (["--count=0"], "'0' must be 1 or more"),
        (["--seed", "1", "--seed", "x"], "'x' is not a whole number"),
        (["--model-error-mm", "thin"], "'thin' is not a number; write for example 0.5"),
        (["--criterion", "X"], "'X' is not one of 'task'"),
    ],
)
def test_the_value_and_what_to_write_are_said(run: Run, tmp_path: Path, option: list[str], said: str) -> None:
    (tmp_path / "task.toml").write_text(TASK)
    ended = run("plan", "--robot", "abb-irb120", "--task", tmp_path / "task.toml", "-o", tmp_path / "plan.csv", *option)
    assert (ended.status, ended.out) == (2, "")
    assert said in " ".join(ended.err.replace("│", " ").split())
    assert "Input should" not in ended.err
    assert "Value error" not in ended.err


def test_what_is_not_of_the_validator_stays_as_it_is() -> None:
    assert in_users_words("there is no such way", ["--observe"], ["--observe", "x"]) == "there is no such way"
    assert in_users_words("Input should be less than 3", ["CAMPAIGN"], ["plan"]) == "must be below 3"
