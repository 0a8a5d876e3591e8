"""How Taskcal's two compiled passes grow, each alone: sensitivities, and normal equations, which store none of them.

Rows beyond a block are drawn, passed over and let go block by block, so that memory stays that of one block.
"""

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from threadpoolctl import threadpool_limits

import taskcal as tc
from benchmarks.peers.cases import REFLECTOR, chain_model
from taskcal.campaigns.campaign import Campaign
from taskcal.identification.layout import Layout, layout_of
from taskcal.identification.problem import problem_of, whitener
from taskcal.registration.registration import register
from taskcal.robot.error_model import ErrorModel

BLOCK = 100_000
"""Poses of a block."""
CHAIN_POSES = 1000
"""Poses of which cost against parameters is measured."""
TURNS = 0.5
"""Seconds for repetitions of what is quick, the best of which counts."""

Row = dict[str, Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class Passes:
    """A robot whose poses are passed over."""

    model: ErrorModel
    rng: np.random.Generator

    def campaign(self, n: int) -> Campaign:
        """Measured points of a virtual robot, its joints anywhere within half their range."""
        q = self.rng.uniform(*0.25 * self.model.robot.limits.T, size=(n, len(self.model.robot.limits)))
        return tc.simulate(self.model, q, rng=self.rng, targets={"smr": REFLECTOR})[0]

    def layout(self) -> Layout:
        """All parameters, the tracker's frame and the target, from a registration of few rows."""
        few = self.campaign(100)
        return layout_of(self.model, np.arange(len(self.model)), register(self.model, few), few, fixed=False)

    def seconds(self, n: int) -> dict[str, float]:
        """Processor time of both passes over so many poses."""
        layout = self.layout()
        z = layout.start()
        spent = {"sensitivities": 0.0, "normal equations": 0.0}
        J = self.model.jacobian(self.campaign(min(n, BLOCK)).q, angular=False)  # memory that is there already
        for size in blocks(n):
            rows = self.campaign(size)
            problem = problem_of(layout, rows, None)
            equations = problem.equations(whitener(problem.noise))
            spent["sensitivities"] += self._sensitivities(rows.q, J[:size], once=n > BLOCK)
            spent["normal equations"] += best(lambda passed=equations: passed(z), once=n > BLOCK)
        return spent

    def _sensitivities(self, q: Float[np.ndarray, "n joints"], J: Float[np.ndarray, "n 3 p"], *, once: bool) -> float:
        return best(lambda: self.model.jacobian(q, angular=False, out=J), once=once)


def blocks(n: int) -> Iterator[int]:
    """Sizes of the blocks of so many rows."""
    for begin in range(0, n, BLOCK):
        yield min(BLOCK, n - begin)


def best(call: Callable[[], Any], *, once: bool) -> float:
    """Processor time of a call, the best of several where it need not be enough to call it once."""
    if not once:
        call()
    least, spent = math.inf, 0.0
    while spent < TURNS:
        begin = time.process_time()
        call()
        last = time.process_time() - begin
        least, spent = min(least, last), spent + last
        if once:
            break
    return least


def measure_scaling(poses: tuple[int, ...], joints: tuple[int, ...], say: Callable[[str], None]) -> Row:
    """Both passes against poses, of the UR10, and against parameters, of chains with so many joints; BLAS has one thread."""
    with threadpool_limits(1):
        return _measure(poses, joints, say)


def _measure(poses: tuple[int, ...], joints: tuple[int, ...], say: Callable[[str], None]) -> Row:
    result: Row = {"poses": [], "parameters": []}
    ur10 = Passes(model=ErrorModel(tc.load_robot("ur10")), rng=np.random.default_rng(0))
    for size in poses:
        result["poses"].append({"size": size, **ur10.seconds(size)})
        say(f"UR10: {result['poses'][-1]}")
    for count in joints:
        rng = np.random.default_rng(0)
        chain = Passes(model=chain_model(count, rng), rng=rng)
        result["parameters"].append({"size": len(chain.model), **chain.seconds(CHAIN_POSES)})
        say(f"{count} joints: {result['parameters'][-1]}")
    return result
