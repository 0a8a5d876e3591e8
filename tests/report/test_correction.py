"""The figure of a corrected program, and remarks by reason."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.apt.read import read_apt
from robot_programs.core.program import Frame
from robot_programs.core.source import Place, Source
from taskcal.correction.correct import correct
from taskcal.correction.correction import Correction
from taskcal.identification.identify import identify
from taskcal.report import correction
from taskcal.report.content import Viewer
from taskcal.report.correction import (
    MIN_DRAWN_MM,
    draw_errors,
    draw_errors_per_axis,
    draw_program,
    group_remarks,
    state_expected,
    state_uncertain,
    tabulate_correction,
    tabulate_errors,
    tabulate_targets,
)
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate
from tests.report.drawn import series

PLANAR = b"""GOTO/350,0,300,0,0,1
GOTO/400,0,300
CIRCLE/400,10,300,0,0,1,10
GOTO/410,10,300
GOTO/410,60,300
"""


@pytest.fixture(scope="module")
def corrected() -> Correction:
    robot = load_robot("abb-irb120")
    model = ErrorModel(robot)
    q = np.random.default_rng(3).uniform(*0.5 * robot.limits.T, size=(30, 6))
    calibration = identify(model, simulate(model, q, rng=np.random.default_rng(4))[0])
    tool, part = Frame(name="mill", T=robot.T_flange_tool), Frame(name="vice", T=np.eye(4))
    return correct(calibration, read_apt([Source.of(Path("flat.apt"), PLANAR)], tool=tool, part=part))


@pytest.fixture(scope="module")
def scene(corrected: Correction) -> Viewer:
    return draw_program(corrected)


def test_figures_of_a_program_are_its_errors_in_millimetres(corrected: Correction) -> None:
    """Along the motions, and along each axis of the part at the targets."""
    before, after = corrected.before, corrected.after
    drawn = series(draw_errors(corrected.program, {"before": before, "after": after}, "error"))
    for one, own in zip(drawn, (before, after), strict=True):
        np.testing.assert_allclose(one.x, own.move + own.share)
        np.testing.assert_allclose(one.y, np.maximum(1e3 * np.linalg.norm(own.error[:, :3], axis=1), MIN_DRAWN_MM))
    for one, own in zip(series(draw_errors_per_axis(corrected)), (before, after), strict=True):
        for axis in range(3):
            np.testing.assert_allclose(
                np.asarray(one.x)[np.asarray(one.y) == axis], 1e3 * own.error[own.at_target, axis]
            )


def test_a_long_program_is_drawn_by_its_largest_errors(corrected: Correction, monkeypatch) -> None:
    monkeypatch.setattr(correction, "MAX_POINTS_ON_LINE", 3)
    lines = {"before": corrected.before, "after": corrected.after}
    for one, own in zip(series(draw_errors(corrected.program, lines, "error")), lines.values(), strict=True):
        assert len(one.y) == 3 < len(own.length)
        assert max(one.y) == pytest.approx(1e3 * own.length.max())


def test_tables_of_a_program_are_its_errors_in_millimetres(corrected: Correction) -> None:
    table = tabulate_errors(corrected)
    for label, own, where in (
        ("at targets, before", corrected.before, corrected.before.at_target),
        ("at targets, after", corrected.after, corrected.after.at_target),
    ):
        (row,) = [dict(zip(table.header, cells, strict=True)) for cells in table.rows if cells[0] == label]
        error = own.error[where, :3]
        size = np.linalg.norm(error, axis=1)
        wanted = [size.max(), np.sqrt(np.mean(size**2)), size.mean(), *np.abs(error).max(axis=0)]
        names = ("max mm", "rms mm", "mean mm", "max x mm", "max y mm", "max z mm")
        assert [float(row[name]) for name in names] == pytest.approx([1e3 * one for one in wanted], abs=6e-5)
        assert int(row["points"]) == len(error)
    told = corrected.told()
    every = tabulate_targets(told["targets"], told["moves"])
    column = every.header.index("before mm")
    sizes = [float(row[column]) for row in every.rows]
    worst = tabulate_targets(told["targets"], told["moves"], 3)
    assert [float(row[worst.header.index("before mm")]) for row in worst.rows] == sorted(sizes, reverse=True)[:3]
    assert worst.title.startswith("The 3 targets")
    assert tabulate_targets(told["targets"], told["moves"], len(sizes) + 1).title == every.title == "Targets"


def test_words_of_a_correction_are_its_figures(corrected: Correction) -> None:
    budget, summary, told = corrected.budget, corrected.summary(), corrected.told()
    facts = dict([*state_expected(told), *tabulate_correction(told, corrected.motion.robot)])
    said = [float(number) for number in re.findall(r"\d+\.\d+", facts["expected error"])]
    assert said == pytest.approx([1e3 * budget.before, 1e3 * budget.after], abs=6e-4)
    said = [float(number) for number in re.findall(r"\d+\.\d+", facts["correction"])]
    assert said == pytest.approx([1e3 * np.sqrt(budget.correction), 1e3 * budget.uncertainty], abs=6e-4)
    shares = [int(number) for number in re.findall(r"(\d+)%", facts["uncertainty budget"])]
    assert shares == [round(100 * share) for share in budget.shares.values()]
    assert sum(budget.shares.values()) == pytest.approx(1.0)
    motions, done, pieces, rejected, unchanged, unread, added = map(int, re.findall(r"\d+", facts["motions"]))
    assert (motions, done + rejected + unchanged) == (len(corrected.program.motions), motions)
    assert pieces == corrected.pieces[corrected.corrected].sum()
    assert (rejected, unread) == (summary["refused"], summary["unresolved"])
    lines = [sum(source.text.count("\n") for source in one.sources) for one in (corrected.program, corrected)]
    assert added == summary["added_lines"] == lines[1] - lines[0]
    assert facts["lines and arcs"].endswith(f": {pieces - done} more motions")
    assert f"ratio {corrected.motion.conditioning:.3f} " in facts["nearest to singular"]
    worst, share = max(budget.shares.items(), key=lambda item: item[1])
    assert f"{share:.0%} is {worst}" in state_uncertain(summary)


def test_program_scene_has_every_target(scene: Viewer) -> None:
    _, layer = scene.layers
    drawn = np.array(layer["at"])
    assert np.isfinite(drawn).all()
    for point in ([350, 0, 300], [400, 0, 300], [410, 60, 300]):
        assert np.abs(drawn - point).max(axis=1).min() < 0.051


def test_program_scene_colours_are_errors(scene: Viewer) -> None:
    _, layer = scene.layers
    values = np.array(layer["values"])
    assert (layer["least"], layer["most"]) == (0.0, pytest.approx(values.max(), abs=1e-5))
    assert all(f"{value:.3f} mm" in tip for value, tip in zip(values, layer["tips"], strict=True))
    assert f"bright {values.max():.3f} mm" in layer["label"]


def at(line: int, name: str = "a.mod") -> Place:
    return Place(path=Path(name), line=line)


def test_group_remarks_has_a_line_for_each_reason():
    remarks = [(at(k), f"'p{k}' is assigned to in a.mod:{k + 1}") for k in range(3, 10)]
    remarks.insert(2, (at(1), "is out of reach"))
    assert group_remarks(remarks) == [
        "a.mod:3: 'p3' is assigned to in a.mod:4 (7 times; also in line 4, 5, 6 and 3 more)",
        "a.mod:1: is out of reach",
    ]
    assert group_remarks([(at(1), "x")] * 3) == ["a.mod:1: x (3 times)"]
    assert group_remarks([(at(1), "x"), (at(2, "b.mod"), "x")]) == ["a.mod:1: x (2 times; also in file b.mod:2)"]


def test_group_remarks_names_files_from_common_folder():
    remarks = [(at(k, f"/long/way/to/{name}"), "x") for k, name in ((1, "a/m.mod"), (2, "b/m.mod"), (3, "a/n.mod"))]
    assert group_remarks(remarks) == ["/long/way/to/a/m.mod:1: x (3 times; also in file b/m.mod:2, a/n.mod:3)"]
    mixed = [(at(1, "a/m.mod"), "x"), (at(2, "/b/m.mod"), "x")]
    assert group_remarks(mixed) == ["a/m.mod:1: x (2 times; also in file /b/m.mod:2)"]


def test_group_remarks_ignores_motion_name_and_place():
    texts = [
        "MoveL stays as it is: 'p1' is assigned to in /way/to/a/m.mod:4, so its value is not known",
        "movej stays as it is: 'p2' is assigned to in /way/to/b/n.mod:40, so its value is not known",
        "LIN stays as it is: TOOL_DATA[20] is not in the files given; pass $config.dat",
        "PTP stays as it is: XHOME is not in the files given; pass $config.dat",
        "ERR_CLEAR is not in the files given; it is taken to leave $TOOL, $BASE and $IPO_MODE as they are",
        "RTCP lets the tool stand still",
    ]
    files = ("a/m.mod", "b/n.mod")
    assert group_remarks([(at(k, f"/way/to/{files[k % 2]}"), text) for k, text in enumerate(texts)]) == [
        "/way/to/a/m.mod:0: MoveL stays as it is: 'p1' is assigned to in a/m.mod:4, so its value is not known (2 times; "
        "also in file b/n.mod:1)",
        f"/way/to/a/m.mod:2: {texts[2]} (2 times; also in file b/n.mod:3)",
        f"/way/to/a/m.mod:4: {texts[4]}",
        f"/way/to/b/n.mod:5: {texts[5]}",
    ]


@given(st.lists(st.tuples(st.integers(1, 99), st.sampled_from(["a 1", "a 2", "b 'x'", "b 'y'", "c"]))))
def test_group_remarks_counts_every_remark_once(remarks):
    lines = group_remarks([(at(line), text) for line, text in remarks])
    assert len(lines) == len({text[0] for _, text in remarks})
    counts = [int(line.partition("(")[2].partition(" times")[0] or 1) for line in lines]
    assert sum(counts) == len(remarks)
