"""Statements of APT, and the circles and frames that they state."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.apt.read import StatedFrames, stated_frame
from robot_programs.apt.syntax import arc_through, circle_tokens, numbers, parse, read_arc
from robot_programs.core.program import Unresolved
from taskcal.geometry import se3
from tests.laws.robots import generators

# Every word where it stands, whatever lines, blanks and comments lie between.


words = st.sampled_from(["GOTO", "1.5", "-2.", "+.5E-1", "MMPM", "TOOL PATH", "PT"])
separators = st.sampled_from(["/", ",", "(", ")", "="])
breaks = st.sampled_from(["", " ", "  ", "$\n", " $ text that is passed over\r\n"])


@given(st.lists(st.tuples(breaks, separators, breaks, words), min_size=1, max_size=8))
def test_a_statement_is_its_words_wherever_its_lines_are_broken(parts):
    text = "FROM" + "".join("".join(part) for part in parts)
    (statement,) = parse(text + "\n")
    expected = ["FROM", *(piece for _, separator, _, word in parts for piece in (separator, word))]
    if len(expected) > 2 and expected[1] == ")":  # a label
        expected = expected[2:]
    assert [token.text for token in statement.tokens] == expected
    assert all(text[token.start : token.end] == token.text for token in statement.tokens)
    assert text[statement.start : statement.end].split("/")[0].startswith(expected[0])


def test_comments_and_lines_of_text_hold_no_words():
    comment, part, motion = parse("$$ GOTO/1,2,3\nPARTNO A/1,2\nGOTO/1,2,3 $$ behind\n")
    assert (comment.word, comment.text, comment.tokens) == ("$$", " GOTO/1,2,3", ())
    assert (part.word, part.text, part.tokens) == ("PARTNO", " A/1,2", ())
    assert motion.numbers == (1.0, 2.0, 3.0)


def test_the_number_of_a_card_is_no_part_of_its_statement():
    (statement,) = parse("GOTO/1.0,2.0,3.0".ljust(72) + "PT    12\n")
    assert statement.numbers == (1.0, 2.0, 3.0)


# Numbers of a path.


@pytest.mark.parametrize(
    ("text", "number"),
    [("1", 1.0), ("-.5", -0.5), ("+2.5E3", 2500.0), ("1E99", None), ("1.5.", None), ("MM", None), (".", None)],
)
def test_numbers_are_those_of_a_path(text, number):
    (statement,) = parse(f"GOTO/{text}")
    assert numbers(statement.tokens[2:3]) == (None if number is None else (number,))


# What stands behind the slash of a statement.


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6))
def test_arguments_between_commas_are_numbers_where_all_are(values: list[float]) -> None:
    (statement,) = parse("GOTO/" + ",".join(map(repr, values)))
    assert statement.numbers == tuple(values)
    (statement,) = parse("GOTO/" + ",".join([*map(repr, values), "on"]))
    assert statement.numbers is None
    assert statement.words[-1] == "ON"


@pytest.mark.parametrize("text", ["GOTO/1,,2", "GOTO/1,2,", "GOTO/(P1),2", "GOTO=1,2", "GOTO/"])
def test_arguments_that_are_not_so_simple_are_none(text: str) -> None:
    (statement,) = parse(text)
    assert not statement.words
    assert statement.arguments is None


def test_a_word_alone_has_no_arguments() -> None:
    (statement,) = parse("RAPID")
    assert statement.arguments == ()


@pytest.mark.parametrize("sign", ["", "+", "-"])
def test_a_number_that_no_path_has_is_none(sign):
    """Too large with either sign, or for a number at all."""
    (statement,) = parse(f"GOTO/{sign}1E9,{sign}1.1E9,{sign}1E999\n")
    assert [numbers((word,)) is None for word in statement.tokens[2::2]] == [False, True, True]


# Arcs through three points, against points made by turning a spoke.


SWEEPS = st.floats(0.3, 5.9).filter(lambda sweep: abs(sweep - np.pi) > 0.05)


def circle(rng: np.random.Generator):
    R, center, radius = se3.exp(rng.normal(size=3)), rng.normal(size=3) * 0.1, rng.uniform(0.01, 0.3)
    return center, radius, lambda angle: center + radius * R @ np.array([np.cos(angle), np.sin(angle), 0.0]), R


@given(generators, SWEEPS, st.floats(0.2, 0.8))
def test_an_arc_through_three_points_is_their_circle(rng, sweep, share):
    center, radius, point, R = circle(rng)
    arc = arc_through(point(0.0), point(share * sweep), point(sweep))
    np.testing.assert_allclose(arc.center, center, atol=1e-9)
    np.testing.assert_allclose([arc.radius, arc.sweep], [radius, sweep], rtol=1e-7)
    np.testing.assert_allclose(arc.direction, R[:, 1], atol=1e-7)  # along the circle, as it begins


@given(generators, SWEEPS)
def test_an_arc_s_statement_is_read_back(rng, sweep):
    center, radius, point, R = circle(rng)
    text = lambda p: ",".join(f"{v * 1e3:.9f}" for v in p)  # noqa: E731
    second = ",2,INTOF" if sweep > np.pi else ""
    (statement,) = parse(
        f"TLON,GOFWD/(CIRCLE/{text(center)},{radius * 1e3:.9f}),ON{second},(LINE/{text(center)},{text(point(sweep))})"
    )
    tokens = circle_tokens(statement)
    assert tokens is not None
    arc = read_arc(tokens, R[:, 1] * 7.0, point(0.0), 1e-3)
    np.testing.assert_allclose(arc.via, point(0.5 * sweep), atol=1e-8)
    np.testing.assert_allclose(arc.end, point(sweep), atol=1e-9)
    assert arc.second == (sweep > np.pi)


def test_what_makes_no_arc_says_why():
    a, b = np.zeros(3), np.array([0.1, 0.0, 0.0])
    with pytest.raises(Unresolved, match="the arc is straight"):
        arc_through(a, 0.5 * (a + b), b)


@pytest.mark.parametrize("text", ["TLON,GOFWD/(CIRCLE/0,0,0),ON,(LINE/0,0,0,1,0,0)", "TLON,GOFWD/1,2,3"])
def test_a_statement_of_another_form_has_no_circle(text):
    (statement,) = parse(text)
    assert circle_tokens(statement) is None


# Frames that CSYS and TRNTYP state, and when it is certain in which one points are counted.


def csys(R: np.ndarray, p: np.ndarray):
    numbers = np.concatenate([R, p[:, None]], axis=1).ravel()
    (statement,) = parse("CSYS/" + ",".join(f"{value:.6f}" for value in numbers))
    return statement


@given(generators)
def test_frame_of_twelve_numbers_is_a_pose_by_rows(rng):
    """Twelve numbers are a pose row by row and a mirror is none."""
    R, p = se3.exp(rng.normal(size=3)), rng.normal(size=3) * 100.0
    np.testing.assert_allclose(stated_frame(csys(R, p)), np.c_[R, p], atol=1e-6)
    assert stated_frame(csys(R * [1.0, 1.0, -1.0], p)) is None
    assert stated_frame(csys(R * 1.01, p)) is None


@given(generators)
def test_frames_other_than_the_first_are_uncertain(rng):
    """The first frame is the part's and another one is uncertain until the first returns."""
    frames = StatedFrames()
    first, other = (csys(se3.exp(rng.normal(size=3)), rng.normal(size=3)) for _ in range(2))
    assert frames.read_csys(first, 3) is None
    assert "another frame is stated than the first" in (frames.read_csys(other, 7) or "")
    assert frames.moved_since == 7
    assert frames.read_csys(first, 9) is None
    assert frames.moved_since is None


@given(generators)
def test_turned_frame_is_certain_if_the_tool_axis_agrees(rng):
    """In the world's coordinates a turned frame is certain where the tool axis is its own."""
    tilted = se3.exp(np.array([rng.uniform(0.5, 2.5), 0.0, 0.0]))
    frames = StatedFrames()
    (world,) = parse("TRNTYP/WORLD,0,0,0")
    assert frames.read_trntyp(world, 1) is None
    assert frames.read_csys(csys(np.eye(3), np.zeros(3)), 2) is None
    assert frames.read_csys(csys(tilted, np.zeros(3)), 3) is None
    assert frames.why_uncertain(tilted[:, 2]) is None
    assert "frame of line 3" in (frames.why_uncertain(np.array([0.0, 0.0, 1.0])) or "")


def test_coordinates_that_are_moved_are_uncertain():
    (moved,) = parse("TRNTYP/WORLD,10,0,0")
    assert "since line 4" in (StatedFrames().read_trntyp(moved, 4) or "")
