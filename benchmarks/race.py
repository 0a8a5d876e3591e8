"""Times of several calls against each other, so that a slow moment of the machine hits them all alike."""

import gc
import math
import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import pytest

from benchmarks.baseline import Baseline, Measured

Call = Callable[[], Any]

TURN = 0.02
"""Seconds that one turn should last at least: quick calls are repeated within it."""

ATTEMPTS = 6
"""Races before a ratio counts as too large; the best time of every call over all of them decides."""


Clock = Callable[[], float]


def processor_time() -> float:
    """Seconds of processor time of this process, of all its threads, and of the processes that it has started and that have ended.

    Other work on the machine hardly shows in it, while it does in the time on the wall.
    """
    ended = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + ended.ru_utime + ended.ru_stime


@dataclass(frozen=True, kw_only=True)
class Race:
    """Runs calls in turn and keeps the best time of each."""

    benchmark: Any
    """Fixture of pytest-benchmark, for its table of absolute times."""
    baseline: Baseline
    clock: Clock = time.perf_counter
    tabled: bool = True
    """Whether the call is timed by pytest-benchmark as well, which costs another set of turns."""

    def __call__(
        self, name: str, call: Call, references: Mapping[str, Call], *, below: float | None = None, rounds: int = 5
    ) -> None:
        """Record the ratios "name / reference" and check each against the baseline.

        Args:
            name: what is timed.
            call: it.
            references: what it is timed against, by name.
            below: a bound on all the ratios besides the baseline's.
            rounds: turns of each call.
        """
        calls = [call, *references.values()]
        if self.benchmark.disabled:
            self.benchmark(call)
            for reference in references.values():
                reference()
            return
        repeats = [_repeats(one, self.clock) for one in calls]
        best = [math.inf] * len(calls)
        ratios: dict[str, float] = {}
        complaints: list[str | None] = []
        for _ in range(ATTEMPTS):
            best = [min(pair) for pair in zip(best, _run(calls, repeats, rounds, self.clock), strict=True)]
            ratios = {f"{name} / {other}": best[0] / best[k] for k, other in enumerate(references, start=1)}
            complaints = [self.baseline.complaint(key, ratio, below) for key, ratio in ratios.items()]
            if not any(complaints):
                break
        for (key, ratio), seconds in zip(ratios.items(), best[1:], strict=True):
            self.baseline.record(key, Measured(ratio=ratio, seconds=best[0], reference_seconds=seconds, below=below))
        self.benchmark.extra_info.update(ratios)
        turns = {"rounds": rounds, "iterations": repeats[0]} if self.tabled else {"rounds": 1, "iterations": 1}
        self.benchmark.pedantic(call, **turns)
        if any(complaints):
            pytest.fail("\n".join(filter(None, complaints)), pytrace=False)


def _repeats(call: Call, clock: Clock) -> int:
    """How often a turn has to repeat a call; the first one, which may compile or open files, is not counted."""
    call()
    return max(1, math.ceil(TURN / max(_time(call, 1, clock), 1e-9)))


def _time(call: Call, repeats: int, clock: Clock) -> float:
    """Seconds of one call. The last result is let go only after the clock has stopped."""
    begin = clock()
    for _ in range(repeats):
        result = call()
    end = clock()
    del result
    return (end - begin) / repeats


def _run(calls: list[Call], repeats: list[int], rounds: int, clock: Clock) -> list[float]:
    best = [math.inf] * len(calls)
    gc.collect()
    gc.disable()
    try:
        for turn in range(rounds):
            order = range(len(calls)) if turn % 2 == 0 else reversed(range(len(calls)))
            for k in order:
                best[k] = min(best[k], _time(calls[k], repeats[k], clock))
    finally:
        gc.enable()
    return best
