"""Names for files that somebody drops: made from the name that came with them, which is never used as a path itself."""

import re
import unicodedata
from collections.abc import Collection, Iterable

from taskcal.errors import TaskcalError, shown

LONGEST = 60
"""Characters of a name without its ending."""

_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)$", re.IGNORECASE)


def plain_name(given: str, endings: Iterable[str]) -> str:
    """A name of letters, digits, dots, hyphens and underscores, with one of the endings.

    Args:
        given: what a browser says that the file is called, perhaps with folders before it.
        endings: those that are taken here, such as ``.csv``.

    Raises:
        TaskcalError: it has none of these endings.
    """
    last = re.split(r"[/\\]", given)[-1]
    ending = next((e for e in sorted(endings, key=len, reverse=True) if last.lower().endswith(e)), None)
    if ending is None:
        raise TaskcalError(f"'{shown(last)}' is not a file of this kind; drop one that ends in {', '.join(endings)}")
    stem = unicodedata.normalize("NFKC", last[: -len(ending)])
    stem = re.sub(r"[^\w.-]+", "-", stem).strip(".-_")[:LONGEST].rstrip(".-_") or "file"
    return f"{stem}{'-file' if _RESERVED.match(stem) else ''}{ending}"


def free_name(wanted: str, taken: Collection[str]) -> str:
    """The name, with a number before its first ending where it is taken; letter case makes no other name."""
    used = {name.casefold() for name in taken}
    if wanted.casefold() not in used:
        return wanted
    stem, dot, ending = wanted.rpartition(".")
    number = 2
    while f"{stem}-{number}{dot}{ending}".casefold() in used:
        number += 1
    return f"{stem}-{number}{dot}{ending}"
