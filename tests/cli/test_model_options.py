"""Which model a command works with."""

from pathlib import Path

import pytest
import typer

from taskcal.cli.options.model import ModelOptions
from tests.cli.conftest import IRB6660


def test_a_robot_gives_its_geometry_and_the_effects_named() -> None:
    plain, calibration = ModelOptions(robot=IRB6660).load()
    assert calibration is None
    assert not plain.effects
    model, _ = ModelOptions(robot=IRB6660, effects="compliance,gain").load()
    assert [effect.key for effect in model.effects] == ["compliance", "gain"]


def test_a_calibration_gives_its_model(cell: Path) -> None:
    model, calibration = ModelOptions(calibration=cell / "cal.json").load()
    assert calibration is not None
    assert model is calibration.model


@pytest.mark.parametrize(
    ("options", "hint"),
    [
        ({}, "--robot / --calibration"),
        ({"robot": IRB6660, "calibration": Path("cal.json")}, "--robot / --calibration"),
        ({"calibration": Path("cal.json"), "effects": "gain"}, "--effects / --calibration"),
    ],
    ids=["neither", "both", "effects of a calibration"],
)
def test_one_source_has_to_be_named(options: dict[str, object], hint: str) -> None:
    with pytest.raises(typer.BadParameter) as refused:
        ModelOptions(**options)  # pyright: ignore[reportArgumentType]
    assert refused.value.param_hint == hint


def test_effects_cannot_be_found_before_anything_is_measured() -> None:
    with pytest.raises(typer.BadParameter, match="name the effects"):
        ModelOptions(robot=IRB6660, effects="auto").load()
