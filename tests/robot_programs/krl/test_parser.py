from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.core.form import Lit, Ref
from robot_programs.core.source import Source
from robot_programs.krl.data import KrlFile, Names
from robot_programs.krl.lower import MotionStep, is_stated, lowered
from robot_programs.krl.syntax import (
    Aggregate,
    Assignment,
    Begin,
    Call,
    Control,
    Declaration,
    End,
    MotionLine,
    lines_of_words,
    parse,
    value_of,
)
from robot_programs.krl.values import numbers_in
from tests.robot_programs.krl.samples import source


def only(text: str):
    (line,) = parse(text)
    return line


def points(text: str):
    """What each point of a motion is made of."""
    form = lowered(Names(files=(KrlFile.of(0, source("part.src", f"DEF PART( )\n{text}\nEND\n")),)))
    (step,) = (line for routine in form.routines.values() for line in routine.lines)
    assert isinstance(step, MotionStep)
    return [step.points[own] for _, own in step.operands]


def structure(text: str) -> Aggregate:
    (words,) = lines_of_words(text)
    found = value_of(words)
    assert isinstance(found, Aggregate)
    return found


def test_comments_headers_and_blank_lines_have_no_words():
    assert parse("&ACCESS RVP\r\n\r\n;FOLD PTP P1;%{PE}\r\n   ; LIN XP1\r\n") == []


@given(st.text(alphabet="{}[]():,;=#\"'&$_AXE19.+- \r\nPTLIN", max_size=200))
def test_any_text_has_statements(text):
    for line in parse(text):
        assert 0 <= line.start < line.end <= len(text)


@given(
    st.lists(
        st.sampled_from(["DEF A( )", "END", "DEFDAT B", "ENDDAT", "DEFFCT INT C( )", "ENDFCT", "HALT", "I=1"]),
        max_size=9,
    )
)
def test_every_statement_is_in_one_section_or_bounds_it(lines):
    """Whatever the order of heads and ends, and whatever is outside of any."""
    text = "\n".join(lines)
    file = KrlFile(number=0, source=Source.of(Path("a.src"), text.encode()), statements=tuple(parse(text)))
    inside = [line for section in file.sections for line in section.lines]
    bounds = [line for line in file.statements if isinstance(line, Begin | End)]
    assert inside == [line for line in file.statements if not isinstance(line, Begin | End)]
    assert [section.head for section in file.sections if section.head] == [b for b in bounds if isinstance(b, Begin)]


def test_a_motion_with_all_it_can_say():
    text = "slin XP3:{Z 5} WITH $VEL=SVEL_CP(2.0,,LCPDAT1), $TOOL=STOOL2(FP3) C_Spl ; there"
    line = only(text)
    assert isinstance(line, MotionLine)
    assert (line.keyword, line.passing, line.trouble) == ("SLIN", ("C_SPL",), "")
    (operand,) = line.operands
    assert text[operand.start : operand.end] == "XP3:{Z 5}"
    ((name, offset),) = points(text)
    assert isinstance(name, Ref)
    assert name.name == "XP3"
    assert isinstance(offset, Lit)
    assert numbers_in(offset.value) == {"Z": 5.0}
    assert {k: "".join(w.text for w in v) for k, v in line.settings.items()} == {
        "$VEL": "SVEL_CP(2.0,,LCPDAT1)",
        "$TOOL": "STOOL2(FP3)",
    }


@pytest.mark.parametrize(
    ("angle", "words"), [("", []), (",CA 270", ["270"]), (", ca=-2*(N)", ["-", "2", "*", "(", "N", ")"])]
)
def test_an_arc_has_two_points(angle, words):
    text = f"CIRC {{X 1,Y 2,Z 3}},XP[2]{angle} C_DIS C_ORI"
    line = only(text)
    assert isinstance(line, MotionLine)
    assert [word.text for word in line.angle] == words
    assert not line.trouble
    assert [text[o.start : o.end] for o in line.operands] == ["{X 1,Y 2,Z 3}", "XP[2]"]
    assert line.passing == ("C_DIS", "C_ORI")


@pytest.mark.parametrize(
    ("text", "trouble"),
    [
        ("CIRC XP1,XP2,CA 270,CA 90", "CIRC is given 3 points"),
        ("CIRC_REL {X 10},{Y 5} #TOOL", "'#TOOL' is not understood behind CIRC_REL"),
        ("SCIRC_REL {X 10}", "SCIRC_REL is given 1 points"),
        ("SPL_REL {X 10}", "SPL_REL is not read; write SPL to a complete point"),
        ("LINX {X 10}", "LINX is not read; write PTP, LIN or CIRC"),
        ("LINX XP1", "LINX is not read; write PTP, LIN or CIRC, or DECL before a type"),
        ("LINX 5", "LINX is not read; write PTP, LIN or CIRC"),
        ("LIN {X 10} #TOOL", "'#TOOL' is not understood"),
        ("LIN XP1,XP2", "LIN is given 2 points"),
        ("CIRC XP1", "CIRC is given 1 points"),
        ("LIN XP1 FAST", ""),
        ("PTP", ""),
    ],
)
def test_motions_that_are_not_understood_say_why(text, trouble):
    line = only(text)
    assert isinstance(line, MotionLine)
    if trouble:
        assert trouble in line.trouble
    else:
        ((point,),) = points(text)
        assert line.trouble or not is_stated(point)


@pytest.mark.parametrize(
    "text", ["OFFSET(P1)", "P1.X", "{X 1,X 2}", "{X 1", "P1:", "P1 + P2", "{1 2}", "{X 1,T 'B11 0.0}"]
)
def test_points_that_are_no_constants_have_no_parts(text):
    ((point,),) = points(f"LIN {text} C_DIS")
    assert not is_stated(point)


def test_words_of_a_component_stay_apart():
    point = structure("{X A B_AND B, Y - 1}")
    assert [(field.text, field.value) for field in point.fields] == [("A B_AND B", None), ("-1", -1.0)]


def test_declarations():
    line = only("GLOBAL DECL E6POS XP1={x 1,Y 2} , XP2[ 3 ]")
    assert isinstance(line, Declaration)
    assert (line.type, line.shared) == ("E6POS", True)
    assert [(v.name, bool(v.words)) for v in line.variables] == [("XP1", True), ("XP2", False)]


def test_strings_may_hold_anything():
    line = only('DECL FDAT FP1={TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] "a;{,}",TQ_STATE FALSE}')
    assert isinstance(line, Declaration)
    parameters = value_of(line.variables[0].words)
    assert isinstance(parameters, Aggregate)
    texts = {field.name: field.text for field in parameters.fields}
    assert [*texts] == ["TOOL_NO", "BASE_NO", "IPO_FRAME", "POINT2", "TQ_STATE"]
    assert texts["IPO_FRAME"] == "#BASE"


def test_assignments_name_what_they_change():
    line = only("Tool_Data [ 3 ] = {X 1,Y 2,Z 3,A 0,B 0,C 0}")
    assert isinstance(line, Assignment)
    assert (line.name, line.variable, line.text) == ("TOOL_DATA[3]", "TOOL_DATA", "{X1,Y2,Z3,A0,B0,C0}")
    line = only("XP1.X = XP1.X + SHIFT(XP2, (XP3))")
    assert isinstance(line, Assignment)
    assert (line.name, line.variable, line.component) == ("XP1.X", "XP1", "X")


def test_routines_calls_and_steering():
    kinds = [
        type(line)
        for line in parse("GLOBAL DEF A(X:IN)\nSUB (XP1, 2)\nIF $IN[1] THEN\nAGAIN:\nEND\nDEFFCT REAL F()\nENDFCT")
    ]
    assert kinds == [Begin, Call, Control, Control, End, Begin, End]
    begin, call = parse("DEFFCT INT COUNT(X:IN)\nBAS (#CP_PARAMS,0.5 )")
    assert isinstance(begin, Begin)
    assert begin.name == "COUNT"
    assert isinstance(call, Call)
    assert ["".join(w.text for w in a) for a in call.arguments] == ["#CP_PARAMS", "0.5"]


def test_an_index_that_is_computed_is_kept():
    (((point,)),) = points("LIN P[I+1,2] C_DIS")
    assert isinstance(point, Ref)
    ((index, second),) = point.path
    assert (point.name, index.sign, second.value) == ("P", "+", 2.0)


# Words of KRL: each stands where it says, line by line.


pieces = st.sampled_from(
    ["PTP", "$TOOL", "XP1", "#BASE", "10", "1.5E-3", "==", "{", ",", '"a;b"', ";x", " ", "\n", "\r\n", ":"]
)


@given(st.lists(pieces, max_size=20).map("".join) | st.text(max_size=40))
def test_words_and_blanks_make_up_the_text(text):
    """Words stand where they say and only blanks and comments lie between."""
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
