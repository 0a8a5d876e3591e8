"""What is stated of a file and makes no difference is named; rotations are read behind a target's name, too."""

from dataclasses import replace

import numpy as np
import pytest
from openpyxl import Workbook
from scipy.spatial.transform import Rotation

from taskcal.cli import main
from taskcal.reading.options import ReadOptions
from taskcal.reading.reader import read_campaign, read_measurements
from taskcal.tables.options import TableForm
from tests.reading.measured_files import NAMED, ROBOT, measured

OPTIONS = {
    "decimal": ReadOptions(form=TableForm(decimal=",")),
    "sheet": ReadOptions(form=TableForm(sheet="Points")),
    "hidden_rows": ReadOptions(form=TableForm(hidden_rows="keep")),
    "angles": ReadOptions(angles="wpr"),
    "lens": ReadOptions(lens="fisheye"),
    "camera": ReadOptions(camera="camera.toml"),
    "camera_exact": ReadOptions(camera_exact=True),
    "image_times": ReadOptions(image_times="names"),
}
"""One option each."""

ACTING = {
    "plain": set(),
    "decimal commas": {"decimal"},
    "workbook": {"sheet"},
    "workbook with hidden rows": {"sheet", "hidden_rows"},
    "angles": {"angles"},
    "quaternions beside angles": set(),
}
"""Files, and the options that act on each."""


def _file(folder, kind):
    q, T, points = measured(20)
    header = [*NAMED.split(), "x_mm", "y_mm", "z_mm"]
    columns = [np.degrees(q), points["A"] * 1e3 + np.random.default_rng(0).normal(0.0, 0.1, (len(q), 3))]
    if "quaternions" in kind:
        header += ["qx", "qy", "qz", "qw"]
        columns.append(Rotation.from_matrix(T[:, :3, :3]).as_quat())
    if "angles" in kind:
        header += ["W", "P", "R"]
        columns.append(Rotation.from_matrix(T[:, :3, :3]).as_euler("xyz", degrees=True))
    rows = np.concatenate(columns, axis=1)
    if "workbook" not in kind:
        separator, mark = (";", ",") if "commas" in kind else (",", ".")
        lines = [separator.join(f"{v:.6f}".replace(".", mark) for v in row) for row in rows]
        path = folder / "measured.csv"
        path.write_text("\n".join([separator.join(header), *lines]) + "\n")
        return path
    book = Workbook()
    sheet = book.active
    sheet.title = "Points"
    for row in [header, *rows.tolist()]:
        sheet.append(row)
    if "hidden" in kind:
        sheet.row_dimensions[3].hidden = True
    book.save(folder / "measured.xlsx")
    return folder / "measured.xlsx"


@pytest.mark.parametrize("option", OPTIONS)
@pytest.mark.parametrize("kind", ACTING)
def test_an_option_that_makes_no_difference_is_named(tmp_path, kind, option):
    """And none that makes one, whether a campaign is read or converted; what is read is then the same without it."""
    path, stated = _file(tmp_path, kind), OPTIONS[option]
    hidden = ReadOptions(form=TableForm(hidden_rows="keep")) if "hidden" in kind else ReadOptions()
    stated = replace(stated, form=replace(stated.form, hidden_rows=stated.form.hidden_rows or hidden.form.hidden_rows))
    campaign, plain = read_campaign(path, ROBOT, options=stated), read_campaign(path, ROBOT, options=hidden)
    said = f"--{option.replace('_', '-')} has no effect"
    for notes in (campaign.notes, read_measurements(path, ROBOT, stated).notes):
        named = [note for note in notes if "has no effect" in note]
        assert [note.split(":")[0] for note in named] == ([] if option in ACTING[kind] else [said])
    if option not in ACTING[kind]:
        np.testing.assert_array_equal(campaign.q, plain.q)
        np.testing.assert_array_equal(campaign.points, plain.points)
        assert (campaign.rotations is None) == (plain.rotations is None)


def test_options_of_a_fit_have_no_effect_on_what_is_converted(tmp_path):
    notes = read_measurements(_file(tmp_path, "plain"), ROBOT, ReadOptions(distances="d.csv", wire_scale=True)).notes
    assert notes[-2:] == (
        "--distances has no effect: it is of a fit of sockets",
        "--wire-scale has no effect: it is of a fit of lengths",
    )


def test_commands_name_options_without_effect(tmp_path, capsys):
    """Those that read a campaign; without one to diagnose they are refused."""
    path = str(_file(tmp_path, "plain"))
    options = ["--lens", "fisheye", "--sheet", "Points"]
    for command in (
        ["convert", "-o", str(tmp_path / "out.csv")],
        ["doctor"],
        ["register"],
        ["sensitivity", "--campaign"],
    ):
        assert main([*command, path, "--robot", "ur5", *options]) == 0
        said = " ".join(capsys.readouterr().err.split())
        assert said.count("--lens has no effect: no images of boards are read") == 1
        assert said.count("--sheet has no effect: no workbook is read") == 1
    assert main(["doctor", *options]) == 2
    assert "give the campaign as well" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("names", "angles", "order", "degrees"),
    [
        (("rx", "ry", "rz"), "rotation-vector-rad", None, False),
        (("rx_rad", "ry_rad", "rz_rad"), "fixed-xyz-rad", "xyz", False),
        (("W", "P", "R"), None, "xyz", True),
        (("A_deg", "B_deg", "C_deg"), None, "ZYX", True),
        (("roll_deg", "pitch_deg", "yaw_deg"), None, "xyz", True),
    ],
)
@pytest.mark.parametrize("target", ["", "marker_", "T-Mac "])
def test_angles_behind_the_name_of_the_only_target_are_read(tmp_path, names, angles, order, degrees, target):
    q, T, _ = measured(12)
    R = Rotation.from_matrix(T[:, :3, :3])
    values = R.as_rotvec() if order is None else R.as_euler(order, degrees=degrees)
    rows = np.concatenate([np.degrees(q), T[:, :3, 3] * 1e3, values], axis=1)
    header = [*NAMED.split(), *(f"{target}{name}" for name in ("x_mm", "y_mm", "z_mm", *names))]
    path = tmp_path / "measured.csv"
    path.write_text("\n".join([",".join(header), *(",".join(f"{v:.9f}" for v in row) for row in rows)]) + "\n")
    campaign = read_campaign(path, ROBOT, options=ReadOptions(angles=angles))
    np.testing.assert_allclose(campaign.rotations, T[:, :3, :3], atol=1e-7)
    assert not any("left out" in note or "no effect" in note for note in campaign.notes)
