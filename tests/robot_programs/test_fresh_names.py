"""Names for new data: fresh, short enough, and as few characters away from what they are like as can be."""

from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.source import FreshNames

names = st.text("abAB12", min_size=1, max_size=6)


@given(words=st.lists(names), wanted=st.lists(names, min_size=1, max_size=12), longest=st.integers(5, 8))
def test_names_are_new_whatever_their_case_and_never_too_long(words, wanted, longest):
    fresh = FreshNames(words, longest=longest, reserved=("A",))
    made = [fresh.like(name) for name in wanted]
    in_use = {word.lower() for word in words} | {"a"}
    assert len({name.lower() for name in made}) == len(made)
    assert in_use.isdisjoint(name.lower() for name in made)
    assert all(len(name) <= longest for name in made)


@given(words=st.lists(names), wanted=names)
def test_a_free_name_is_taken_as_it_is_but_once(words, wanted):
    fresh = FreshNames(words, longest=12)
    free = wanted.lower() not in {word.lower() for word in words}
    assert (fresh.nearest(wanted) == wanted) == free
    assert fresh.nearest(wanted) != wanted


def test_names_grow_beyond_the_usual_length_only_where_a_word_does():
    assert FreshNames(["short"], longest=32, usual=8).like("abcdefghijkl") == "abcdef_2"
    assert FreshNames(["a" * 10], longest=32, usual=8).like("abcdefghijkl") == "abcdefgh_2"
    assert FreshNames(["a" * 40], longest=11, usual=8).like("abcdefghijkl") == "abcdefghi_2"


def test_the_words_are_read_when_the_first_name_is_asked_for():
    def words():
        read.append(True)
        yield "p_2"

    read: list[bool] = []
    fresh = FreshNames(words(), longest=8)
    assert not read
    assert (fresh.like("p"), fresh.like("p")) == ("p_3", "p_4")
    assert len(read) == 1
