"""``python -m benchmarks.peers``: Taskcal and its peers on the same cases, each in an environment of its own; renews the page.

Writes ``result.json`` beside this file, and from it the tables of ``docs/benchmarks.md`` and the figures
``peers.png`` and ``scaling.png`` in ``docs/_static``.
"""

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

from benchmarks.peers.environments import PEERS
from benchmarks.peers.measure import PARTS, measure
from benchmarks.peers.page import PAGE, RESULT, renew

ROOT = Path(__file__).parents[2]


def main() -> None:
    """Measure, and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.peers", description=__doc__.splitlines()[0])
    data = Path(os.environ.get("TASKCAL_DATA", ROOT.parent / "shared" / "data"))
    parser.add_argument("--data", type=Path, default=data, help="folder of the measured robots")
    parser.add_argument(
        "--environments", type=Path, default=ROOT / "build" / "peers", help="where the peers are installed"
    )
    parser.add_argument("--limit", type=float, default=30.0, help="seconds of processor time for one calibration")
    parser.add_argument(
        "--part", action="append", choices=PARTS, help="measure this alone, keep the rest; may be repeated"
    )
    parser.add_argument(
        "--only", action="append", choices=[peer.name for peer in PEERS], help="a peer; may be repeated"
    )
    parser.add_argument("--output", type=Path, default=RESULT, help="the file of results")
    parser.add_argument("--page-only", action="store_true", help="renew the page from the file of results")
    options = parser.parse_args()
    if not options.page_only:
        names = options.only or [peer.name for peer in PEERS]
        folder = options.data if options.data.is_dir() else None
        found = measure(names, options.part or PARTS, folder, options.environments.resolve(), options.limit)
        if options.part and options.output.exists():
            before = json.loads(options.output.read_text(encoding="utf-8"))
            found = before | found | {"peers": before["peers"] | found["peers"]}
        options.output.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    if options.output == RESULT:
        renew(json.loads(RESULT.read_text(encoding="utf-8")))
        subprocess.run([sys.executable, ROOT / "docs" / "draw_picture.py", "peers", "scaling"], check=True)
        print(PAGE)


if __name__ == "__main__":
    main()
