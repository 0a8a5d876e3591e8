"""Where the machine code of kernels is kept, and what becomes of it where that is damaged, full or closed to us.

Numba's disk cache notices an edited file, but not an edited callee in another file, and it fails in a read-only folder. So the
cache lies in the user's cache folder, under a hash of all sources of this folder, which holds all kernels: any edit starts anew.
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
from typing import Any

import numba
import platformdirs
from numba.core import caching as numba_caching
from numba.core import config
from numba.core.environment import Environment
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from taskcal.errors import FileError
from taskcal.io.files import write_whole

caching: Any = numba_caching


@cache
def cache_folder() -> Path:
    """Folder of the compiled kernels: in ``NUMBA_CACHE_DIR`` if set, else in the user's cache; it may not exist."""
    digest = hashlib.sha256(f"{sys.version}{numba.__version__}".encode())
    here = Path(__file__).parent
    for source in sorted(here.glob("*.py")):
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
    _locator_classes = [_Locator]  # noqa: RUF012 - Numba reads it

    def reduce(self, data: Any) -> Any:
        """Reduce a compiled kernel to what is stored.

        The functions of Numba that it calls have environments, for objects of Python that none of them has; kept as they are,
        each would import the module that it comes from, SciPy among them.
        """
        *parts, environments = super().reduce(data)
        return (*parts, tuple(e if e.consts else _of_no_module(e) for e in environments))


def _of_no_module(environment: Any) -> Environment:
    bare = Environment({"__name__": "builtins"})
    bare.env_name = environment.env_name
    return bare


class _Files:
    """The machine code of one kernel, each signature in a file of its own, behind its digest: Numba would run what is damaged.

    Processes that compile at once write what is the same to the same names; an index that they shared could name another's.
    """

    def __init__(self, implementation: Any):
        self._folder = Path(implementation.locator.get_cache_path())
        self._base, self._stamp = implementation.filename_base, implementation.locator.get_source_stamp()

    def path(self, key: Any) -> Path:
        """Path of the machine code of a signature on a processor."""
        digest = hashlib.sha256(repr((key, self._stamp)).encode()).hexdigest()[:16]
        return self._folder / f"{self._base}.{digest}.nbc"

    def load(self, key: Any) -> Any:
        """Load a saved kernel; None where there is none.

        Raises:
            ValueError: it is damaged.
        """
        try:
            content = self.path(key).read_bytes()
        except OSError:
            return None
        if hashlib.sha256(content[32:]).digest() != content[:32]:
            raise ValueError("kernel cache entry is corrupt (checksum mismatch)")
        return pickle.loads(content[32:])  # noqa: S301 - Numba keeps kernels so, in the user's own cache folder

    def save(self, key: Any, data: Any) -> None:
        """Write the file, whole or not at all.

        Raises:
            FileError: it cannot be written.
        """
        content = dumps(data)
        write_whole(self.path(key), hashlib.sha256(content).digest() + content)


class _KernelCache(caching.FunctionCache):
    """Numba's cache, in which a file that is damaged or cannot be written costs a compilation and not the command."""

    _impl_class = _Implementation

    def __init__(self, kernel: Any, prepare: Callable[[], None]):
        super().__init__(kernel)
        self._cache_file, self._prepare = _Files(self._impl), prepare

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        rtsys.initialize(target_context)  # all that machine code asks of Numba, whose compiler takes its time to set up
        try:
            kept = self._load_overload(sig, target_context)
        except Exception as error:  # whatever unpickling of other bytes may raise
            _say_once(
                f"{self._cache_path}: a compiled kernel there is damaged ({type(error).__name__}: {error}); compiled afresh"
            )
            kept = None
        if kept is None:
            announce_compilation()
            self._prepare()
        return kept

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        except (FileError, OSError, ValueError, pickle.PickleError) as error:
            cause = error.__cause__ or error
            _say_once(
                f"{self._cache_path}: compiled kernels cannot be kept there ({cause}), and every process compiles them anew; "
                "name a folder that can be written, with room, in NUMBA_CACHE_DIR"
            )


@cache
def announce_compilation() -> None:
    """Say, before the first kernel of this process that is not kept, why it takes its time."""
    logging.getLogger("taskcal").info("compiling kernels, once: some seconds")


@cache
def _say_once(message: str) -> None:
    logging.getLogger("taskcal").warning(message)


def is_warm() -> bool:
    """Whether an earlier process has already left the walk, which every fit needs, in the cache."""
    return any(cache_folder().rglob("walk.walk_points*.nbc"))


def keep_compiled(dispatcher: Any, kernel: Callable[..., Any], prepare: Callable[[], None]) -> None:
    """Let a dispatcher of Numba's keep its machine code in the folder of the compiled kernels.

    Args:
        dispatcher: what Numba made of the function.
        kernel: the function.
        prepare: called before anything is compiled, and not where what was kept is used.
    """
    settings: Any = config
    previous = settings.CACHE_DIR  # process-wide, so that other users of Numba keep their own
    settings.CACHE_DIR = str(cache_folder())
    try:
        dispatcher._cache = _KernelCache(kernel, prepare)
    finally:
        settings.CACHE_DIR = previous
