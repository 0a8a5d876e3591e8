"""Names that an attacker chose: in files that commands read, nothing of them commands a terminal or a page."""

import re
from pathlib import Path

import pytest

from tests.taskcal_studio.hostile_project import write_campaign, write_robot

COMMANDS = set("\x1b\x07\x9b")


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hostile")
    write_robot(folder / "robot.toml")
    write_campaign(folder / "measured.csv")
    (folder / "broken.csv").write_text((folder / "measured.csv").read_text(encoding="utf-8").replace(",", ",x", 40))
    return folder


@pytest.mark.slow
def test_commands_escape_control_sequences_and_markup_in_names(run, hostile: Path) -> None:
    """Names with terminal control sequences or markup are escaped on the terminal and in reports."""
    robot, campaign, saved = (hostile / name for name in ("robot.toml", "measured.csv", "c.json"))
    page = hostile / "page.html"
    commands = [
        ["robots", robot],
        ["convert", campaign, "--robot", robot, "-o", hostile / "plain.csv"],
        ["identify", "--robot", robot, campaign, "-o", saved, "--parameters"],
        ["validate", saved, campaign],
        ["doctor", campaign, "--robot", robot],
        ["doctor", hostile / "broken.csv", "--robot", robot],
        ["report", saved, "--output", page],
    ]
    for command in commands:
        for form in ([], ["--json"]) if command[0] == "validate" else ([],):
            ended = run(*command, *form)
            assert ended.out + ended.err
            assert not COMMANDS & set(ended.out + ended.err), command[0]
            assert "Taskcal itself failed" not in ended.err, ended.err
    assert "\\x1b" in run("robots", robot).out
    shown = page.read_text(encoding="utf-8")
    assert "window.attacked" in shown
    assert "<img src=x" not in re.sub(r"<script type=.application/json.*?</script>", "", shown, flags=re.DOTALL)
    assert "<script>window.attacked" not in shown
