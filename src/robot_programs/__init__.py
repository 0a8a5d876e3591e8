"""Robot programs: RAPID, KRL, TP, URScript, APT and CSV, from text to motions and back."""

from importlib import import_module
from typing import Any

_HOMES = {
    "Diagnostic": "core.program",
    "Edit": "core.program",
    "FileError": "core.errors",
    "Frame": "core.program",
    "InputError": "core.errors",
    "Language": "core.program",
    "Motion": "core.program",
    "Program": "core.program",
    "Robot": "core.robot",
    "Source": "core.source",
    "Target": "core.program",
    "Zone": "core.program",
    "compose_program": "reading",
    "motions_to_joints": "reading",
    "read_program": "reading",
    "write_program": "reading",
}
"""Public names, each loaded when it is first used from the module that has it; for type checkers they stand in the stub."""

__all__ = sorted(_HOMES)  # pyright: ignore[reportUnsupportedDunderAll]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return __all__
