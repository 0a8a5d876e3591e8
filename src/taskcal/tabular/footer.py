"""What stands below a table: rows that sum it up, and remarks."""

import re
from collections.abc import Sequence

from taskcal.errors import shown

_STATISTIC = re.compile(
    r"(?:overall )?(?:(?:mean|average|avg|arithmetic mean|median|std|stdev|stddev|std dev|std\. dev|standard deviation|st\.? ?dev"
    r"|s\.?d|sigma|σ|variance|min|minimum|max|maximum|range|span|rms|rmse|sum|total|count"
    r"|mittel|mittelwert|mw|durchschnitt|ø|stdabw|std\.? ?abw|stabw|standardabweichung|summe|spannweite|anzahl|varianz)"
    r"|[1-6] ?(?:sigma|σ))"
    r"(?: ?\(?(?:value|values|error|errors|deviation|dev|wert|fehler|abweichung|absolute|abs|[xyz]|of .{1,40})\)?)*",
    re.IGNORECASE,
)
"""Names of statistics, in English and German."""

_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:e[+-]?\d+)?", re.ASCII | re.IGNORECASE)

_REMARK = re.compile(
    r"\W{2,}.*|<.*|\W*(?:end|eof|ende|fin|stop)\b.*|[^\W\d_][^:=]{0,40}[:=].*"
    r"|(?:total|sum|count|number|summe|anzahl|created|exported|generated|page|seite|remark|note|bemerkung)\b.*",
    re.IGNORECASE | re.DOTALL,
)
"""A single text that names no row: a line, an end, ``Operator: NN``, a count."""

MOST_REMARKS = 20
"""Rows below a table that are looked at."""


def is_statistic(text: str) -> bool:
    """Whether a text is the name of a statistic, such as ``Mean`` or ``Max. error``."""
    plain = re.sub(r"[\s_]+", " ", text[:100]).strip().rstrip(":=").strip()
    return bool(_STATISTIC.fullmatch(plain) or _STATISTIC.fullmatch(plain.replace(".", "")))


def is_footer(row: Sequence[str]) -> bool:
    """Whether a row below a table sums it up by name, or is a remark alone."""
    filled = [cell for cell in row if cell]
    if not filled or _NUMBER.fullmatch(filled[0]):
        return False
    return is_statistic(filled[0]) or (len(filled) == 1 and _REMARK.fullmatch(filled[0]) is not None)


def footer_note(lines: Sequence[int], rows: Sequence[Sequence[str]]) -> str:
    """What is said of rows that are left out, by the first text in each."""
    firsts = [next(filter(None, row)) for row in rows]
    listed = ", ".join(f"{shown(text, 40)} (line {line})" for text, line in list(zip(firsts, lines, strict=True))[:5])
    return f"{listed}{' …' if len(rows) > 5 else ''}"
