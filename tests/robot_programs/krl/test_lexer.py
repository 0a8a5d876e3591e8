"""Words of KRL: each stands where it says, line by line."""

from hypothesis import given
from hypothesis import strategies as st

from robot_programs.krl.syntax import lines_of_words

pieces = st.sampled_from(
    ["PTP", "$TOOL", "XP1", "#BASE", "10", "1.5E-3", "==", "{", ",", '"a;b"', ";x", " ", "\n", "\r\n", ":"]
)


@given(st.lists(pieces, max_size=20).map("".join) | st.text(max_size=40))
def test_words_stand_where_they_say_and_only_blanks_and_comments_lie_between(text):
    start = 0
    words = iter([word for line in lines_of_words(text) for word in line])
    word = next(words, None)
    for line in text.split("\n"):
        end, rest, position = start + len(line), "", start
        while word is not None and word.start < end:
            assert text[word.start : word.end] == word.text
            rest += text[position : word.start]
            position = word.end
            word = next(words, None)
        rest += text[position:end]
        if not line.startswith("&"):
            assert not rest.split(";")[0].strip(" \t\r\f\v\xa0\ufeff")
        start = end + 1
    assert word is None


def test_kinds_of_words_and_lines_without_any():
    lines = list(lines_of_words('&ACCESS RVP\n; a comment\nBAS(#VEL_PTP,10.5) ; "c"\n\nmsg = "a;b"\n'))
    assert [[(word.kind, word.upper) for word in line] for line in lines] == [
        [("name", "BAS"), ("symbol", "("), ("enum", "#VEL_PTP"), ("symbol", ","), ("number", "10.5"), ("symbol", ")")],
        [("name", "MSG"), ("symbol", "="), ("string", '"A;B"')],
    ]
