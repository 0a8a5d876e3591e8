"""Files of JSON: every edit of a sealed one is noticed and named, and no key is read twice."""

import copy
import json
import re
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.cli.commands.simulate import read_truth, truth_text
from taskcal.errors import FileError
from taskcal.identification.calibration import load_calibration
from taskcal.identification.identify import identify
from taskcal.io.json_file import (
    MAX_NAMED,
    SEAL,
    SealedFile,
    list_changes,
    note_of_edits,
    sealed,
    unseal,
    without_seal,
)
from taskcal.registration.registration import register
from taskcal.registration.registration_file import load_registration, save_registration
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

MODEL = ErrorModel(load_robot("ur5"))
CAMPAIGN, TRUTH = simulate(
    MODEL, 0.4 * np.random.default_rng(0).normal(size=(14, 6)) + 0.3, rng=np.random.default_rng(1)
)

Reader = Callable[..., object]
READERS: dict[str, Reader] = {
    "calibration": load_calibration,
    "registration": lambda path, **options: load_registration(path, MODEL, CAMPAIGN, **options),
}


@pytest.fixture(scope="module")
def texts(tmp_path_factory) -> dict[str, str]:
    folder = tmp_path_factory.mktemp("sealed")
    identify(MODEL, CAMPAIGN).save(folder / "calibration")
    save_registration(folder / "registration", register(MODEL, CAMPAIGN), MODEL, CAMPAIGN)
    return {kind: (folder / kind).read_text() for kind in READERS}


def numbers(value: Any, change: Callable[[float], float]) -> Any:
    """A value with every number in it changed."""
    if isinstance(value, dict):
        return {key: numbers(item, change) for key, item in value.items()}
    if isinstance(value, list):
        return [numbers(item, change) for item in value]
    return change(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def last_digit(value: float) -> float:
    return value + 1 if isinstance(value, int) else float(np.nextafter(value, 1e9))


EDITS: dict[str, Callable[[Any], Any]] = {
    "zero": lambda value: numbers(value, lambda x: 0 * x),
    "a digit": lambda value: numbers(value, last_digit),
    "times 1e-6": lambda value: numbers(value, lambda x: x * 1e-6),
    "moved by 30 mm": lambda value: numbers(value, lambda x: x + 0.03),
    "reverse": lambda value: value[::-1] if isinstance(value, list | str) else value,
    "other type": lambda value: [value],
}


def edited(content: dict[str, Any]) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """Every edit of every key that changes it: the key, how, and the content."""
    for key, value in content.items():
        for how, edit in EDITS.items():
            if (changed := edit(copy.deepcopy(value))) != value:
                yield key, how, {**content, key: changed}
        yield key, "removed", {name: item for name, item in content.items() if name != key}


HEAD = ("format", "format_version")
"""Keys by which a file is known before its seal is looked at."""


@pytest.mark.parametrize("kind", READERS)
def test_every_edit_of_every_key_is_refused_and_named(kind, texts, tmp_path):
    path, content = tmp_path / "edited.json", json.loads(texts[kind])
    tried = 0
    for key, how, data in edited(content):
        path.write_text(json.dumps(data))
        with pytest.raises(FileError) as refused:
            READERS[kind](path)
        assert f"'{key}'" in str(refused.value) or key in HEAD, (how, str(refused.value))
        tried += 1
    assert tried > 3 * len(content)
    path.write_text(json.dumps({**content, "note": "checked"}))
    with pytest.raises(FileError, match=r"'note' added; restore it, .* --unsealed"):
        READERS[kind](path)


@pytest.mark.parametrize("kind", READERS)
def test_what_was_not_edited_is_read_in_any_layout(kind, texts, tmp_path):
    path, content = tmp_path / "again.json", json.loads(texts[kind])
    path.write_text(json.dumps(dict(reversed(content.items())), indent=3))
    READERS[kind](path)
    assert without_seal(content) == ({key: content[key] for key in content if key != SEAL}, {})


@pytest.mark.parametrize("kind", READERS)
def test_a_key_given_twice_is_refused_by_name(kind, texts, tmp_path):
    path, content = tmp_path / "twice.json", json.loads(texts[kind])
    for key, value in content.items():
        path.write_text(texts[kind].rstrip()[:-1] + f', "{key}": {json.dumps(value)}}}')
        with pytest.raises(FileError, match=rf"twice\.json: states the key '{key}' twice"):
            READERS[kind](path, unsealed=True)


def test_a_truth_with_a_parameter_twice_is_refused(tmp_path):
    path = tmp_path / "truth.json"
    path.write_text(truth_text(TRUTH, CAMPAIGN.targets).replace('"x": {', '"x": {"J2.rz": 0.1,'))
    with pytest.raises(FileError, match=r"states the key 'J2\.rz' twice"):
        read_truth(path, MODEL)


def test_an_edited_calibration_says_so_wherever_it_goes(texts, tmp_path):
    path, content = tmp_path / "cal.json", json.loads(texts["calibration"])
    content["estimate"][0] += 1e-3
    path.write_text(json.dumps({**content, "note": 1}))
    with pytest.raises(FileError, match="'estimate' changed, 'note' added"):
        load_calibration(path)
    path.write_text(json.dumps(content))
    read = load_calibration(path, unsealed=True)
    assert read.edited == ("estimate",)
    assert read.edit_warning.endswith("cal.json (edited: estimate)")
    assert ", edited" in repr(read)
    read.save(tmp_path / "again.json")
    assert load_calibration(tmp_path / "again.json").edited == ("estimate",)
    like = identify(MODEL, CAMPAIGN, like=read).provenance.options["like"]
    assert like["file"] == "cal.json (edited: estimate)"


def test_an_edited_registration_is_named_by_the_calibration(texts, tmp_path):
    path, content = tmp_path / "reg.json", json.loads(texts["registration"])
    content["registration"]["T_tracker_base"][0][3] += 0.03
    path.write_text(json.dumps(content))
    read = load_registration(path, MODEL, CAMPAIGN, unsealed=True)
    assert identify(MODEL, CAMPAIGN, registration=read, keep=[]).layout.registration.file == (
        "reg.json (edited: registration)"
    )


def test_without_a_seal_nothing_is_taken_for_unedited(tmp_path):
    for data in ({"a": 1}, {"a": 1, SEAL: None}, {"a": 1, SEAL: "x"}, {"a": 1, SEAL: {}}):
        with pytest.raises(FileError, match=r"edited\.json: was edited .*; mend it"):
            unseal("edited.json", data, "mend it")
    assert unseal("edited.json", sealed({"a": [1.5, None]}), "mend it") == ({"a": [1.5, None]}, ())


THING = SealedFile(what="thing", marker="mark", version=3, command="make it")

MARK = '"format": "mark", "format_version": 3'

REFUSED = {
    **dict.fromkeys(("[]", "1", '"x"', "null", "{}", '{"format": "x", "format_version": 3}', f"[{{{MARK}}}]"), "but not a thing"),
    **dict.fromkeys((f"{{{MARK[:-1]}{other}}}" for other in ("2", "3.0", "true", '"3"', "null")), "this Taskcal reads 3"),
    '{"format": "mark"}': "this Taskcal reads 3",
    f'{{{MARK}, "a": 1, "b": {{"c": 1, "d": 2, "d": 3}}}}': "the key 'd' twice",
    f"{{{MARK}": "cut off: make it again",
    "{}" + "\n" * 3 + "x": "cut off: make it again",
    "[" * 100_000: "nested too deeply",
    f'{{{MARK}, "a": {"9" * 5000}}}': "too many digits",
}  # fmt: skip


@pytest.mark.parametrize("text", REFUSED, ids=range(len(REFUSED)))
def test_json_that_is_something_else_is_refused_as_that(text, tmp_path):
    path = tmp_path / "a.json"
    path.write_text(text)
    with pytest.raises(FileError, match=REFUSED[text]) as refused:
        THING.look_at(path)
    if "cut off" in REFUSED[text]:
        assert refused.value.line == text.count("\n") + 1
    path.write_text(f'{{{MARK}, "a": {{"b": 1}}, "b": [{{"b": 2}}, {{"b": 3}}]}}')
    assert THING.look_at(path)["b"] == [{"b": 2}, {"b": 3}]


@given(st.lists(st.sampled_from("abcdefghij"), unique=True, max_size=10))
def test_changes_and_edits_name_six_and_count_the_others(keys):
    for said in (list_changes(dict.fromkeys(keys, "changed")), note_of_edits("file", keys)):
        named = [key for key in keys if re.search(rf"\b{key}\b", said)]
        assert named == keys[:MAX_NAMED]
        assert [int(count) for count in re.findall(r"and (\d+) more", said)] == [len(keys) - 6] * (len(keys) > 6)
