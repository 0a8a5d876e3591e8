"""Numbers in other characters than a programming language writes: signs, grouped digits, exponents of Fortran."""

import re

from taskcal.tabular.lines import parts_of

_GROUPED = re.compile(r"(?<=\d)['’\u00a0\u2009\u202f](?=\d{3}(?!\d))")
"""Between three digits and those before them: an apostrophe as the Swiss write, or a blank that does not break the line."""

_BLANKS = re.compile(r"[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?", re.ASCII)
"""Digits in groups with blanks between them."""

_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]\d{2,3}(?!\w))", re.ASCII)
"""As Fortran writes numbers of double precision, ``3.1416D+02``."""

_MINUS = re.compile(r"(?<![\w\u2012\u2013])[\u2212\u2012\u2013](?=[\d.,])")
"""A minus sign, and dashes that stand for one before a digit."""


def in_plain_digits(text: str) -> str:
    """Text whose numbers have a hyphen for a sign, digits in one group, and ``e`` before the exponent."""
    changes: list[tuple[re.Pattern[str], str]] = []
    if not text.isascii():
        changes = [(_MINUS, "-"), (_GROUPED, "")]
    elif "'" in text:
        changes = [(_GROUPED, "")]
    if any(mark in text for mark in ("D+", "D-", "d+", "d-")):
        changes.append((_EXPONENT, "e"))
    for pattern, put in changes:
        if pattern.search(text):
            # what stands between the changes takes far more memory than the text
            text = "".join(pattern.sub(put, part) for part in parts_of(text))
    return text


def without_blanks(cell: str) -> str:
    """A number without the blanks between its groups of digits; any other text as it is."""
    return cell.replace(" ", "") if " " in cell and _BLANKS.fullmatch(cell) else cell
