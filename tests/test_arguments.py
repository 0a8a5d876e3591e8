"""Arguments by their former names."""

import pytest

from taskcal.arguments import renamed_arguments


def test_a_function_takes_an_argument_by_its_former_name() -> None:
    @renamed_arguments(old="new")
    def double(new: int = 1) -> int:
        return 2 * new

    with pytest.warns(DeprecationWarning, match="the argument 'old' is called 'new' now") as given:
        assert double(old=4) == double(new=4) == 8  # pyright: ignore[reportCallIssue]
    assert [warning.filename for warning in given] == [__file__]
    with pytest.raises(TypeError, match="'old' is the former name of 'new'; give one of them"):
        double(old=4, new=4)  # pyright: ignore[reportCallIssue]
