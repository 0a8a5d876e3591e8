"""One spelling means one thing wherever it stands, whatever its letter case, what parts its words, and where its unit is."""

import itertools
import re

import pytest

from taskcal.observations import kinds
from taskcal.reading.columns import VOCABULARY, find_word, meanings, split_unit
from tests.reading.test_column_meaning import JOINT_NAMES, JOINTS

WITH_PARTS = {
    "approach": ["j2 approach", "achse 3 approach"],
    "move": ["j2 move", "achse 3 move"],
    "nominal": [
        "x nom",
        "goal y",
        "dev",
        "smr 1 x error",
        "x vel",
        "acceleration z",
        "dx",
        "normal x",
        "smr 1 force y",
    ],
    "quaternion": ["qx", "q w", "smr 1 qy", "quat z", "rot q x"],
    "matrix": ["r11", "m 1 2", "ox", "az"],
    "uncertainty": [
        "u",
        "smr 1 u",
        "smr 1 standard uncertainty",
        "sx",
        "smr 1 sy",
        "u z",
        "ux",
        "sigma x",
        "smr 1 std y",
    ],
    "position": ["x", "x2", "py", "pos z", "smr 1 x", "x smr 1", "y coordinate", "tcp position z", "x measured"],
    "azimuth": ["azimuth", "smr 1 az", "horizontal angle"],
    "clockwise": ["hz", "smr 1 hz winkel"],
    "elevation": ["elevation angle", "smr 1 el"],
    "zenith": ["zenitdistanz", "smr 1 zenith angle"],
    "either": ["v", "vertical angle", "smr 1 φ"],
    "range": ["d", "slope distance", "smr 1 schrägdistanz"],
    "theta": ["theta", "smr 1 θ"],
    "clock": ["time", "stamp", "time stamp", "timestamp", "time us", "zeit ns"],
    "counts": ["j1 pulses", "achse 2 encoder counts", "j3 umdrehungen"],
    "axis": ["e1", "external axis 2", "achse 7", "rail"],
}
"""Headings of each kind whose words have parts, or variants."""


def headings(word):
    """The headings of a word: all where they are listed, else those above."""
    if re.search(r"[(\[?]", word.pattern):
        return [text for text in WITH_PARTS[word.kind] if re.fullmatch(word.pattern, text)]
    return word.pattern.split("|")


def spellings(text, unit):
    """Ways in which people write a heading."""
    ends = ["_{}", " [{}]", "({})", " in {}", "/{}"] if unit else [""]
    for letters, between, end in itertools.product((str, str.upper, str.title), (" ", "_", "-", ".", ": "), ends):
        yield letters(text).replace(" ", between) + (end.format(letters(unit)) if unit else "")


def told(heading):
    """What a heading means by itself, and as which word of directions, counts and axes it is found."""
    text, unit = split_unit(heading)
    (meaning,) = meanings([heading], [""], JOINTS)
    parts = meaning and (meaning.kind, meaning.index, split_unit(meaning.target)[0], meaning.form, meaning.unit)
    found = [find_word(text, kind, unit=unit) for kind in {word.kind: None for word in VOCABULARY}]
    return parts, [(one[0], one[1].groupdict()) for one in found if one]


@pytest.mark.parametrize("unit", ["", "mm", "°c"])
@pytest.mark.parametrize("word", VOCABULARY, ids=lambda word: f"{word.kind} {word.form}{word.unit or ''}")
def test_a_heading_means_the_same_however_it_is_written(word, unit):
    assert headings(word), "a word without an example"
    for text in headings(word):
        expected = told(f"{text} [{unit}]" if unit else text)
        for written in spellings(text, unit):
            assert told(written) == expected, written


def test_no_listed_heading_stands_under_two_kinds():
    listed = [word for word in VOCABULARY if word.unit is None and not re.search(r"[(\[?]", word.pattern)]
    for one, other in itertools.combinations(listed, 2):
        assert not {*headings(one)} & {*headings(other)}, (one.kind, other.kind)


@pytest.mark.parametrize("form", JOINT_NAMES.values(), ids=list(JOINT_NAMES))
def test_joints_mean_the_same_however_they_are_written(form):
    plain = [split_unit(form.format(k)) for k in range(1, 7)]
    for several in zip(*(spellings(text, "rad") for text, _ in plain), strict=True):
        assert [(m.kind, m.index, m.unit) for m in meanings(several, [""] * 6, JOINTS)] == [
            ("joint", k, "rad") for k in range(6)
        ]


@pytest.mark.parametrize("kind", [kind for kind in kinds() if kind.needed], ids=lambda kind: kind.key)
def test_columns_of_a_kind_are_found_however_they_are_written(kind):
    for words in zip(*(itertools.cycle(kind.columns[column]) for column in kind.needed), range(5), strict=False):
        for several in zip(*(spellings(text, "") for text in words[:-1]), strict=True):
            known = meanings([*several, kind.label or "-"], [""] * (len(several) + 1), JOINTS)
            assert [(m.kind, m.target) for m in known[: len(several)]] == [("observed", name) for name in kind.needed]
