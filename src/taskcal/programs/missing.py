"""What a program needs and its files do not have, each once."""

import re
from collections.abc import Iterable, Iterator

from taskcal.programs.program import Diagnostic

_MISSING = re.compile(
    r"unknown [\w ]+ '([^']+)'|'([^']+)' is not declared in the files|(\S+) is not in the files given"
)


def missing_names(diagnostics: Iterable[Diagnostic]) -> Iterator[Diagnostic]:
    """One diagnostic that lists the names, each with how often it is missed, at the first place; none where none is missing."""
    names: dict[str, int] = {}
    first: Diagnostic | None = None
    for diagnostic in diagnostics:
        match = _MISSING.search(diagnostic.text)
        if match:
            first = first or diagnostic
            name = next(filter(None, match.groups()))
            names[name] = names.get(name, 0) + 1
    if first is not None:
        listed = ", ".join(f"{name} ({count})" if count > 1 else name for name, count in names.items())
        yield Diagnostic(place=first.place, text=f"the files miss {len(names)} names: {listed}")
