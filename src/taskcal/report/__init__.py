"""Figures, tables and reports: data in, pictures and pages out; nothing is computed here that a number depends on."""

from importlib import import_module
from importlib.util import find_spec
from typing import Any


def __getattr__(name: str) -> Any:
    """A module of it, imported when it is first used: the libraries of figures take a while."""
    if find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return import_module(f"{__name__}.{name}")
