"""Remarks by reason."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.source import Place
from taskcal.report.correction import group_remarks


def at(line: int, name: str = "a.mod") -> Place:
    return Place(path=Path(name), line=line)


def test_remarks_of_one_reason_are_one_line():
    remarks = [(at(k), f"'p{k}' is assigned to in a.mod:{k + 1}") for k in range(3, 10)]
    remarks.insert(2, (at(1), "is out of reach"))
    assert group_remarks(remarks) == [
        "a.mod:3: 'p3' is assigned to in a.mod:4 (7 times; also in line 4, 5, 6, and 3 more)",
        "a.mod:1: is out of reach",
    ]
    assert group_remarks([(at(1), "x")] * 3) == ["a.mod:1: x (3 times)"]
    assert group_remarks([(at(1), "x"), (at(2, "b.mod"), "x")]) == ["a.mod:1: x (2 times; also in file b.mod:2)"]


def test_other_files_are_named_from_the_folder_that_they_have_in_common():
    remarks = [(at(k, f"/long/way/to/{name}"), "x") for k, name in ((1, "a/m.mod"), (2, "b/m.mod"), (3, "a/n.mod"))]
    assert group_remarks(remarks) == ["/long/way/to/a/m.mod:1: x (3 times; also in file b/m.mod:2, a/n.mod:3)"]
    mixed = [(at(1, "a/m.mod"), "x"), (at(2, "/b/m.mod"), "x")]
    assert group_remarks(mixed) == ["a/m.mod:1: x (2 times; also in file /b/m.mod:2)"]


def test_one_reason_has_any_motion_any_name_and_any_place():
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
def test_nothing_is_lost_and_nothing_is_said_twice(remarks):
    lines = group_remarks([(at(line), text) for line, text in remarks])
    assert len(lines) == len({text[0] for _, text in remarks})
    counts = [int(line.partition("(")[2].partition(" times")[0] or 1) for line in lines]
    assert sum(counts) == len(remarks)
