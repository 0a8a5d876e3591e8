"""What holds after some ways through a program."""

from robot_programs.rapid.names import Symbol
from robot_programs.rapid.values import ANY, NOWHERE, Held, State, identical, merged

A, B = Symbol(name="a", type="num"), Symbol(name="b", type="num")


def test_only_what_all_ways_agree_on_is_known():
    one = State(before=frozenset([1]), variables={A: Held(value=1.0), B: Held(value=2.0)})
    other = State(before=frozenset([2]), variables={A: Held(value=1.0), B: Held(value=3.0)})
    both = merged([one, NOWHERE, other])
    assert both.before == {1, 2}
    assert [(symbol, held.value) for symbol, held in both.variables.items()] == [(A, 1.0)]


def test_where_no_way_leads_nothing_holds():
    assert merged([NOWHERE, NOWHERE]) is NOWHERE
    assert not merged([]).reached
    assert State(before=ANY).reached


def test_the_name_of_what_was_assigned_is_known_only_if_it_is_one():
    ways = [State(before=ANY, variables={A: Held(value=1.0, name=name)}) for name in ("p", "q")]
    assert merged(ways).variables[A].name == ""
    assert merged(ways[:1] * 2).variables[A].name == "p"


def test_a_truth_is_not_a_number():
    assert identical((1.0, ("a",)), (1.0, ("a",)))
    assert not identical((True,), (1.0,))
