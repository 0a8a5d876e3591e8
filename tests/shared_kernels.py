"""Workers of one run compile a kernel once: whoever needs it meanwhile waits for the first one's machine code."""

from pathlib import Path
from typing import Any


def share_kernels() -> None:
    """Let this process hold a lock on each kernel while it compiles it; nothing where the system has no such locks."""
    try:
        import fcntl
    except ImportError:  # Windows, where every worker compiles for itself
        return
    from taskcal.kernels.kernel_cache import _KernelCache, cache_folder

    load, save = _KernelCache.load_overload, _KernelCache.save_overload

    def load_or_lock(self: Any, sig: Any, target_context: Any) -> Any:
        path = Path(cache_folder()) / f"{self._impl.filename_base}.lock"
        lock = self.lock = path.open("w")
        fcntl.flock(lock, fcntl.LOCK_EX)
        loaded = load(self, sig, target_context)
        if loaded is not None:
            lock.close()
        return loaded

    def save_and_unlock(self: Any, sig: Any, data: Any) -> None:
        save(self, sig, data)
        self.lock.close()

    _KernelCache.load_overload, _KernelCache.save_overload = load_or_lock, save_and_unlock
