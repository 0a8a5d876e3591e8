"""Public names stand in stubs, former ones still work."""

from dataclasses import fields
from importlib import import_module
from pathlib import Path

import pytest

import taskcal
from taskcal.public_names import load_lazily

FORMER = [
    (taskcal.Correction, "refused", "rejected"),
    (taskcal.Correction, "remarks", "diagnostics"),
]


@pytest.mark.parametrize(("owner", "old", "new"), FORMER, ids=lambda value: getattr(value, "__name__", value))
def test_an_attribute_of_a_former_name_works_and_warns_with_the_new_one(owner: type, old: str, new: str) -> None:
    concrete = type(owner.__name__, (owner,), dict.fromkeys(getattr(owner, "__abstractmethods__", ())))
    instance = object.__new__(concrete)
    value = object()
    instance.__dict__[new] = value
    with pytest.warns(DeprecationWarning, match=rf"{owner.__name__}\.{old} is called {new} now") as given:
        assert getattr(instance, old) is value
    assert given[0].filename == __file__
    assert old not in {field.name for field in fields(owner)}


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'taskcal' has no attribute 'identfy'"):
        _ = taskcal.identfy


def test_names_come_from_the_stub_beside_the_package(tmp_path: Path) -> None:
    (tmp_path / "__init__.pyi").write_text("from math import tau as tau\n")
    load, names, everything = load_lazily("some", str(tmp_path / "__init__.py"))
    assert (names(), everything, load("tau")) == (["tau"], ["tau"], import_module("math").tau)
