"""Damage that goes where it finds new branches: `python -m tests.readers.guided campaign SECONDS`, with atheris.

libFuzzer mutates sound files, all under the name of the first. A case that is neither read nor refused, or takes
too long, is written to `build/fuzz/KIND` and ends the run. What was interesting stays in `build/fuzz/KIND/corpus` for the next.
"""

import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path


def main(kind: str, seconds: int) -> None:
    """Mutate files of a kind until a case fails or the time is over."""
    import atheris

    with atheris.instrument_imports(include=["taskcal"]):
        from taskcal.errors import TaskcalError
        from tests.readers.fuzz import LONGEST
        from tests.readers.readers import READERS
    reader = READERS[kind]
    place = Path("build/fuzz") / kind
    corpus = place / "corpus"
    corpus.mkdir(parents=True, exist_ok=True)
    files = reader.files()
    for number, (_, content) in enumerate(files):
        (corpus / f"sound-{number}").write_bytes(content)
    name = files[0][0]
    folder = Path(tempfile.mkdtemp(prefix="taskcal-fuzz-"))

    def case(content: bytes) -> None:
        path = folder / name
        path.write_bytes(content)
        begin = time.process_time()
        with suppress(TaskcalError):
            reader.read(path)
        if (took := time.process_time() - begin) > LONGEST:
            raise AssertionError(f"reading takes {took:.1f} s")

    options = [f"-max_total_time={seconds}", f"-artifact_prefix={place}/", "-max_len=20000", "-rss_limit_mb=2000"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], case)
    atheris.Fuzz()


if __name__ == "__main__":
    arguments = sys.argv[1:]
    if len(arguments) != 2 or not arguments[1].isdigit():
        sys.exit("usage: python -m tests.readers.guided KIND SECONDS")
    main(arguments[0], int(arguments[1]))
