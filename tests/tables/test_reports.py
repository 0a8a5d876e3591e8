"""Reports of coordinate measuring machines, and recordings of QTM."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.tables.forms import read_table
from tests.laws.robots import generators


def _read(folder, text, name="a.txt"):
    path = folder / name
    path.write_text(text)
    return read_table(path)


def _feature(k, name, point, unit="MM", axes="XYZ", measured=1):
    head = ["NOMINAL", "MEAS", "+TOL", "-TOL", "DEV", "OUTTOL"]
    head.insert(measured, head.pop(1))
    out = f"DIM LOC{k}= LOCATION OF SPHERE {name}  UNITS={unit} ,$\nGRAPH=OFF  TEXT=OFF  MULT=10.00  OUTPUT=BOTH\n"
    out += f"AX    {'    '.join(head)}\n"
    for axis, value in zip("XYZ", point, strict=True):
        numbers = [f"{value - 0.1:.3f}", f"{value:.3f}", "1.000", "-1.000", "0.100", "0.000"]
        numbers.insert(measured, numbers.pop(1))
        out += f"{axis}    {'   '.join(numbers)}\n" if axis in axes else ""
    return f"{out}D    38.100   38.101   0.010   -0.010   0.001   0.000\nEND OF DIMENSION LOC{k}\n\n"


@given(generators, st.sampled_from(["MM", "IN"]), st.sampled_from([0, 1, 2]))
def test_measured_coordinates_of_each_feature_are_read(tmp_path_factory, rng, unit, measured):
    points = rng.uniform(-3000, 3000, (int(rng.integers(1, 20)), 3))
    names = [f"SPH{k}" for k in rng.permutation(len(points))]
    text = "pg 1 of 1\nPART NAME  : ROBOT\nREV NUMBER :\nSTATS COUNT :  1\n\n"
    named = enumerate(zip(names, points, strict=True))
    text += "".join(_feature(k, name, point, unit, measured=measured) for k, (name, point) in named)
    table = _read(tmp_path_factory.mktemp("cmm"), text)
    assert table.header == ("id", *(f"{axis}_{unit.lower()}" for axis in "xyz"))
    assert table.texts("id") == names
    np.testing.assert_allclose(table.side_by_side(table.header[1:]), points, atol=5.1e-4)
    assert any("nominal ones and deviations are left out" in note for note in table.notes)


@pytest.mark.parametrize(
    ("feature", "why"),
    [
        (_feature(2, "SPH2", (1, 2, 3), axes="XY"), "'SPH2' has not all of X, Y and Z"),
        (_feature(2, "SPH2", (1, 2, 3), unit="IN"), "'SPH2' has another unit"),
        (_feature(2, "SPH2", (1, 2, 3)).replace("Y  ", "X  "), "has no single measured X of 'SPH2'"),
    ],
)
def test_features_that_are_not_whole_are_refused_by_name(tmp_path, feature, why):
    with pytest.raises(FileError, match=why):
        _read(tmp_path, _feature(1, "SPH1", (1, 2, 3)) + feature)


CALLED = {
    "words before": "S{k};{axis};{nominal};{value}",
    "value of": "{axis} Value_Sphere{k}  {value} {nominal} 0.1 -0.1",
    "alone": "  {axis} = {value}",
    "name and letter": "Sphere {k} {axis} {value}",
    "coordinate": "{axis}-Koord.  {value}",
    "tabs": "P{k}\t{axis}\t{value}",
}


@pytest.mark.parametrize("form", CALLED.values(), ids=CALLED)
@pytest.mark.parametrize("head", ["", "Feature;Axis;Nominal;Measured\n", "Report of today\n\n"])
def test_one_coordinate_a_line_is_called_so(tmp_path, form, head):
    points = np.random.default_rng(0).uniform(-900, 900, (12, 3))
    lines = [
        form.format(k=k, axis=axis, value=f"{value:.4f}", nominal=f"{value:.2f}")
        for k, point in enumerate(points, start=1)
        for axis, value in zip("XYZ", point, strict=True)
    ]
    with pytest.raises(FileError, match=r"is a report with one coordinate a line .* give a row for each point"):
        _read(tmp_path, head + "\n".join(lines) + "\n")


def _recording(names, frames, included="3D", timed=False):
    settings = {
        "NO_OF_FRAMES": len(frames),
        "NO_OF_CAMERAS": 8,
        "NO_OF_MARKERS": len(names),
        "FREQUENCY": 100,
        "NO_OF_ANALOG": 0,
    }
    settings |= {"DESCRIPTION": "--", "TIME_STAMP": "2026-05-01, 08:00:00\t1234.5", "DATA_INCLUDED": included}
    text = "".join(f"{name}\t{value}\n" for name, value in settings.items())
    text += "MARKER_NAMES\t" + "\t".join(names) + "\n"
    if timed:
        text += "Frame\tTime\t" + "\t".join(f"{name} {axis}" for name in names for axis in "XYZ") + "\n"
    for k, frame in enumerate(frames):
        text += "\t".join([*([str(k + 1), f"{k / 100:.5f}"] if timed else []), *(f"{v:.3f}" for v in frame)]) + "\n"
    return text


@given(generators, st.booleans())
def test_recordings_of_qtm_are_read(tmp_path_factory, rng, timed):
    names = [f"tool {k}" for k in range(int(rng.integers(1, 5)))]
    frames = rng.uniform(-3000, 3000, (int(rng.integers(2, 30)), 3 * len(names)))
    table = _read(tmp_path_factory.mktemp("qtm"), _recording(names, frames, timed=timed), "rec.tsv")
    columns = [f"tool_{k}_{axis}_mm" for k in range(len(names)) for axis in "xyz"]
    assert [name for name in table.header if name not in ("Frame", "Time_s")] == columns
    np.testing.assert_allclose(table.side_by_side(columns), frames, atol=5.1e-4)
    assert ("Frame" in table) == timed


def test_other_recordings_of_qtm_are_called_so(tmp_path):
    frames = np.zeros((3, 6))
    with pytest.raises(FileError, match="is an export of Qualisys QTM with 6D; export the markers' positions"):
        _read(tmp_path, _recording(["a", "b"], frames, included="6D"))
    with pytest.raises(
        FileError, match=r"a\.txt:10: the row has 6 numbers, where 1 markers have 3; export it from QTM anew"
    ):
        _read(tmp_path, _recording(["a"], frames))
