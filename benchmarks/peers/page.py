"""The tables of ``docs/benchmarks.md``, from the file of results."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from benchmarks.peers.measure import slope
from benchmarks.peers.scaling import CHAIN_POSES

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "benchmarks.md"
RESULT = Path(__file__).with_name("result.json")
BEGIN, END = "<!-- {}: written by python -m benchmarks.peers -->", "<!-- end of {} -->"
AS_GOOD = 1.05
"""Raw rows suffice if the error on rows that were held out is below so many times that with the frames given."""

Row = dict[str, Any]


def renew(result: Row) -> None:
    """Write the tables of a result into the page, each between its marks."""
    text = PAGE.read_text(encoding="utf-8")
    for name, table in tables(result).items():
        text = placed(text, name, table)
    PAGE.write_text(text, encoding="utf-8")


def placed(text: str, name: str, table: str) -> str:
    """A page with a table between its marks.

    Raises:
        ValueError: the page has no place for it.
    """
    begin, end = BEGIN.format(name), END.format(name)
    before, _, rest = text.partition(begin)
    _, found, after = rest.partition(end)
    if not found:
        raise ValueError(f"no place for the table {name}: a line {begin} and a line {end}")
    return f"{before}{begin}\n\n{table}\n\n{end}{after}"


def tables(result: Row) -> dict[str, str]:
    """Markdown of every table, by the name in its marks."""
    return {
        "machine": machine(result),
        "robots": robots(result),
        "growth": growth(result),
        "scaling": scaling(result),
        "failures": failures(result),
    }


def machine(result: Row) -> str:
    """What ran, and where."""
    where = result["machine"]
    rows = [
        (name, _first(peer["packages"]), peer["packages"].get("numpy") or "–") for name, peer in result["peers"].items()
    ]
    head = f"{where['day']}, {where['processor']}, {where['cores']} cores; {3 * result['limit_s']:g} s of processor time end a run."
    return head + "\n\n" + _table(("way", "version", "its NumPy"), rows)


def _first(packages: dict[str, str | None]) -> str:
    name, version = next(iter(packages.items()))
    return f"{name} {version}" if version else f"{name}, not installed"


def robots(result: Row) -> str:
    """Held-out errors and times on the three robots."""
    parts = []
    for case in result["cases"].values():
        if "missing" in case:
            parts.append(f"*Left out: {case['missing']}.*")
            continue
        rows = [(name, *_row(starts)) for name, starts in case["results"].items()]
        head = (
            "",
            "held out, raw rows",
            "held out, frames given",
            "raw rows suffice",
            "unknowns",
            "first",
            "warm",
            "solver",
        )
        parts.append(f"**{case['title']}** (held-out errors: mean, mm)\n\n" + _table(head, rows))
    return "\n\n".join(parts)


def _errors(starts: Row) -> list[float]:
    return [run["held_out_mm"] for run in starts.values() if run.get("held_out_mm") is not None]


def _row(starts: Row) -> tuple[str, ...]:
    raw, given = starts.get("raw", {}), starts.get("given", {})
    own = min(_errors(starts), default=None)
    tried = _error(raw) if raw else "not tried"
    if own is None:
        return (tried, _error(given) if given else "not needed", "–", "–", "–", "–", "–")
    suffices = raw.get("held_out_mm") is not None and raw["held_out_mm"] <= AS_GOOD * own
    run = raw if suffices else given
    times = (seconds(run[key]) for key in ("first_s", "warm_s", "kernel_s"))
    stands = "not needed" if not given else _error(given)
    return (
        _error(raw) if raw else "not tried",
        stands,
        "–" if not raw else "yes" if suffices else "no",
        str(run["parameters"]),
        *times,
    )


def _error(run: Row) -> str:
    error = run.get("held_out_mm")
    if error is None:
        return "fails"
    return f"{error:.3f}" if error < 1.0 else f"{error:.1f}" if error < 10.0 else f"{error:.0f}"


def seconds(value: float) -> str:
    """A time with two digits and its unit."""
    if value < 0.995e-3:
        return f"{value * 1e6:.2g} µs" if value < 0.0995e-3 else f"{value * 1e5:.0f}0 µs"
    if value < 0.995:
        return f"{value * 1e3:.2g} ms" if value < 0.0995 else f"{value * 1e2:.0f}0 ms"
    return f"{value:.1f} s" if value < 9.95 else f"{value:.0f} s"


def growth(result: Row) -> str:
    """Times of one calibration against poses and parameters, and the exponents."""
    parts = [_grown("poses", result["poses"]), _grown("joints, 400 poses", result["parameters"])]
    return "\n\n".join(parts)


def scaling(result: Row) -> str:
    """Times of Taskcal's passes against poses and parameters, of its studies against robots, and the exponents."""
    parts = [
        _scaled("poses, 42 parameters", result["scaling"]["poses"]),
        _scaled(f"parameters, {CHAIN_POSES} poses", result["scaling"]["parameters"]),
    ]
    rows = result["robots"]
    head = ("robots of 60 poses", *map(_size, rows), "slope")
    times = ("study", *(_time(row) for row in rows), _exponent(slope(rows)))
    return "\n\n".join([*parts, _table(head, [times])])


def _scaled(what: str, rows: list[Row]) -> str:
    names = [name for name in rows[0] if name != "size"]
    lines = [(name, *(seconds(row[name]) for row in rows), _exponent(slope(rows, name))) for name in names]
    return _table((what, *map(_size, rows), "slope"), lines)


def _grown(what: str, found: dict[str, list[Row]]) -> str:
    sizes = sorted({row["size"] for rows in found.values() for row in rows})
    lines = []
    for name, rows in found.items():
        by_size = {row["size"]: row for row in rows}
        cells = (_time(by_size[size]) if size in by_size else "" for size in sizes)
        lines.append((name, *cells, _exponent(slope(rows))))
    return _table((what, *(f"{size}" for size in sizes), "slope"), lines)


def _size(row: Row) -> str:
    return f"{row['size']:,}".replace(",", "\N{NO-BREAK SPACE}")


def _time(row: Row) -> str:
    return "–" if "failed" in row else seconds(row["warm_s"])


def _exponent(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}"


def failures(result: Row) -> str:
    """What did not end, in the words of whatever ended it."""
    said = [
        f"- {name}, {case['title']}, {'raw rows' if start == 'raw' else 'frames given'}: {run['failed']}"
        for case in result["cases"].values()
        if "missing" not in case
        for name, starts in case["results"].items()
        for start, run in starts.items()
        if "failed" in run
    ]
    said += [
        f"- {name}, {row['size']} {sizes}: {row['failed']}"
        for what, sizes in (("poses", "poses"), ("parameters", "joints"))
        for name, rows in result[what].items()
        for row in rows
        if "failed" in row
    ]
    return "\n".join(said) or "Nothing failed."


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    head = list(head)
    lines = [head, ["---"] + ["---:"] * (len(head) - 1), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
