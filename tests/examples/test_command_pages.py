"""Every command has a page, made from itself."""

import importlib
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from taskcal.cli.app import EXAMPLES, SUMMARIES

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))
COMMAND_PAGES = importlib.import_module("command_pages")


def test_command_page_names_every_option_and_begins_with_example() -> None:
    pages = COMMAND_PAGES.pages()
    assert set(pages) == {*(f"{name}.rst" for name in SUMMARIES), "list.inc"}
    for name, command in COMMAND_PAGES.commands().items():
        page = pages[f"{name}.rst"]
        for one in (command, *getattr(command, "commands", {}).values()):
            example = getattr(one, "example", "")
            assert example in page
            assert bool(example) != hasattr(one, "commands")
            options = [o for p in one.params if p.param_type_name == "option" and not p.hidden for o in p.opts]
            assert [option for option in options if option not in page] == []


@pytest.mark.parametrize("words", EXAMPLES.values())
def test_example_of_command_is_complete_usage(words: str) -> None:
    """The command takes the line, nothing is missing, and help shows it within 80 columns."""
    _, name, *arguments = shlex.split(words)
    command: Any = COMMAND_PAGES.commands()[name]
    if inner := getattr(command, "commands", {}).get(next(iter(arguments), "")):
        command, arguments = inner, arguments[1:]
    given, left, _ = command.make_parser(typer.Context(command)).parse_args(arguments)
    assert left == []
    assert [
        p.name for p in command.params if p.required and not isinstance(given.get(p.name), str | list | tuple)
    ] == []
    assert len(f"  Example: {words}") <= 80
