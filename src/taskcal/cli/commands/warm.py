"""``taskcal warm``: compile all kernels ahead of their first use."""

from pathlib import Path

import numpy as np

from taskcal.cli.output import tell, write_json
from taskcal.cli.run import JsonOption
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel


def command(as_json: JsonOption = False) -> None:
    """Compile all kernels ahead of their first use."""
    from time import perf_counter

    from taskcal.kernels.kernel_cache import announce_compilation, cache_folder, is_warm

    before, start = _kept_kernels(), perf_counter()
    if not is_warm():
        announce_compilation()
    compile_kernels()
    seconds, compiled = perf_counter() - start, len(_kept_kernels() - before)
    if as_json:
        write_json({"seconds": seconds, "compiled": compiled, "cache": cache_folder()})
    else:
        state = f"{compiled} kernels compiled" if compiled else "all kernels were compiled already; run"
        tell(f"{state} in {seconds:.1f} s; kept in {cache_folder()}")


def _kept_kernels() -> set[Path]:
    """List the kernel folders of every installation that keeps its kernels there."""
    from taskcal.kernels.kernel_cache import cache_folder

    return set(cache_folder().rglob("*.nbc"))


def compile_kernels() -> None:
    """Use every kernel: sensitivities of a robot with a four-bar need them all."""
    ErrorModel(load_robot("abb-irb6660-205-1.9")).jacobian(np.zeros((1, 6)))
