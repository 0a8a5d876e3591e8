"""``taskcal warm``: compile all kernels ahead of their first use."""

from taskcal.cli.options import JsonOption
from taskcal.cli.output import tell, write_json


def command(as_json: JsonOption = False) -> None:
    """Compile all kernels now, so that no later command has to."""
    from time import perf_counter

    from taskcal.cli.compile_kernels import compile_kernels
    from taskcal.geometry.compiled import cache_folder

    before, start = _kept_kernels(), perf_counter()
    compile_kernels()
    seconds, compiled = perf_counter() - start, len(_kept_kernels() - before)
    if as_json:
        write_json({"seconds": seconds, "compiled": compiled, "cache": cache_folder()})
    else:
        state = f"{compiled} kernels compiled" if compiled else "all kernels were compiled already; run"
        tell(f"{state} in {seconds:.1f} s; kept in {cache_folder()}")


def _kept_kernels() -> set[str]:
    from taskcal.geometry.compiled import cache_folder

    return {path.name for path in cache_folder().rglob("*.nbc")}
