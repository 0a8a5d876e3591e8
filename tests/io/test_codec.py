"""A value and its file: what is written is read back, and refused where it is something else."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from hypothesis import given
from jaxtyping import Float, Int
from pydantic import Field, ValidationError

from taskcal.errors import TaskcalError
from taskcal.io.codec import (
    GAPS,
    LACKS,
    NOT_IN_FILE,
    ONLY_WHERE_KNOWN,
    TRUTHS,
    InFile,
    array_of,
    describe,
    schema_of,
    value_of,
)
from taskcal.io.toml_file import Positive, explain
from tests.laws.robots import generators


@dataclass(frozen=True, eq=False, kw_only=True)
class Mark:
    """A place with a name, and in degrees how it is turned."""

    name: Annotated[str, Field(min_length=1)]
    place: Annotated[Float[np.ndarray, " 3"], InFile(unit="mm")]
    turn: Annotated[float, InFile(unit="deg"), Field(le=180.0)] = 0.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Both:
    """Two numbers that a file has as a sum and a difference."""

    total: float
    gap: float

    @classmethod
    def of(cls, pair: tuple[float, float]) -> "Both":
        return cls(total=pair[0] + pair[1], gap=pair[0] - pair[1])

    def value(self) -> tuple[float, float]:
        return 0.5 * (self.total + self.gap), 0.5 * (self.total - self.gap)


@dataclass(frozen=True, eq=False, kw_only=True)
class Whole:
    """One field of every kind."""

    names: Annotated[tuple[str, ...], InFile(counts="targets")]
    sort: Literal["a", "b"] | Literal["c"]
    count: int
    sure: bool
    far: Positive | None
    numbers: Annotated[Float[np.ndarray, "n targets"], GAPS]
    of: Int[np.ndarray, " n"]
    square: Float[np.ndarray, "3*targets 3*targets"]
    inside: Annotated[Float[np.ndarray, "n targets"] | None, TRUTHS] = None
    marks: Annotated[tuple[Mark, ...], InFile(key="mark"), Field(max_length=2)] = ()
    ends: Annotated[Mapping[str, Float[np.ndarray, " 3"]], InFile(unit="mm")] = field(
        default_factory=dict[str, np.ndarray]
    )
    pair: Annotated[tuple[float, float], InFile(kind=Both, write=Both.of, read=lambda _, both: both.value())] = (
        3.0,
        1.0,
    )
    told: Mapping[str, Any] = field(default_factory=dict[str, Any])
    way: Annotated[str, LACKS] = "usual"
    learnt: Annotated[int | None, ONLY_WHERE_KNOWN] = None
    source: Annotated[str, NOT_IN_FILE] = ""

    @staticmethod
    def check_stated(stated: Mapping[str, Any]) -> None:
        if stated["sure"] and "learnt" not in stated:
            raise ValueError("what is sure was learnt: give learnt")


WHOLE = Whole(
    names=("p", "q"), sort="c", count=3, sure=False, far=2.5,
    numbers=np.array([[1.0, np.nan], [0.25, 0.5], [np.nan, 7.0]]), of=np.array([0, 1, 1]), square=np.eye(6),
    inside=np.array([[1.0, 0.0], [np.nan, 1.0], [0.0, 0.0]]),
    marks=(Mark(name="m", place=np.array([0.001, 0.002, -0.5]), turn=np.pi / 2), Mark(name="k", place=np.zeros(3))),
    ends={"x": np.array([0.1, 0.0, 0.0])}, told={"any": [1, {"thing": None}]}, source="a file",
)  # fmt: skip
FILE = {
    "names": ["p", "q"],
    "sort": "c",
    "count": 3,
    "sure": False,
    "far": 2.5,
    "numbers": [[1.0, None], [0.25, 0.5], [None, 7.0]],
    "of": [0, 1, 1],
    "square": np.eye(6).tolist(),
    "inside": [[True, False], [None, True], [False, False]],
    "mark": [
        {"name": "m", "place_mm": [1.0, 2.0, -500.0], "turn_deg": 90.0},
        {"name": "k", "place_mm": [0.0, 0.0, 0.0], "turn_deg": 0.0},
    ],
    "ends_mm": {"x": [100.0, 0.0, 0.0]},
    "pair": {"total": 4.0, "gap": 2.0},
    "told": {"any": [1, {"thing": None}]},
    "way": "usual",
}


def read(content: dict[str, Any], *, brief: bool = False) -> Whole:
    return value_of(Whole, schema_of(Whole, brief=brief).model_validate(content))


def test_a_file_states_each_field_by_its_type():
    assert describe(WHOLE) == FILE


@pytest.mark.parametrize("brief", [False, True])
def test_what_was_written_is_read_back(brief: bool):
    content = describe(WHOLE, brief=brief)
    assert describe(read(content, brief=brief)) == FILE
    again = read(content, brief=brief)
    np.testing.assert_array_equal(again.numbers, WHOLE.numbers)
    assert (again.of.dtype.kind, again.names, again.source) == ("i", ("p", "q"), "")
    np.testing.assert_allclose(again.marks[0].place, [0.001, 0.002, -0.5])


def test_a_brief_file_leaves_out_what_is_by_default():
    given = describe(WHOLE, brief=True)
    assert set(FILE) - set(given) == {"pair"}
    assert given["mark"][1] == {"name": "k", "place_mm": [0.0, 0.0, 0.0]}
    with pytest.raises(ValidationError):
        read(given)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"count": 1.0}, "count: is not a whole number"),
        ({"sort": "d"}, "sort: must be 'a', 'b' or 'c'"),
        ({"far": 0.0}, "far: must be 1e-06 or more"),
        ({"told": None}, "told: is not a table"),
        ({"mark": [{"name": "", "place_mm": [1, 2, 3], "turn_deg": 0.0}]}, "mark 1, name: is empty"),
        ({"mark": [{"name": "m", "place_mm": [1, 2], "turn_deg": 0.0}]}, "mark 1, place_mm 3: is missing"),
        ({"mark": [{"name": "m", "place_mm": [1, 2, 3], "turn_deg": 181.0}]}, "mark 1, turn_deg: must be 180 or less"),
        ({"mark": [{"name": "m", "place": [1, 2, 3], "turn_deg": 0.0}]}, "mark 1: 'place' is not a known key"),
        ({"ends_mm": {"x": [1, 2, "3"]}}, "ends_mm, x 3: is not a number"),
        ({"source": "x"}, "'source' is not a known key"),
        ({"sure": True}, "what is sure was learnt: give learnt"),
    ],
)
def test_what_a_field_is_not_is_refused(change: dict[str, Any], said: str):
    with pytest.raises(ValidationError) as refused:
        read(FILE | change)
    assert said in explain(refused.value, schema_of(Whole))


def test_a_field_of_several_types_has_no_file():
    @dataclass(frozen=True)
    class Either:
        one: int | str

    with pytest.raises(TypeError, match=r"no file has a field of several types: int \| str"):
        schema_of(Either)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"numbers": [[1.0, 2.0, 3.0]]}, r"'numbers' has shape \(1, 3\), not \(1, 2\)"),
        ({"numbers": [[1.0, 2.0], [1.0]]}, "the rows of 'numbers' differ in length"),
        ({"of": [0]}, r"'of' has shape \(1,\), not \(3,\)"),
        ({"square": [[1.0]]}, r"'square' has shape \(1, 1\), not \(6, 6\)"),
        ({"names": ["p"]}, r"'numbers' has shape \(3, 2\), not \(3, 1\)"),
    ],
)
def test_dimensions_of_one_name_have_one_size(change: dict[str, Any], said: str):
    with pytest.raises(TaskcalError, match=said):
        read(FILE | change)


@given(generators)
def test_array_survives_its_lists(rng):
    """An array comes back from its lists and null is not a number."""
    array = rng.normal(size=(3, 2))
    np.testing.assert_array_equal(array_of("key", array.tolist(), "3 n", {}), array)
    assert np.isnan(array_of("key", [[None, 1.0]], "1 2", {})[0, 0])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([[1.0, 2.0], [3.0]], "the rows of 'key' differ in length"),
        ([[1.0], [2.0]], r"'key' has shape \(2, 1\), not \(2, 2\)"),
        ([], r"'key' has shape \(0,\), not \(2, 2\)"),
    ],
)
def test_another_shape_is_refused(values, message):
    with pytest.raises(TaskcalError, match=message):
        array_of("key", values, "2 two", {"two": 2})
