"""Public names stand in stubs."""

from importlib import import_module
from pathlib import Path

import pytest

import taskcal
from taskcal_groundwork.public_names import load_lazily


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'taskcal' has no attribute 'identfy'"):
        _ = taskcal.identfy


def test_names_come_from_the_stub_beside_the_package(tmp_path: Path) -> None:
    (tmp_path / "__init__.pyi").write_text("from math import tau as tau\n")
    load, names, everything = load_lazily("some", str(tmp_path / "__init__.py"))
    assert (names(), everything, load("tau")) == (["tau"], ["tau"], import_module("math").tau)
