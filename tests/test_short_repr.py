"""Results in a line."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from taskcal.short_repr import LONGEST, short_repr


def test_what_is_long_is_counted_and_what_is_empty_left_out() -> None:
    @short_repr
    @dataclass(frozen=True)
    class Result:
        q: np.ndarray
        names: tuple[str, ...]
        text: str
        value: float
        nothing: None = None
        empty: tuple[()] = ()

    shown = repr(Result(np.zeros((7, 6)), tuple(f"parameter {i}" for i in range(50)), "x" * 500, 1 / 3))
    assert shown.startswith("Result(q=<7×6>, names=<50>, text='xxx")
    assert shown.endswith("value=0.3333)")
    assert len(shown) < 200


def test_many_fields_end_with_an_ellipsis() -> None:
    made = dataclasses.make_dataclass("Wide", [(f"a_field_{i}", str) for i in range(40)])
    shown = repr(short_repr(made)(*["some words"] * 40))
    assert shown.endswith(", …)")
    assert len(shown) <= LONGEST + len("Wide(, …)")
