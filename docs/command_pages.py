"""A page for each command of the command line, made from the command itself, and the list of all of them."""

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import typer
from generated import heading, write_pages

from taskcal.cli import app as command_line
from taskcal.cli.app import SUMMARIES

if TYPE_CHECKING:
    from sphinx.application import Sphinx


def commands() -> Mapping[str, Any]:
    """Commands by name, in the order of ``taskcal --help``."""
    group: Any = typer.main.get_command(command_line)
    return {name: group.commands[name] for name in group.list_commands(None)}


def pages() -> dict[str, str]:
    """The page of each command, and the list."""
    listed = [".. list-table::\n   :widths: 30 70\n"]
    for name, text in SUMMARIES.items():
        listed += [f"   * - :doc:`taskcal {name} </reference/commands/{name}>`\n     - {_plain(text)}"]
    listed += ["\n.. toctree::\n   :hidden:\n", *(f"   /reference/commands/{name}" for name in SUMMARIES)]
    made = {f"{name}.rst": "\n".join(_page(name, command)) for name, command in commands().items()}
    return made | {"list.inc": "\n".join(listed) + "\n"}


def _page(name: str, command: Any) -> Iterable[str]:
    yield heading(f"taskcal {name}")
    yield from _described(f"taskcal {name}", command, "-")
    for inner, subcommand in getattr(command, "commands", {}).items():
        yield heading(f"taskcal {name} {inner}", "-")
        yield from _described(f"taskcal {name} {inner}", subcommand, "~")


def _described(path: str, command: Any, line: str) -> Iterable[str]:
    """What a command does, an example, and its arguments and options."""
    summary, *more = (command.help or "").split("\n\n")
    yield f"{_plain(summary)}\n"
    if example := getattr(command, "example", ""):
        yield f".. code-block:: text\n\n   {example}\n"
    yield from (f"{_plain(text)}\n" for text in more)
    context = typer.Context(command, info_name=path)
    records = [(p, record) for p in command.get_params(context) if (record := p.get_help_record(context))]
    yield f".. program:: {path}\n"
    for title, kind in (("Arguments", "argument"), ("Options", "option")):
        some = [(parameter.opts, *record) for parameter, record in records if parameter.param_type_name == kind]
        if some:
            yield f".. rubric:: {title}\n"
        for spelled, names, text in some:
            if long := next((name for name in spelled if name.startswith("--")), ""):
                yield f".. index:: ! {long}\n"  # search lists it first
            named = f".. option:: {names}\n" if kind == "option" else f"``{names.partition(' <')[0]}``"
            yield f"{named}\n   {_plain(text)}\n"
    if any("--effects" in parameter.opts for parameter, _ in records):
        yield "Values of ``--effects``: :doc:`/reference/effects`.\n"


def _plain(text: str) -> str:
    """In one line, without the marks of reStructuredText but for those of options."""
    plain = "".join(f"\\{c}" if c in "\\*`_|" else c for c in " ".join(text.split()))
    return re.sub(r"(?<!\S)(--[\w-]+)", r"``\1``\\ ", plain)


def setup(app: "Sphinx") -> dict[str, Any]:
    """Write the pages before Sphinx looks for them."""
    app.connect("config-inited", lambda *_: write_pages("reference/commands", pages()))
    return {"parallel_read_safe": True}
