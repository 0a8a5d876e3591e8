"""Numbers in other characters than a programming language writes: signs, grouped digits, exponents of Fortran."""

import re

_GROUPED = re.compile(r"(?<=\d)['’\u00a0\u2009\u202f](?=\d{3}(?!\d))")
"""Between three digits and those before them: an apostrophe as the Swiss write, or a blank that does not break the line."""

_BLANKS = re.compile(r"[+-]?\d{1,3}(?: \d{3})+(?:[.,]\d*)?", re.ASCII)
"""Digits in groups with blanks between them."""

_EXPONENT = re.compile(r"(?<=[\d.])[dD](?=[+-]\d{2,3}(?!\w))", re.ASCII)
"""As Fortran writes numbers of double precision, ``3.1416D+02``."""

_MINUS = str.maketrans(dict.fromkeys("\u2212\u2012\u2013", "-"))
"""A minus sign, and dashes that stand for one before a digit."""


def in_plain_digits(text: str) -> str:
    """Text whose numbers have a hyphen for a sign, digits in one group, and ``e`` before the exponent."""
    if not text.isascii():
        text = re.sub(
            r"(?<![\w\u2012\u2013])[\u2212\u2012\u2013](?=[\d.,])", lambda sign: sign[0].translate(_MINUS), text
        )
        text = _GROUPED.sub("", text)
    elif "'" in text:
        text = _GROUPED.sub("", text)
    return _EXPONENT.sub("e", text) if "D+" in text.upper() or "D-" in text.upper() else text


def without_blanks(cell: str) -> str:
    """A number without the blanks between its groups of digits; any other text as it is."""
    return cell.replace(" ", "") if " " in cell and _BLANKS.fullmatch(cell) else cell
