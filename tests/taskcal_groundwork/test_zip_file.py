"""Zip files that lie, grow or lead elsewhere: what is refused, and that nothing but a refusal leaves the reader."""

import io
import os
import stat
import struct
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taskcal.errors import FileError
from taskcal_groundwork.files import ZipKind, open_zip

KIND = ZipKind(most_entries=20, largest_mb=100.0, small_mb=40.0, most_ratio=10.0, largest_entry_mb=30.0)
TEXT = b"MoveL p1,v5,fine,tool0;\n" * 40
A_ZIP = Path("a.zip")


def packed(entries: dict[str, bytes], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    into = io.BytesIO()
    with zipfile.ZipFile(into, "w", method) as archive:
        for name, content in entries.items():
            info = zipfile.ZipInfo("x")
            info.filename, info.compress_type = name, method
            archive.writestr(info, content)
    return into.getvalue()


def read(content: bytes, kind: ZipKind = KIND) -> dict[str, bytes]:
    with open_zip(A_ZIP, kind, content) as archive:
        return {entry.name: b"" if entry.is_folder else archive.read(entry) for entry in archive.entries}


def put(content: bytes, record: bytes, offset: int, value: int, size: int) -> bytes:
    """A zip file with another number in the last of its records of a kind."""
    at = content.rindex(record) + offset
    return content[:at] + value.to_bytes(size, "little") + content[at + size :]


def in_directory(content: bytes, offset: int, value: int, size: int = 4) -> bytes:
    return put(content, b"PK\x01\x02", offset, value, size)


@contextmanager
def at_most(memory: float) -> Generator[None]:
    """See that something takes at most so many bytes at once."""
    tracemalloc.start()
    try:
        yield
        assert tracemalloc.get_traced_memory()[1] < memory
    finally:
        tracemalloc.stop()


VERSION, FLAGS, METHOD, CRC, PACKED_SIZE, SIZE, PLACE = 6, 8, 10, 16, 20, 24, 42
"""Where an entry of the directory holds them (APPNOTE 4.3.12)."""


def test_entries_come_back_as_they_were_packed(tmp_path: Path) -> None:
    entries = {"RAPID/": b"", "RAPID/a.mod": TEXT, "empty.txt": b"", "ä€.txt": b"\x00\xff"}
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        assert read(packed(entries, method)) == entries
    (tmp_path / "a.zip").write_bytes(packed(entries))
    with open_zip(tmp_path / "a.zip", KIND) as archive:
        assert [entry.is_folder for entry in archive.entries] == [True, False, False, False]
        assert b"".join(archive.pieces(archive.entries[1], 7)) == TEXT


def test_a_zip_file_in_the_larger_form_is_read() -> None:
    into = io.BytesIO()
    with zipfile.ZipFile(into, "w") as archive, archive.open("a.mod", "w", force_zip64=True) as stream:
        stream.write(TEXT)
    assert read(into.getvalue()) == {"a.mod": TEXT}


def test_names_have_forward_slashes_and_no_dots() -> None:
    windows_and_tar = {"./": b"", "RAPID\\TASK1\\": b"", "RAPID\\TASK1\\a.mod": TEXT, "./b//c.mod": TEXT}
    assert list(read(packed(windows_and_tar))) == ["./", "RAPID/TASK1/", "RAPID/TASK1/a.mod", "b/c.mod"]


@pytest.mark.parametrize(
    "name",
    ["../a.mod", "b/../../a.mod", "/a.mod", "//b/a.mod", "..\\a.mod", "\\a.mod", "C:\\a.mod", "C:a.mod", "a.mod\0.txt", ".."],
)  # fmt: skip
def test_names_that_lead_out_of_it_are_refused(name: str) -> None:
    content = packed({"ok.mod": TEXT, name.replace("\0", "~"): TEXT}).replace(b"a.mod~.txt", b"a.mod\0.txt")
    with pytest.raises(FileError, match=r"^a\.zip: holds a file of the name '.*', which leads out of it; take it out"):
        read(content)


def test_a_version_of_the_format_that_is_not_known_is_named() -> None:
    with pytest.raises(FileError, match=r"^a\.zip: is a zip file of a later version \(.*9\.9\); pack the files again"):
        read(in_directory(packed({"a.mod": TEXT}), VERSION, 99, 1))


@pytest.mark.parametrize("other", ["a.mod", "A.MOD", "./a.mod", ".\\a.mod"])
def test_two_files_of_one_name_are_refused(other: str) -> None:
    with pytest.raises(FileError, match=r"^a\.zip: holds two files of the name '[aA]\..*'; pack the files again"):
        read(
            packed({"a.mod": TEXT, "b.mod": TEXT}).replace(b"b.mod", b"a.mod")
            if other == "a.mod"
            else packed({"a.mod": TEXT, other: TEXT})
        )


def test_a_link_is_listed_and_not_read() -> None:
    into = io.BytesIO()
    with zipfile.ZipFile(into, "w") as archive:
        link = zipfile.ZipInfo("link.mod")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(
        FileError, match=r"^a\.zip/link\.mod: is a link, which is not followed; put the file in its place"
    ):
        read(into.getvalue())


@pytest.mark.parametrize("flag", [0x1, 0x1 | 0x40, 0x2000])
def test_encrypted_entries_are_refused_by_their_flag(flag: int) -> None:
    with pytest.raises(FileError, match=r"^a\.zip/a\.mod: is encrypted; pack the files again, .* without a password"):
        read(in_directory(packed({"a.mod": TEXT}), FLAGS, flag, 2))


def test_a_patch_is_refused() -> None:
    with pytest.raises(FileError, match=r"^a\.zip/a\.mod: is a patch to another file \(flag 5\); pack the files again"):
        read(in_directory(packed({"a.mod": TEXT}), FLAGS, 0x20, 2))


@pytest.mark.parametrize(
    ("method", "name"), [(9, "Deflate64"), (99, "AES encryption"), (93, "Zstandard"), (77, "unknown")]
)
def test_other_methods_are_refused_by_number_and_name(method: int, name: str) -> None:
    message = (
        rf"^a\.zip/a\.mod: is packed by method {method} \({name}\); pack the files again, stored or Deflate, as an"
    )
    with pytest.raises(FileError, match=message):
        read(in_directory(packed({"a.mod": TEXT}), METHOD, method, 2))


@pytest.mark.parametrize(("method", "name"), [(zipfile.ZIP_BZIP2, "BZIP2"), (zipfile.ZIP_LZMA, "LZMA")])
@pytest.mark.parametrize("damaged", [False, True])
def test_unbounded_compression_methods_are_rejected_unread(method: int, name: str, damaged: bool) -> None:
    """Compression methods that unpack all at once are rejected before any unpacking."""
    content = packed({"a.mod": b"\0" * 20_000_000}, method)
    if damaged:
        content = content[:40] + b"\xff" * 8 + content[48:]
    with (
        at_most(2e6),
        pytest.raises(
            FileError, match=rf"^a\.zip/a\.mod: is packed by method {method} \({name}\); pack the files again"
        ),
    ):
        read(content)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.99])
def test_a_file_that_was_cut_off_is_called_damaged(share: float) -> None:
    content = packed({"a.mod": TEXT, "b.mod": TEXT})
    with pytest.raises(FileError, match=r"^a\.zip: is a damaged zip file \(.*\); pack the files again"):
        read(content[: int(share * len(content))])


def raw_deflate(content: bytes) -> bytes:
    packer = zlib.compressobj(wbits=-15)
    return packer.compress(content) + packer.flush()


def forged(content: bytes, stated: int, method: int) -> bytes:
    """A zip file whose sizes and sum are those of the first bytes of what it has, so that these look whole."""
    data = raw_deflate(content) if method == zipfile.ZIP_DEFLATED else content
    sizes = (zlib.crc32(content[:stated]), len(data), stated)
    local = struct.pack("<4s5H3L2H", b"PK\x03\x04", 20, 0, method, 0, 33, *sizes, 5, 0) + b"a.mod" + data
    entry = struct.pack("<4s6H3L5H2L", b"PK\x01\x02", 20, 20, 0, method, 0, 33, *sizes, 5, 0, 0, 0, 0, 0, 0) + b"a.mod"
    return local + entry + struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, 1, 1, len(entry), len(local), 0)


def test_forged_zip_helper_writes_valid_zip_by_default() -> None:
    """The helper that forges ZIP files writes a valid one if nothing is forged."""
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        assert read(forged(TEXT, len(TEXT), method)) == {"a.mod": TEXT}


DAMAGES: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "sum": (lambda content: in_directory(content, CRC, 4711), "Bad CRC-32"),
    "contents": (lambda content: content[:35] + b"\xff" + content[36:], "rror -3"),
    "states more": (lambda content: in_directory(content, SIZE, 5000), r"unpacks to 960 bytes and states 5000"),
    "states less": (lambda content: in_directory(content, SIZE, 10), r"unpacks to more than the 10 bytes it states"),
    "states nothing": (lambda content: in_directory(content, SIZE, 0), r"unpacks to more than the 0 bytes it states"),
    "packed shorter": (lambda content: in_directory(content, PACKED_SIZE, 5), "Bad CRC-32|bytes and states"),
    "packed longer": (lambda content: in_directory(content, PACKED_SIZE, 1 << 30), "lies outside the file"),
    "elsewhere": (lambda content: in_directory(content, PLACE, 1 << 31), "lies outside the file"),
    "other header": (lambda content: in_directory(content, PLACE, 1), "Bad magic number"),
    "other name": (lambda content: content.replace(b"a.mod", b"b.mod", 1), "differ"),
    "forged": (lambda _: forged(TEXT, 24, zipfile.ZIP_DEFLATED), "Bad CRC-32"),
    "stored": (lambda _: forged(TEXT, 24, zipfile.ZIP_STORED), "it states 24 bytes and has 960"),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGES)
def test_an_entry_that_does_not_agree_with_itself_is_named(damage: str) -> None:
    change, message = DAMAGES[damage]
    with pytest.raises(FileError, match=rf"^a\.zip/a\.mod: .*(?:{message}).*; pack the files again"):
        read(change(packed({"a.mod": TEXT})))


def test_what_unpacks_to_too_much_is_refused_before_it_is() -> None:
    ratio = packed({"a.txt": b"\0" * 60_000_000})
    with pytest.raises(FileError, match=r"^a\.zip: unpacks to 60 MB, more than 41 MB; pack the files again"):
        read(ratio)
    total = packed({f"{k}.txt": os.urandom(100) for k in range(3)})
    total = total.replace((100).to_bytes(4, "little"), (50_000_000).to_bytes(4, "little"))
    with pytest.raises(FileError, match=r"^a\.zip: unpacks to 150 MB, more than 40 MB"):
        read(total)
    one = packed({"a.txt": b"\0" * 35_000_000})
    with pytest.raises(FileError, match=r"^a\.zip/a\.txt: has more than 30 MB; make it smaller, or leave it out"):
        read(one)


def test_a_bomb_that_states_little_is_refused_in_little_memory() -> None:
    bomb = in_directory(packed({"a.txt": b"\0" * 30_000_000}), SIZE, 1000)
    with at_most(4e6), pytest.raises(FileError, match=r"^a\.zip/a\.txt: unpacks to more than the 1000 bytes it states"):
        read(bomb)


def test_a_directory_without_end_is_refused_before_it_is_read() -> None:
    with pytest.raises(FileError, match=r"^a\.zip: holds more than 20 files, too many for a zip file"):
        read(packed({str(k): b"" for k in range(21)}))
    many = packed({str(k): b"" for k in range(2000)})
    with at_most(0.5e6), pytest.raises(FileError, match=r"^a\.zip: holds more than 20 files"):
        read(many)


def test_what_is_not_an_ordinary_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.zip")
    for path, message in ((tmp_path / "pipe.zip", "a pipe or a device"), (tmp_path / "no.zip", "No such file")):
        with pytest.raises(FileError, match=message), open_zip(path, KIND):
            pass


@settings(max_examples=100)
@given(st.integers(0, 10_000), st.binary(min_size=1, max_size=12), st.booleans())
def test_nothing_but_a_refusal_that_names_the_file_leaves_it(position: int, noise: bytes, from_its_end: bool) -> None:
    whole = packed({"RAPID/": b"", "RAPID/a.mod": TEXT, "ä.txt": b"1234"})
    at = len(whole) - 1 - position % 200 if from_its_end else position % len(whole)
    content = whole[:at] + noise + whole[at + len(noise) :]
    try:
        read(content)
    except FileError as refusal:
        assert str(refusal).startswith("a.zip")  # noqa: PT017
