"""What is wrong with an option's value, in users' words: the parser of options says it in those of its validator."""

import re
from collections.abc import Sequence

from taskcal.errors import shown

_WORDS = (
    (re.compile(r"Value error, (.*?)\.?"), r"\1"),
    (re.compile(r"Input should be a valid integer.*"), "is not a whole number; write for example 10"),
    (re.compile(r"Input should be a valid number.*"), "is not a number; write for example 0.5"),
    (re.compile(r"Input should be a finite number.*"), "is not a finite number"),
    (re.compile(r"Input should be greater than or equal to (.*)"), r"must be \1 or more"),
    (re.compile(r"Input should be less than or equal to (.*)"), r"must be \1 or less"),
    (re.compile(r"Input should be greater than (.*)"), r"must be above \1"),
    (re.compile(r"Input should be less than (.*)"), r"must be below \1"),
)
"""How the validator says it, and how to say it."""


def in_users_words(message: str, names: Sequence[str], arguments: Sequence[str]) -> str:
    """A message about a value, with the value before it where the message does not have it.

    Args:
        message: the validator's, or one of our own, which stays as it is.
        names: of the option, such as ``--count`` and ``-n``.
        arguments: as they were typed.
    """
    for said, words in _WORDS:
        if found := said.fullmatch(message):
            plain = found.expand(words)
            value = _typed(names, arguments)
            return plain if value is None or plain.startswith("'") else f"'{shown(value)}' {plain}"
    return message


def _typed(names: Sequence[str], arguments: Sequence[str]) -> str | None:
    """What was typed as the value of an option, the last time."""
    for k in range(len(arguments) - 1, -1, -1):
        name, equals, value = arguments[k].partition("=")
        if name in names:
            return value if equals else next(iter(arguments[k + 1 :]), None)
    return None
