"""Run tests under other kernels of OpenBLAS than the machine's own: `python -m tests.blas_kernels [arguments of pytest]`.

OpenBLAS multiplies by kernels that are written for a processor, whose sums round differently. A result that hangs on rounding is
found by no test that runs on one processor alone.
"""

import os
import platform
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_info

KERNELS = {
    "Nehalem": {"sse4_2"},
    "SkylakeX": {"avx512f", "avx512dq", "avx512bw", "avx512vl"},
    "Haswell": {"avx2", "fma"},
}
"""What a processor must be capable of, as Linux names it, to run each; those that differ most come first."""


def runnable() -> list[str]:
    """Kernels that this processor can run; none where Linux does not say what it is, or another library than OpenBLAS is used."""
    described = Path("/proc/cpuinfo")
    if platform.machine() != "x86_64" or not described.is_file() or own() is None:
        return []
    lines = described.read_text(encoding="utf-8").splitlines()
    flags = {flag for line in lines if line.startswith("flags") for flag in line.split(":")[1].split()}
    return [name for name, needed in KERNELS.items() if needed <= flags]


def own() -> str | None:
    """Kernels that this process uses; None where its library is another than OpenBLAS."""
    np.ones((2, 2)) @ np.ones((2, 2))
    return next((one["architecture"] for one in threadpool_info() if one["internal_api"] == "openblas"), None)


def under(kernel: str) -> dict[str, str]:
    """Environment of a process that uses some kernels."""
    tuned = {"OPENBLAS_L2_SIZE"}  # to another kernel
    return {**{name: value for name, value in os.environ.items() if name not in tuned}, "OPENBLAS_CORETYPE": kernel}


def main(arguments: Sequence[str]) -> int:
    """Run pytest under two others; returns the first exit status that is not zero."""
    others = [name for name in runnable() if name != own()][:2]
    if not others:
        print("this processor can run no other kernels of OpenBLAS: nothing was tried")
    failed = 0
    for kernel in others:
        print(f"-- {kernel}", flush=True)
        ended = subprocess.run([sys.executable, "-m", "pytest", *arguments], env=under(kernel), check=False)
        failed = failed or ended.returncode
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
