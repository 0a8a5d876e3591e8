"""Column names over two rows: groups, as of a reflector or of what was asked and what was measured, above the names in them."""

from collections import Counter
from collections.abc import Sequence


def joined_names(above: Sequence[str], names: Sequence[str]) -> tuple[str, ...] | None:
    """Names of columns with those of their groups before them, where they need them; None where the row above has no part.

    A group's name stands over its first column and holds for the empty ones behind, as merged cells are written. It goes
    before names that stand several times, and takes the place of those that are empty.

    Args:
        above: the row above the names.
        names: of the columns.
    """
    times = Counter(name.casefold() for name in names if name)
    repeated = {k for k, name in enumerate(names) if times[name.casefold()] > 1}
    lacking = {k for k, name in enumerate(names) if not name and k < len(above) and above[k]}
    if not repeated and not lacking:
        return None
    groups: list[str] = []
    for k in range(len(names)):
        own = above[k] if k < len(above) else ""
        groups.append(own or (groups[-1] if groups and k not in lacking else ""))
    if any(not groups[k] for k in repeated):
        return None
    joined = tuple(
        f"{groups[k]} {name}" if k in repeated else name or (groups[k] if k in lacking else "")
        for k, name in enumerate(names)
    )
    return joined if len(set(filter(None, joined))) == sum(map(bool, joined)) else None
