"""taskcal doctor."""

import pytest

from tests.cli.conftest import Run


def test_a_sound_installation(run: Run) -> None:
    ended = run("doctor", "--json")
    assert ended.status == 0
    assert ended.json["ok"]
    names = {check["name"] for check in ended.json["checks"]}
    assert {"Python", "numpy", "scipy", "numba", "taskcal", "kernels", "BLAS threads", "catalogue"} <= names


def test_a_broken_one(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("taskcal.robot.catalogue.catalogue_names", lambda: ())
    ended = run("doctor")
    assert ended.status == 1
    assert "BROKEN" in ended.out
    assert "install Taskcal again" in ended.out
