import codecs

import pytest
from hypothesis import given
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal.tables.forms import decode

TEXT = "id;Länge [µm];°\na;1;2\n"


@pytest.mark.parametrize(
    "content",
    [
        TEXT.encode(),
        codecs.BOM_UTF8 + TEXT.encode(),
        TEXT.encode("utf-16"),
        codecs.BOM_UTF16_BE + TEXT.encode("utf-16-be"),
        TEXT.encode("utf-32"),
        TEXT.encode("utf-16-le"),
        TEXT.encode("utf-16-be"),
        TEXT.encode("cp1252"),
        TEXT.replace("\n", "\r\n").encode(),
        TEXT.replace("\n", "\r").encode(),
    ],
)
def test_decodes_common_text_encodings(content):
    """The common encodings of spreadsheets and editors decode to the same text."""
    assert decode("a.txt", content) == TEXT


@given(st.text(st.characters(codec="utf-8", exclude_characters="\r\0\ufeff"), min_size=1))
def test_any_text_in_utf_8_comes_back(text):
    assert decode("a.txt", text.encode()) == text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"\xd0\xcf\x11\xe0\xa1\xb1", r"old kind \(\.xls\); save it as \.xlsx or CSV"),
        (b"%PDF-1.7", "PDF"),
        (b"PK\x03\x04....", "packed file"),
        (b"a,b\n\x00\x01,2\n", "binary file"),
        (b"a,\x81\n", "neither UTF-8 nor Windows-1252"),
        (b"a,\x02\xff\n", "neither UTF-8 nor Windows-1252"),
        (codecs.BOM_UTF16_LE + b"a", "not the UTF-16 text"),
    ],
)
def test_what_is_no_text_is_called_what_it_is(content, message):
    with pytest.raises(FileError, match=rf"a\.txt: .*{message}"):
        decode("a.txt", content)
