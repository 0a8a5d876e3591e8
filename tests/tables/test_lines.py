"""Lines are those that a text has, however it is divided."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.tables import text as lines
from taskcal.tables.text import lines_of, parts_of


@given(text=st.text("a\n\r", max_size=30), at_once=st.integers(0, 6))
def test_a_text_is_divided_behind_line_feeds_only(text, at_once):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lines, "_AT_ONCE", at_once)
        assert list(lines_of(text)) == text.split("\n")
        parts = list(parts_of(text))
    assert "".join(parts) == text
    assert all(part.endswith("\n") for part in parts[:-1])
