"""What other packages add to Taskcal: entry points of their metadata, loaded when a registry is first asked for its entries.

`docs/how-to/extend-taskcal.md` has the groups and an example for each.
"""

import warnings
from collections.abc import Callable, MutableMapping
from importlib.metadata import EntryPoint, entry_points
from threading import RLock
from typing import Any

from taskcal_groundwork.errors import InputError


class PluginWarning(UserWarning):
    """A package adds something to Taskcal that cannot be used."""


_LOCK = RLock()
_LOADED: set[str] = set()
_FAULTS: dict[str, list[str]] = {}
"""By group, what is wrong with packages that add to it."""


def load_plugins(
    group: str,
    kind: type,
    entries: MutableMapping[str, Any],
    claims: Callable[[Any], tuple[str, ...]] = lambda entry: (entry.name,),
) -> None:
    """Enter what other packages add to a registry, once in a process.

    A package that fails is named in a `PluginWarning`, and adds nothing; the others are entered all the same.

    Args:
        group: of entry points.
        kind: class of the objects that these name, or base class of the classes that these name.
        entries: the registry: objects by name. A class enters itself as it is defined, an object is entered here by its `name`.
        claims: names and endings of an object that no other may have.
    """
    with _LOCK:
        if group in _LOADED:
            return
        _LOADED.add(group)  # at once: a package that is being loaded may ask for the entries itself
        owner = {name: "taskcal" for entry in entries.values() if isinstance(entry, kind) for name in claims(entry)}
        for point in sorted(entry_points(group=group), key=lambda point: (_package(point), point.name)):
            before = dict(entries)
            try:
                entry: Any = point.load()
                if isinstance(entry, type) and issubclass(entry, kind):
                    continue  # which has entered itself
                if not isinstance(entry, kind):
                    raise TypeError(f"{point.value} is not of the kind {kind.__module__}.{kind.__qualname__}")
                if taken := [name for name in claims(entry) if name in owner]:
                    raise InputError(f"'{taken[0]}' is of the package '{owner[taken[0]]}' already; choose another")
                entries[entry.name] = entry
                owner |= dict.fromkeys(claims(entry), _package(point))
            except Exception as error:
                entries.clear()
                entries.update(before)
                reason = str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"
                fault = f"the package '{_package(point)}' cannot add '{point.name}' to {group}: {reason}"
                _FAULTS.setdefault(group, []).append(fault)
                warnings.warn(f"{fault}; mend the package or uninstall it", PluginWarning, stacklevel=2)


def state_faults(group: str) -> str:
    """Faults of packages that add to a group, as a hint for a name that is not found; empty without faults."""
    return f"({'; '.join(_FAULTS[group])})" if group in _FAULTS else ""


def _package(point: EntryPoint) -> str:
    return point.dist.name if point.dist is not None else point.value.partition(".")[0]
