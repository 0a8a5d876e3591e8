from taskcal.arguments import repeated


def test_what_stands_several_times_is_told_once_in_its_order():
    assert repeated(["a", "b", "c", "b", "a", "a"]) == ["a", "b"]
    assert repeated([3, 1, 2]) == []
    assert repeated([]) == []
