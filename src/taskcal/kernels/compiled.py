"""Compilation of the numeric kernels, each at its first call: importing Numba takes longer than refusing a wrong file."""

import hashlib
import logging
import os
import pickle
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache, cached_property, update_wrapper
from importlib import import_module
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import platformdirs
from numba.core import caching as numba_caching
from numba.core import config
from numba.core.environment import Environment
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from taskcal.errors import FileError
from taskcal.io.files import write_whole

Function = TypeVar("Function", bound=Callable[..., Any])


class Kernel:
    """A function that is compiled, without the interpreter lock, when it is first called or wanted by another kernel."""

    def __init__(self, function: Callable[..., Any], *, kept: bool = False, **options: bool):
        update_wrapper(self, function)
        self._function, self._kept, self._options = function, kept, options

    def __call__(self, *arguments: Any) -> Any:
        """What the compiled function returns."""
        return self.dispatcher(*arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """What Numba makes of the function."""
        import numba

        njit: Any = numba.njit
        dispatcher = njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **self._options)(self._function)
        if self._kept:
            keep_compiled(dispatcher, self._function)
        return dispatcher


@cache
def prepare_compiler() -> None:
    """Tell Numba's compiler what a kernel is that another one calls, and what lanes are; what was compiled before runs without."""
    from numba.extending import typeof_impl

    import_module("taskcal.kernels.lane_types")  # after which kernels know lanes
    register: Any = typeof_impl.register
    register(Kernel)(lambda kernel, context: typeof_impl(kernel.dispatcher, context))


def compiled(function: Function) -> Function:
    """Compile a kernel at its first call, and keep the machine code on disk."""
    return cast(Function, Kernel(function, kept=True))


def part(function: Function) -> Function:
    """Compile a kernel that only other kernels call; it is compiled with each of them and needs no cache.

    It has no entry from Python, which would take longer to compile than the kernel where arguments are tuples of arrays.
    """
    return cast(Function, Kernel(function, no_cpython_wrapper=True))


def inlined(function: Function) -> Function:
    """Compile a `part` into its callers: for short ones that take many arrays, whose call would cost more than they do."""
    return cast(Function, Kernel(function, no_cpython_wrapper=True, forceinline=True))


# Where the machine code of kernels is kept, and what becomes of it where that is damaged, full or closed to us.
#
# Numba's disk cache notices an edited file, but not an edited callee in another file, and it fails in a read-only
# folder. So the cache lies in the user's cache folder, under a hash of all kernel sources: any edit starts a new
# one. Kernels lie in this folder, or in files that are named after them.

caching: Any = numba_caching


@cache
def cache_folder() -> Path:
    """Folder of the compiled kernels: in ``NUMBA_CACHE_DIR`` if set, else in the user's cache; it may not exist."""
    digest = hashlib.sha256(f"{sys.version}{numba.__version__}".encode())
    here = Path(__file__).parent
    for source in sorted([*here.glob("*.py"), *here.parent.glob("identification/*_kernel.py")]):
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
        """What is kept of a compiled kernel.

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
        """Where the machine code of a signature, on a processor, lies."""
        digest = hashlib.sha256(repr((key, self._stamp)).encode()).hexdigest()[:16]
        return self._folder / f"{self._base}.{digest}.nbc"

    def load(self, key: Any) -> Any:
        """What was saved; None where nothing is.

        Raises:
            ValueError: it is damaged.
        """
        try:
            content = self.path(key).read_bytes()
        except OSError:
            return None
        if hashlib.sha256(content[32:]).digest() != content[:32]:
            raise ValueError("it is not what was written")
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

    def __init__(self, kernel: Any):
        super().__init__(kernel)
        self._cache_file = _Files(self._impl)

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
            prepare_compiler()
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
    """Whether an earlier process has already left the kernel of the fit, the largest, in the cache."""
    return any(cache_folder().rglob("normal_equations._accumulate*.nbc"))


def keep_compiled(dispatcher: Any, kernel: Callable[..., Any]) -> None:
    """Let a dispatcher of Numba's keep its machine code in the folder of the compiled kernels."""
    settings: Any = config
    previous = settings.CACHE_DIR  # process-wide, so that other users of Numba keep their own
    settings.CACHE_DIR = str(cache_folder())
    try:
        dispatcher._cache = _KernelCache(kernel)
    finally:
        settings.CACHE_DIR = previous
