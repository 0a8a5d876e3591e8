"""From the text of a file to its statements."""

import re
from collections.abc import Iterator

from taskcal.programs.apt.lexer import Token, lines_of, tokenize
from taskcal.programs.apt.syntax import Statement

_LITERAL = ("PARTNO", "PPRINT", "INSERT", "LETTER", "REMARK")
"""Words whose line is text."""

_CARD = 72
"""Columns of a card that hold the statement; behind them CATIA numbers its points: PT 5, CIR 1."""
_CARD_NUMBER = re.compile(r"(PT|CIR)\s+\d+\s*")


def parse(text: str) -> Iterator[Statement]:
    """The statements of a text; those that a dollar sign continues are one."""
    tokens: list[Token] = []
    for start, end in lines_of(text):
        line = text[start:end]
        if not tokens:
            stripped = line.lstrip()
            word = stripped[:6].upper()
            at = start + len(line) - len(stripped)
            if stripped.startswith("$$"):
                yield Statement(word="$$", text=stripped[2:], tokens=(), start=at, end=end)
                continue
            if word in _LITERAL:
                yield Statement(word=word, text=stripped[6:], tokens=(), start=at, end=end)
                continue
        if len(line) > _CARD and _CARD_NUMBER.fullmatch(line, _CARD):
            end = start + _CARD
        comment = text.find("$$", start, end)
        dollar = text.find("$", start, end)
        tokens += tokenize(text, start, dollar if dollar >= 0 else end)
        if tokens and (dollar < 0 or dollar == comment):
            yield _statement(tokens)
            tokens = []
    if tokens:
        yield _statement(tokens)


def _statement(tokens: list[Token]) -> Statement:
    if len(tokens) > 2 and tokens[1].text == ")":  # a label
        tokens = tokens[2:]
    word = " ".join(tokens[0].text.upper().split())
    return Statement(word=word, text="", tokens=tuple(tokens), start=tokens[0].start, end=tokens[-1].end)
