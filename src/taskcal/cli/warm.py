"""``taskcal warm``: compile all kernels ahead of their first use."""

from taskcal.cli.options import JsonOption
from taskcal.cli.output import announce_compilation, write_json


def command(as_json: JsonOption = False) -> None:
    """Compile all kernels now, so that no later command has to."""
    from time import perf_counter

    from taskcal.cli.rehearsal import rehearse
    from taskcal.geometry.compiled import cache_folder, is_warm

    was_warm = is_warm()
    announce_compilation()
    start = perf_counter()
    rehearse()
    seconds = perf_counter() - start
    if as_json:
        write_json({"seconds": seconds, "cache": cache_folder(), "was_warm": was_warm})
    else:
        state = "were compiled already, loaded" if was_warm else "compiled"
        print(f"kernels {state} in {seconds:.1f} s; kept in {cache_folder()}")
