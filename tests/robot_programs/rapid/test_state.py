"""What holds behind several ways through a program."""

from robot_programs.rapid.names import Symbol
from robot_programs.rapid.values import AbstractValue, State, identical

A, B = Symbol(name="a", type="num"), Symbol(name="b", type="num")


def test_joined_state_holds_what_all_ways_agree_on():
    """Of several ways only data with one value, and a motion that was the last on all of them, are known behind."""
    one = State(last=1, variables={A: AbstractValue(value=1.0), B: AbstractValue(value=2.0)})
    other = State(last=2, variables={A: AbstractValue(value=1.0), B: AbstractValue(value=3.0)})
    both = one.joined([other], "")
    assert both.last is None
    assert [(symbol, known.value) for symbol, known in both.variables.items()] == [(A, 1.0)]
    assert one.joined([one], "").last == 1


def test_joined_state_names_data_only_if_all_ways_do():
    """A name of what was assigned is kept where all ways assign it."""
    p, q = (State(variables={A: AbstractValue(value=1.0, name=name)}) for name in ("p", "q"))
    assert p.joined([q], "").variables[A].name == ""
    assert p.joined([p], "").variables[A].name == "p"


def test_identical_values_are_of_one_type():
    """A truth is not a number."""
    assert identical((1.0, ("a",)), (1.0, ("a",)))
    assert not identical((True,), (1.0,))
