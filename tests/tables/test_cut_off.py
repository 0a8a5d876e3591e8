"""Files that end in the middle of their last line."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.tables.forms import read_table

HEADER = ("id", "J1_deg", "x_mm", "y_mm", "z_mm")

FORMS = {
    "fixed": lambda value, digits: f"{value:.{digits}f}",
    "exponent": lambda value, digits: f"{value:.{digits}e}",
    "shortest": lambda value, digits: repr(round(value, digits)),
}


def lines_of(form, separator, digits, rows, seed, comma):
    rng = random.Random(seed)
    texts = [[FORMS[form](rng.uniform(-2000, 2000), digits) for _ in HEADER[1:]] for _ in range(rows)]
    texts[0][0] = FORMS[form](12.5, digits)  # filled up with zeros, as some number of any larger table is
    mark = "," if comma and separator in ";\t" else "."
    cells = [[f"p{k}", *(text.replace(".", mark) for text in row)] for k, row in enumerate(texts)]
    return [separator.join(row) for row in (HEADER, *cells)]


def read(path, text):
    path.write_text(text, encoding="utf-8", newline="")
    table = read_table(path)
    if table.faults:
        raise table.faults[0]
    for name in HEADER[1:]:
        table.numbers(name)
    return table


tables = {
    "separator": st.sampled_from([",", ";", "\t", " "]),
    "digits": st.integers(2, 6),
    "rows": st.integers(8, 20),
    "seed": st.integers(0, 10**6),
    "comma": st.booleans(),
}


@settings(max_examples=15)
@given(form=st.sampled_from(sorted(FORMS)), **tables)
def test_no_cut_last_line_is_read_without_a_word(tmp_path_factory, form, **how):
    path, lines = tmp_path_factory.mktemp("cut") / "a.csv", lines_of(form, **how)
    whole = read(path, "\n".join(lines) + "\n")
    start, end = len("\n".join(lines[:-1])) + 2, len("\n".join(lines))
    for at in range(start, end):
        try:
            table = read(path, "\n".join(lines)[:at])
        except FileError:
            continue
        assert form == "shortest"
        assert "nothing shows that its last cell" in table.notes[-1]
        assert list(table.rows)[:-1] == list(whole.rows)[:-1]


@given(form=st.sampled_from(["fixed", "exponent"]), **tables)
def test_whole_last_line_needs_no_line_end(tmp_path_factory, form, **how):
    path, lines = tmp_path_factory.mktemp("cut") / "a.csv", lines_of(form, **how)
    ended, bare = (read(path, "\n".join(lines) + end) for end in ("\n", ""))
    assert (list(bare.rows), bare.notes) == (list(ended.rows), ended.notes)


@pytest.mark.parametrize(
    ("last", "noted"),
    [("SMR1", False), ("SMR", True), ("SMR4", True), ("12", True), ("1 234.50", False)],
)
def test_last_cell_of_other_kinds_is_noted_if_it_may_be_cut(tmp_path, last, noted):
    others = [f"{k} 234.50" for k in (2, 3, 4)] if last[0] == "1" and " " in last else ["SMR1", "SMR2", "SMR3"]
    others = ["100", "101", "102"] if last == "12" else others
    path = tmp_path / "a.csv"
    path.write_text("x_mm;y_mm;what\n" + "".join(f"1.5;2.5;{cell}\n" for cell in others) + f"1.5;2.5;{last}")
    assert any("nothing shows" in note for note in read_table(path).notes) == noted


def test_empty_last_cell_that_no_other_row_has_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("x_mm,y_mm,temp_C\n1.5,2.5,20.5\n1.5,2.5,21.5\n1.5,2.5,")
    with pytest.raises(FileError, match=r"a\.csv:4: column 'temp_C': is empty in the last line, which has no line end"):
        read_table(path)


def test_file_cut_in_a_character_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes("Achse 1 [°];x_mm\n1,5;2,5 µ".encode()[:-1])
    with pytest.raises(FileError, match=r"a\.csv: is cut off in its last character"):
        read_table(path)
