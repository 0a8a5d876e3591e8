"""``taskcal warm``: compile all kernels ahead of their first use."""

from pathlib import Path

from taskcal.cli.options import JsonOption
from taskcal.cli.output import tell, write_json


def command(as_json: JsonOption = False) -> None:
    """Compile all kernels now, so that no later command has to."""
    import os
    from time import perf_counter

    from taskcal.cli.compile_kernels import compile_kernels
    from taskcal.geometry.kernel_cache import announce_compilation, cache_folder, is_warm

    before, start = _kept_kernels(), perf_counter()
    if is_warm():
        compile_kernels(workers=1)  # which takes less than it takes to start more
    else:
        announce_compilation()
        compile_kernels(workers=os.cpu_count() or 1)
    seconds, compiled = perf_counter() - start, len(_kept_kernels() - before)
    if as_json:
        write_json({"seconds": seconds, "compiled": compiled, "cache": cache_folder()})
    else:
        state = f"{compiled} kernels compiled" if compiled else "all kernels were compiled already; run"
        tell(f"{state} in {seconds:.1f} s; kept in {cache_folder()}")


def _kept_kernels() -> set[Path]:
    """Of every installation that keeps its kernels there, each in a folder of its own."""
    from taskcal.geometry.kernel_cache import cache_folder

    return set(cache_folder().rglob("*.nbc"))
