import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_programs.rapid.parse import parse
from robot_programs.rapid.read import read_rapid
from robot_programs.rapid.syntax import tokenize
from tests.laws.robots import generators
from tests.robot_programs.rapid.generator import generate
from tests.robot_programs.rapid.samples import module


@given(st.text(max_size=300) | generators.map(lambda rng: generate(rng).sources[0].text))
def test_words_are_parts_of_the_text_in_order(text):
    at = 0
    for token in tokenize(text):
        assert token.start >= at
        assert text[token.start : token.end] == token.text
        at = token.end
    assert at == len(text)


def test_words_of_each_kind():
    text = '%%%VERSION:1%%%\nMODULE m ! "no" string\n x1:=-.5E+3<>0x1F;"a ""b"" c!"\\Y'
    assert [token.text for token in tokenize(text)] == [
        "MODULE", "m", "x1", ":=", "-", ".5E+3", "<>", "0x1F", ";", '"a ""b"" c!"', "\\", "Y", "",
    ]  # fmt: skip


def test_data_that_refer_to_each_other_deeply():
    chain = "".join(f"CONST num a{k}:={'(' * 20}a{k + 1}+1{')' * 20};" for k in range(90)) + "CONST num a90:=1;"
    body = "MoveL [[a0,0,0],[1,0,0,0],[0,0,0,0],[9,9,9,9,9,9]],v5,fine,tool0;"
    assert "in a circle, or too deeply" in read_rapid([module(body, chain)]).diagnostics[0].text
    doubled = "".join(f"CONST num a{k}:=a{k + 1}+a{k + 1};" for k in range(40)) + "CONST num a40:=1;"
    move = "MoveL [[a30,0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v5,fine,tool0;"
    (found,) = read_rapid([module(move, doubled)]).moves
    assert found.end.T[0, 3] == pytest.approx(1.024)


@pytest.mark.parametrize(
    "piece", ['"', "!", "[", "%%%", "MODULE ", "IF ", "x:=1;", "\\a ", "PROC p() ", '"a""', "1.", "9e", "ENDIF "]
)
def test_the_time_to_read_grows_with_the_length(piece):
    def seconds(count: int) -> float:
        begin = time.process_time()
        parse("MODULE m PROC main() " + piece * count)
        return time.process_time() - begin

    shortest = np.min([seconds(1000) for _ in range(2)])
    assert np.min([seconds(8000) for _ in range(2)]) < 30 * max(shortest, 4e-3)
