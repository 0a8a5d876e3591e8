"""Compilation of the numeric kernels, each at its first call: importing Numba takes longer than refusing a wrong file."""

from collections.abc import Callable
from functools import cache, cached_property, update_wrapper
from typing import Any, TypeVar, cast

Function = TypeVar("Function", bound=Callable[..., Any])


class Kernel:
    """A function that is compiled, without the interpreter lock, when it is first called or wanted by another kernel.

    No product is fused with a sum: where that pays is decided anew for every copy of a function, and a process that compiles would
    round otherwise than one that loads what it kept.
    """

    def __init__(self, function: Callable[..., Any], *, kept: bool = False, **options: Any):
        update_wrapper(self, function)
        self._function, self._kept, self._options = function, kept, options

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function."""
        return self.dispatcher(*arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """Numba's dispatcher of the function."""
        import numba

        njit: Any = numba.njit
        dispatcher = njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **self._options)(self._function)
        if self._kept:
            from taskcal.kernels.kernel_cache import keep_compiled

            keep_compiled(dispatcher, self._function, prepare_compiler)
        return dispatcher


@cache
def prepare_compiler() -> None:
    """Tell Numba's compiler what a kernel is that another one calls; what was compiled before runs without."""
    from numba.extending import typeof_impl

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
