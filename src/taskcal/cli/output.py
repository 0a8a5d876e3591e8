"""Command output: sections or JSON on standard output, messages on standard error, notes from one run to the next."""

import json
import math
import os
import re
import shlex
import shutil
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any, TextIO

from taskcal.cli.progress import clear_line
from taskcal.errors import FileError, printable, shortened
from taskcal.io.files import write_whole
from taskcal.io.json_file import parse_json
from taskcal.report.content import (
    Block,
    Bullets,
    Chart,
    Commands,
    Facts,
    NextStep,
    Numbers,
    Section,
    Text,
    TextTable,
    Viewer,
    fold,
    lay_out_facts,
    lay_out_table,
)

# Messages and sentences.

MESSAGE_CHARACTERS = 4000
"""Of one message; whatever it repeats of its input is cut."""


def error(message: str) -> None:
    """Write an error on standard error."""
    info(f"error: {message}")


def info(message: str) -> None:
    """Write a message beside the result, on standard error."""
    clear_line()
    with suppress(OSError):  # where that is full or closed, the exit status has to do
        print(_folded(for_terminal(shortened(message, MESSAGE_CHARACTERS)), sys.stderr), file=sys.stderr, flush=True)


def tell(line: str = "") -> None:
    """Write a line of the result on standard output."""
    clear_line()
    print(_folded(for_terminal(line), sys.stdout))


def say(text: str) -> None:
    """Write a sentence of the result, folded between words whatever reads it."""
    clear_line()
    for line in fold(for_terminal(text), line_width()):
        print(line)


def _folded(text: str, stream: TextIO) -> str:
    """A message cut between words for a terminal, which would cut within them; whole where programs read it."""
    if not stream.isatty():
        return text
    width = line_width()
    return "\n".join(part for line in text.split("\n") for part in (fold(line, width) if len(line) > width else [line]))


def for_terminal(text: str) -> str:
    """Text in which a name or a value from a file cannot command the terminal: only line feeds and tabs act."""
    return printable(text, keep="\n\t")


def line_width() -> int:
    """Characters in a line: the terminal's, the value of COLUMNS, or 80."""
    return max(shutil.get_terminal_size((80, 24)).columns, 20)


def started_as() -> str:
    """Name the command line as it was called, or by its bare name where the shell finds it."""
    name = Path(sys.argv[0]).stem if sys.argv and sys.argv[0] else ""
    if name != "taskcal":
        return "taskcal"
    program = shutil.which("taskcal")
    if program and Path(program).exists() and Path(sys.argv[0]).exists() and Path(program).samefile(sys.argv[0]):
        return "taskcal"
    return shlex.quote(sys.argv[0])


@cache
def show_log() -> None:
    """Write on standard error, from now on, what the library reports, such as that it compiles kernels."""
    from logging import INFO, Handler, LogRecord, getLogger

    class Shown(Handler):
        """Each record as a message."""

        def emit(self, record: LogRecord) -> None:
            info(record.getMessage())

    log = getLogger("taskcal")
    log.setLevel(INFO)
    log.addHandler(Shown())


# Sections, tables and labelled lines for people.


def show_sections(sections: Iterable[Section]) -> None:
    """Print sections as a page has them, an empty line between them and about each table; figures are the page's alone."""
    below = False
    for section in sections:
        begins = True
        for kind, blocks in groupby(section.blocks, type):
            for block in [_in_one(blocks)] if kind is NextStep else blocks:
                if isinstance(block, Chart | Viewer) or (isinstance(block, Facts) and not block.items):
                    continue
                if below and (begins or isinstance(block, TextTable)):
                    tell()
                _show_block(block)
                below, begins = not isinstance(block, TextTable), False


def _in_one(steps: Iterable[Block]) -> Facts:
    """Steps as labelled lines."""
    words = [step.words for step in steps if isinstance(step, NextStep)]
    return Facts(*(("" if number else "next", text) for number, text in enumerate(words)))


def _show_block(block: Block) -> None:
    if isinstance(block, TextTable):
        show(block)
    elif isinstance(block, Text):
        say(block.words)
    elif isinstance(block, Bullets):
        show_facts(("•", item) for item in block.items)
    elif isinstance(block, Numbers):
        show_facts((f"{value} {unit}".strip(), what) for value, unit, what in block.items)
    elif isinstance(block, Facts):
        show_facts(block.items)
    elif isinstance(block, Commands):
        tell(block.lines)


def show(table: TextTable) -> None:
    """Print a table, the same that a page shows, with its columns of words set flush left, and an empty line."""
    clear_line()
    width = line_width()
    for line in fold(for_terminal(table.title), width) if table.title else ():
        print(f"\x1b[1m{line}\x1b[0m" if sys.stdout.isatty() and "NO_COLOR" not in os.environ else line)
    groups = [(heading, [[_in_a_cell(cell) for cell in row] for row in rows]) for heading, rows in table.groups]
    without = [table.header.index(name) for name in table.spare if name in table.header]
    for line in lay_out_table([*map(_in_a_cell, table.header)], groups, set(table.text_columns), width, without):
        print(line)
    for line in fold(for_terminal(table.note), width) if table.note else ():
        print(line)
    print()


def _in_a_cell(text: str) -> str:
    """A cell's text, without line feeds, which would break the table; a header's stand where it folds."""
    return " ".join(for_terminal(text).split("\n"))


def show_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Print labelled lines."""
    clear_line()
    for line in lay_out_facts([(for_terminal(label), for_terminal(text)) for label, text in facts], line_width()):
        print(line)


# JSON for programs.


def write_json(result: Mapping[str, Any]) -> None:
    """Print the machine-readable result, alone on standard output."""
    clear_line()
    content = plain(with_edits(result))
    text = _in_lines(content, ensure_ascii=False)
    try:
        text.encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except UnicodeEncodeError:  # another locale, or a file's name that is not text
        text = _in_lines(content, ensure_ascii=True)
    print(re.sub("[\x7f-\x9f]", lambda control: f"\\u{ord(control[0]):04x}", text))  # JSON escapes those below 0x20


def _in_lines(content: Mapping[str, Any], *, ensure_ascii: bool) -> str:
    """JSON with a line for each key, and for each row of a table; `indent` takes five times as long."""
    encode = json.JSONEncoder(ensure_ascii=ensure_ascii, allow_nan=False).encode

    def written(value: Any) -> str:
        if not isinstance(value, list) or not any(isinstance(row, dict) for row in value):
            return encode(value)
        return "[\n  " + ",\n  ".join(map(encode, value)) + "\n ]"

    return "{\n " + ",\n ".join(f"{encode(key)}: {written(value)}" for key, value in content.items()) + "\n}"


def plain(value: Any) -> Any:
    """Lists, dictionaries and numbers that JSON knows; null for what is not finite."""
    if value is None or isinstance(value, str | int):
        return value
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Path):
        return str(value)
    return value


# Notes that are kept from one run to the next, in the user's state folder.

MAX_NOTES = 5000
"""Of one kind, the last ones written; each has some hundred bytes."""


def _note(kind: str, key: bytes) -> Path:
    import hashlib

    import platformdirs

    folder = Path(os.environ.get("TASKCAL_STATE_DIR") or platformdirs.user_state_path("taskcal"))
    return folder / kind / f"{hashlib.sha256(key).hexdigest()[:32]}.json"


def read_note(kind: str, key: bytes) -> dict[str, Any]:
    """The note of a kind and key; empty where there is none."""
    with suppress(OSError, ValueError, RecursionError, FileError):
        path = _note(kind, key)
        content = parse_json(path.read_text(encoding="utf-8"), path)
        if isinstance(content, dict):
            return content
    return {}


def keep_note(kind: str, key: bytes, content: Mapping[str, Any]) -> None:
    """Write a note, where that can be done, and drop the oldest of its kind where there are too many."""
    path = _note(kind, key)
    with suppress(OSError, FileError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, json.dumps(content))
        notes = list(path.parent.glob("*.json"))
        for old in sorted(notes, key=lambda note: note.stat().st_mtime)[:-MAX_NOTES] if len(notes) > MAX_NOTES else ():
            old.unlink(missing_ok=True)


# Files that were read although they were edited: every result and page says so.

_edited: list[str] = []


def forget_edits() -> None:
    """Forget what an earlier command of this process read."""
    _edited.clear()


def warn_of_edits(warning: str) -> None:
    """Note that a file which this run reads was edited. Nothing where the warning is empty."""
    if warning:
        _edited.append(warning)


def edit_warnings() -> tuple[str, ...]:
    """Which files of this run were edited, in words."""
    return tuple(dict.fromkeys(_edited))


def with_edits(result: Mapping[str, Any]) -> Mapping[str, Any]:
    """A result for programs, with ``edited`` where a file was."""
    return {**result, "edited": edit_warnings()} if edit_warnings() else result


def tell_edits() -> None:
    """Write above a result for people which files were edited."""
    for warning in edit_warnings():
        say(f"warning: {warning}")
