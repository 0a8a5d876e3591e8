"""Cell files: read, written, and explained where they are wrong."""

from dataclasses import fields

import numpy as np
import pytest

from taskcal.correction.cell import Cell, ExternalAxis, Measured, load_cell, write_cell
from taskcal.errors import FileError
from taskcal.geometry import se3

POSE = se3.pose(se3.exp(np.array([0.3, -0.2, 0.9])), np.array([0.1, -0.2, 0.35]))


def test_a_cell_reads_back_as_it_was_written(tmp_path):
    cell = Cell(
        tools={
            "cutter": Measured(name="Cutter", reflectors={n: np.arange(3.0) * k for k, n in enumerate("abc")}),
            "probe": Measured(name="probe", controller=POSE, in_flange=POSE, uncertainty=2e-5),
            "pen": Measured(name="pen", tip=np.radians(np.arange(24.0).reshape(4, 6))),
        },
        parts={
            "fixture": Measured(name="fixture", in_tracker=POSE, uncertainty=1e-5),
            "blade": Measured(name="blade", touched=np.radians(np.arange(18.0).reshape(3, 6)), touched_with="probe"),
            "mould": Measured(name="mould", in_target=POSE),
        },
    )
    write_cell(tmp_path / "cell.toml", cell)
    found = load_cell(tmp_path / "cell.toml")
    for among, again in ((cell.tools, found.tools), (cell.parts, found.parts)):
        assert list(among) == list(again)
        for one, other in zip(among.values(), again.values(), strict=True):
            assert (one.name, one.touched_with) == (other.name, other.touched_with)
            assert one.uncertainty == pytest.approx(other.uncertainty)
            for key in ("controller", "in_tracker", "touched", "tip", "in_flange", "in_target"):
                a, b = getattr(one, key), getattr(other, key)
                assert (a is None) == (b is None)
                if a is not None:
                    np.testing.assert_allclose(a, b, atol=1e-12)
            for name, point in one.reflectors.items():
                np.testing.assert_allclose(point, other.reflectors[name], atol=1e-15)
    assert found.tool("CUTTER").name == "Cutter"
    assert found.tool("unknown").reflectors == {}


def test_base_and_external_axes_survive_the_cell_file(tmp_path):
    """The robot's base and its external axes read back as they were written."""
    axes = (
        ExternalAxis(number=1, carries="robot", slides_along=np.array([0.0, 0.6, 0.8])),
        ExternalAxis(number=2, carries="part", turns_about=np.array([0.0, 0.0, 1.0]), T_frame=POSE, unit="STN1"),
        ExternalAxis(number=5, carries="nothing"),
    )
    write_cell(tmp_path / "cell.toml", Cell(T_world_base=POSE, axes=axes))
    found = load_cell(tmp_path / "cell.toml")
    np.testing.assert_allclose(found.T_world_base, POSE, atol=1e-12)
    for one, other in zip(axes, found.axes, strict=True):
        for field in fields(ExternalAxis):
            a, b = getattr(one, field.name), getattr(other, field.name)
            if isinstance(a, np.ndarray):
                np.testing.assert_allclose(b, a, atol=1e-12)
            else:
                assert a == b


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[axis]]\nnumber = 1\ncarries = "robot"\n', "state either slides_along"),
        ('[[axis]]\nnumber = 1\ncarries = "tool"\n', "carries"),
        ('[[axis]]\nnumber = 7\ncarries = "nothing"\n', "number"),
        ('[[axis]]\nnumber = 1\ncarries = "nothing"\nunit = "STN1"\n', "carries nothing: leave out"),
        ('[[axis]]\nnumber = 1\ncarries = "robot"\nslides_along = [0, 0, 0]\n', "has no direction"),
        ('[[axis]]\nnumber = 1\ncarries = "robot"\nslides_along = [0, 0, 1]\nunit = "A"\n', "axes that carry the part"),
        (2 * '[[axis]]\nnumber = 1\ncarries = "nothing"\n', "axis 1 is stated twice"),
        ('[[tool]]\nname = "a"\n[[tool]]\nname = "A"\n', "two tools are named 'a'"),
        ("[[tool]]\nname = 'a'\n" * 1001, "tool: has more than 1000 entries"),
        ('[[part]]\nname = "a"\ntracker = { position_mm = [1, 2] }\n', "position_mm"),
        (
            '[[part]]\nname = "a"\ntracker = { position_mm = [1, 2, 3] }\nflange = { position_mm = [1, 2, 3] }\n',
            "measured in one way only",
        ),
        ('[[part]]\nname = "a"\ntouched_deg = [[1, 2], [3, 4], [5, 6]]\n', "touched_with"),
        ('[[part]]\nname = "a"\ntouched_deg = [[1, 2], [3, 4]]\ntouched_with = "p"\n', "has 2 entries; give 3 or more"),
        ('[[part]]\nname = "a"\ntouched_deg = [[1, 2], [3], [5, 6]]\ntouched_with = "p"\n', "differ in length"),
        ('[[part]]\nname = "a"\ntouched_deg = [[1, 2], [3, 4], [5, 6]]\ntouched_with = "p"\n', "where the controller"),
        ('[[tool]]\nname = "a"\nreflectors_mm = { x = [1, 2, 3], y = [1, 2, 4] }\n', "has 2 entries; give 3 or more"),
        ('[[tool]]\nname = "a"\nuncertainty_mm = 0.1\n', "uncertainty_mm is of what is measured"),
        ('[[tool]]\nname = "a"\nlenght = 1\n', "'lenght' is not a known key"),
        ("[[tool]\n", "not TOML"),
    ],
)
def test_what_is_wrong_in_a_cell_file_is_said(text, words, tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=words) as error:
        load_cell(path)
    assert str(error.value).startswith(str(path))
