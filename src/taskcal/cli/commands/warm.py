"""``taskcal warm``: compile all kernels ahead of their first use."""

from collections.abc import Callable
from pathlib import Path
from typing import get_args

import numpy as np
from jaxtyping import Float

from taskcal.cli.options.common import JsonOption
from taskcal.cli.output import tell, write_json
from taskcal.estimation.prior import Huber
from taskcal.identification.identify import identify
from taskcal.identification.validation import validate
from taskcal.kinematics.inverse import Spin, solve_near
from taskcal.planning.workers import side_by_side
from taskcal.robot.catalogue import load_robot
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate


def command(as_json: JsonOption = False) -> None:
    """Compile all kernels ahead of their first use."""
    import os
    from time import perf_counter

    from taskcal.kernels.kernel_cache import announce_compilation, cache_folder, is_warm

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
    """List the kernel folders of every installation that keeps its kernels there."""
    from taskcal.kernels.kernel_cache import cache_folder

    return set(cache_folder().rglob("*.nbc"))


# Compilation of every kernel, by using each once on a handful of poses; two processes share the work where there
# are two cores.

SPINS: tuple[Spin, ...] = get_args(Spin)


def compile_kernels(workers: int) -> None:
    """Use every kernel, in so many processes as there are workers; more than there are uses of kernels find nothing to do."""
    for _ in side_by_side(_use, range(len(USES)), "loky", min(workers, len(USES))):
        pass


def _use(number: int) -> None:
    model = ErrorModel(load_robot("abb-irb6660-205-1.9"))
    rng = np.random.default_rng(0)
    q = rng.uniform(np.radians([-60, -20, 0, -90, -80, -90]), np.radians([60, 40, 40, 90, 80, 90]), (20, 6))
    USES[number](model, q, rng)


def _walk(model: ErrorModel, q: Float[np.ndarray, "n joints"], rng: np.random.Generator) -> None:
    """Walk, close a four-bar, solve for joints."""
    model.jacobian(q)
    model.joint_jacobian(q)
    T = model.poses(q)
    for spin in SPINS:
        solve_near(model, T, q + 1e-3, spin=spin)


def _fit(model: ErrorModel, q: Float[np.ndarray, "n joints"], rng: np.random.Generator) -> None:
    """Identify from points and from poses."""
    for pose in (False, True):
        campaign, _ = simulate(model, q, rng=rng, pose=pose)
        calibration = identify(model, campaign, prior_scale=1.0, model_error=(1e-4, 1e-4))
        identify(model, campaign, prior_scale=1.0, model_error=(1e-4, 1e-4), loss=Huber())
        calibration.predict_covariance(q)
        validate(calibration, campaign, reregister=True)


Use = Callable[[ErrorModel, np.ndarray, np.random.Generator], None]
USES: tuple[Use, ...] = (_fit, _walk)
"""Of the kernels, longest first."""
