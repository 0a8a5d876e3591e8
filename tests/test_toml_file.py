import time

import pytest

from taskcal.errors import FileError
from taskcal.toml_file import Section, read_toml


class Small(Section):
    a: float = 0.0


HOSTILE = {
    "nested arrays": ("a = " + "[" * 500 + "]" * 500, "its brackets are nested too deeply"),
    "nested tables": ("a = " + "{a = " * 500 + "1" + "}" * 500, "its brackets are nested too deeply"),
    "a key of 100 000 parts": (".".join("a" * 100_000) + " = 1", "a key has more than 100 parts"),
    "a header of 100 000 parts": ("[" + ".".join("a" * 100_000) + "]", "a key has more than 100 parts"),
    "an integer of 5000 digits": ("a = " + "9" * 5000, "is no TOML: a number has too many digits"),
    "cut off": ("a = [1,", "is no TOML: "),
    "a date that is none": ("a = 2020-13-45", "is no TOML: "),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_hostile_files_are_refused_at_once(tmp_path, kind):
    text, message = HOSTILE[kind]
    path = tmp_path / "file.toml"
    path.write_text(text, encoding="utf-8")
    began = time.perf_counter()
    with pytest.raises(FileError, match=rf"file\.toml: .*{message}"):
        read_toml(path, Small)
    assert time.perf_counter() - began < 2.0


def test_many_decimal_numbers_in_a_line_are_no_long_key(tmp_path):
    path = tmp_path / "file.toml"
    path.write_text("a = [" + ", ".join(["1.5"] * 3000) + "]", encoding="utf-8")
    with pytest.raises(FileError, match="a: "):
        read_toml(path, Small)
