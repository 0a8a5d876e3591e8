import pickle
import re
import time
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import ClosureError, FileError, UnknownName, listed, printable, shown


@given(st.text(max_size=2000))
def test_shown_value_is_one_short_line_without_controls(text):
    """A value is shown on one short line without control characters."""
    line = shown(text)
    assert not [c for c in line if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp")]
    assert len(line) <= 80 * len("\\U0010ffff") + 30


@given(st.text(alphabet=st.characters(categories=("L", "N", "P")), max_size=80))
def test_a_short_value_is_shown_as_it_is(text):
    assert shown(text) == text


def test_a_long_value_shows_both_ends_and_its_length():
    line = shown("start" + "x" * 200_000 + "end")
    assert line.startswith("start")
    assert line.endswith("end (200008 characters)")
    assert len(line) < 120


@pytest.mark.parametrize(
    ("text", "seen"),
    [
        ("J\x1b[31m1", r"J\x1b[31m1"),
        ("a\x07b", r"a\x07b"),
        ("a\rb\n", r"a\rb\n"),
        ("\x9b2J", r"\x9b2J"),
        ("\u202eabc", r"\u202eabc"),
        ("σ µm", "σ µm"),
    ],
)
def test_control_characters_become_visible_escapes(text, seen):
    assert printable(text) == seen


def test_control_characters_that_are_kept_stay():
    assert printable("a\n\tb\x1b", keep="\n\t") == "a\n\tb\\x1b"


def test_an_unknown_name_of_any_length_is_refused_at_once():
    start = time.perf_counter()
    message = str(UnknownName("robot", "u" * 5_000_000 + "\x1b]0;owned\x07", ["ur5", "ur10"]))
    assert time.perf_counter() - start < 2.0
    assert len(message) < 300
    assert "\x1b" not in message


@pytest.mark.parametrize(
    "error",
    [ClosureError(3, "rod"), FileError("a.csv", "is empty", line=2, column="x"), UnknownName("engine", "a", ["b"])],
)
def test_an_error_of_another_process_is_the_same_here(error):
    here = pickle.loads(pickle.dumps(error))
    assert (type(here), str(here), vars(here)) == (type(error), str(error), vars(error))


@given(
    st.lists(st.from_regex(r"[a-z]{1,5}", fullmatch=True), max_size=30),
    st.integers(1, 12),
    st.sampled_from([", ", "; "]),
)
def test_a_row_of_texts_names_all_or_says_how_many_more(texts, most, between):
    """What is named and what is counted are together what there is."""
    named, *more = re.split(r"(?:;)? and (?=\d+ more$)", listed(texts, most, between))
    counted = int(more[0].removesuffix(" more")) if more else 0
    assert ([part for part in named.split(between) if part], counted) == (texts[:most], max(len(texts) - most, 0))
