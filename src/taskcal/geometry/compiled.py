"""Compilation of the numeric kernels, and where their machine code is kept.

Numba's disk cache notices an edited file, but not an edited callee in another file, and it fails in a read-only
folder. So the cache lies in the user's cache folder, under a hash of all kernel sources: any edit starts a new one.
"""

import hashlib
import logging
import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import platformdirs
from numba.core import caching as numba_caching
from numba.core import config

caching: Any = numba_caching
Kernel = TypeVar("Kernel", bound=Callable[..., Any])


@cache
def cache_folder() -> Path:
    """Folder of the compiled kernels: in ``NUMBA_CACHE_DIR`` if set, else in the user's cache; it may not exist."""
    digest = hashlib.sha256(f"{sys.version}{numba.__version__}".encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    root = os.environ.get("NUMBA_CACHE_DIR") or platformdirs.user_cache_path("taskcal") / "kernels"
    folder = Path(root) / digest.hexdigest()[:16]
    with suppress(OSError):  # said when a kernel cannot be kept; one that lies there already is used
        folder.mkdir(parents=True, exist_ok=True)
    return folder


class _Locator(caching.UserProvidedCacheLocator):
    """A place that need not be writable: a warm cache may be read-only."""

    def ensure_cache_path(self) -> None:
        with suppress(OSError):
            os.makedirs(self.get_cache_path(), exist_ok=True)


class _Implementation(caching.CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012


class _File(caching.IndexDataCacheFile):
    """Machine code with its digest before it: Numba would run what is damaged."""

    def _save_data(self, name: str, data: Any) -> None:
        content = self._dump(data)
        with self._open_for_write(self._data_path(name)) as stream:
            stream.write(hashlib.sha256(content).digest() + content)

    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), "rb") as stream:
            digest, content = stream.read(32), stream.read()
        if hashlib.sha256(content).digest() != digest:
            raise ValueError("it is not what was written")
        return pickle.loads(content)


class _KernelCache(caching.FunctionCache):
    """Numba's cache, in which a file that is damaged or cannot be written costs a compilation and not the command."""

    _impl_class = _Implementation

    def __init__(self, kernel: Any):
        super().__init__(kernel)
        self._cache_file = _File(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base,
            source_stamp=self._impl.locator.get_source_stamp(),
        )

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            kept = super().load_overload(sig, target_context)
        except Exception as error:  # whatever unpickling of other bytes may raise
            _say_once(
                f"{self._cache_path}: a compiled kernel there is damaged ({type(error).__name__}: {error}); compiled afresh"
            )
            with suppress(OSError):
                self.flush()
            kept = None
        if kept is None:
            _announce()
        return kept

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except (OSError, EOFError, ValueError, pickle.PickleError) as error:
            _say_once(
                f"{self._cache_path}: compiled kernels cannot be kept there ({error}), and every process compiles them anew; "
                "name a folder that can be written, with room, in NUMBA_CACHE_DIR"
            )


@cache
def _announce() -> None:
    """Say, before the first kernel of this process that is not kept, why it takes its time."""
    logging.getLogger("taskcal").info("compiling kernels, once: some seconds")


@cache
def _say_once(message: str) -> None:
    logging.getLogger("taskcal").warning(message)


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
        dispatcher: Any = _njit(no_cfunc_wrapper=True)(kernel)
        dispatcher._cache = _KernelCache(kernel)
        return cast(Kernel, dispatcher)
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
