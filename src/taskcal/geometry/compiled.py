"""Compilation of the numeric kernels, and where their machine code is kept.

Numba's disk cache notices an edited file, but not an edited callee in another file, and it fails in a read-only
folder. So the cache lies in the user's cache folder, under a hash of all kernel sources: any edit starts a new one.
"""

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import platformdirs
from numba.core import config

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


@cache
def cache_folder() -> Path:
    """Folder of the compiled kernels: ``NUMBA_CACHE_DIR`` if set, else the user's cache, else a temporary one."""
    digest = hashlib.sha256(f"{sys.version}{numba.__version__}".encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    root = os.environ.get("NUMBA_CACHE_DIR") or platformdirs.user_cache_path("taskcal") / "kernels"
    folder = Path(root) / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError:
        # a fresh folder of this process alone: machine code is not taken from where others may write
        return Path(tempfile.mkdtemp(prefix="taskcal-kernels-"))


def is_warm() -> bool:
    """Whether an earlier process has already left the kernel of the fit, the largest, in the cache."""
    return any(cache_folder().rglob("normal_equations._accumulate-*.nbi"))


def _njit(**options: bool) -> Any:
    jit: Any = numba.njit  # its declared types lack the wrappers' options
    return jit(nogil=True, error_model="numpy", **options)


def compiled(kernel: Kernel) -> Kernel:
    """Compile a kernel at its first call, without the interpreter lock, and keep the machine code on disk."""
    settings: Any = config
    previous = settings.CACHE_DIR  # process-wide, so that other users of Numba keep their own
    settings.CACHE_DIR = str(cache_folder())
    try:
        return cast(Kernel, _njit(cache=True, no_cfunc_wrapper=True)(kernel))
    finally:
        settings.CACHE_DIR = previous


def part(kernel: Kernel) -> Kernel:
    """Compile a kernel that only other kernels call; it is compiled with each of them and needs no cache.

    It has no entry from Python, which would take longer to compile than the kernel where arguments are tuples of arrays.
    """
    return cast(Kernel, _njit(no_cfunc_wrapper=True, no_cpython_wrapper=True)(kernel))


def inlined(kernel: Kernel) -> Kernel:
    """Compile a `part` into its callers: for short ones that take many arrays, whose call would cost more than they do."""
    return cast(Kernel, _njit(no_cfunc_wrapper=True, no_cpython_wrapper=True, forceinline=True)(kernel))
