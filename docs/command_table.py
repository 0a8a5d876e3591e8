"""The directive ``commands``: what ``taskcal … --help`` says, command by command, read when the pages are built."""

import os
import subprocess
import sys
from typing import Any

import typer
from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from taskcal.cli import app as command_line


def every_command() -> list[str]:
    """All commands in the order of ``taskcal --help``, each followed by its own subcommands."""
    group: Any = typer.main.get_command(command_line)
    names: list[str] = []
    for name in group.list_commands(None):
        names.append(name)
        names += [f"{name} {inner}" for inner in getattr(group.commands[name], "commands", {})]
    return names


def read_help(name: str) -> str:
    """The help of one command, as plain text."""
    plain = {**os.environ, "TYPER_USE_RICH": "0", "COLUMNS": "100", "PYTHONIOENCODING": "utf-8"}
    code = "import sys; from taskcal.cli import main; sys.exit(main())"
    arguments = [sys.executable, "-c", code, *name.split(), "--help"]
    return subprocess.run(arguments, env=plain, capture_output=True, encoding="utf-8", check=True).stdout.strip()


class Commands(SphinxDirective):
    """A section for each command."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        sections: list[nodes.Node] = []
        for name in every_command():
            title = f"taskcal {name}"
            section = nodes.section("", nodes.title(text=title), ids=[nodes.make_id(title)], names=[title])
            section += nodes.literal_block(text=read_help(name), language="text")
            sections.append(section)
        return sections


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True}
