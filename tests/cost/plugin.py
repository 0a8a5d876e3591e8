"""A plugin of pytest: what the tests of a run cost, by processor time, which other work on the machine hardly changes.

Loaded by `python -m tests.cost`. Each worker adds up its own tests, and hands the sums over when it ends.
"""

import os
import resource
import time
from collections.abc import Callable, Generator, Mapping
from dataclasses import astuple, dataclass
from typing import Any

import pytest


@dataclass(frozen=True)
class Cost:
    """Seconds."""

    own: float = 0.0
    """Of the processor, in the process of the test."""
    children: float = 0.0
    """Of the processor, in processes that the test started and waited for."""
    wall: float = 0.0

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(self.own + other.own, self.children + other.children, self.wall + other.wall)

    def __sub__(self, other: "Cost") -> "Cost":
        return Cost(self.own - other.own, self.children - other.children, self.wall - other.wall)

    @classmethod
    def now(cls) -> "Cost":
        """Since the process began."""
        children = resource.getrusage(resource.RUSAGE_CHILDREN)
        return cls(time.process_time(), children.ru_utime + children.ru_stime, time.perf_counter())

    def since(self) -> "Cost":
        """From then to now."""
        return Cost.now() - self

    @property
    def processor(self) -> float:
        """In both."""
        return self.own + self.children

    @property
    def waiting(self) -> float:
        """Neither the test nor a process of it had the processor."""
        return max(self.wall - self.processor, 0.0)


PARTS: dict[str, tuple[int, Callable[[str], str]]] = {
    "folder": (40, lambda test: test.partition("::")[0].rpartition("/")[0]),
    "file": (25, lambda test: test.partition("::")[0]),
    "function": (40, lambda test: test.partition("[")[0]),
}
"""By what tests are added up: how many are shown, and which one a test belongs to."""


class Costs:
    """Sums by test and by fixture; of all workers on the one that reports."""

    def __init__(self) -> None:
        self.tests: dict[str, Cost] = {}
        self.fixtures: dict[str, Cost] = {}
        self.collected: list[float] = []
        self._begin = Cost.now()

    def pytest_collection_finish(self) -> None:
        """All that the process has done up to here is start, import and collect."""
        self.collected.append(Cost.now().processor)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        """Set up, call and tear down; what is set up for others belongs to the test that comes first."""
        begin = Cost.now()
        try:
            return (yield)
        finally:
            self.tests[item.nodeid] = self.tests.get(item.nodeid, Cost()) + begin.since()

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[Any]) -> Generator[None, Any, Any]:
        """Set up one fixture of the tests; those that it asks for were set up before."""
        begin, name = Cost.now(), f"{fixturedef.baseid}::{fixturedef.argname}"
        try:
            return (yield)
        finally:
            if fixturedef.baseid:  # not pytest's own, and no parameter
                self.fixtures[name] = self.fixtures.get(name, Cost()) + begin.since()

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Hand over what this worker counted."""
        output = getattr(session.config, "workeroutput", None)
        if output is not None:
            sums = ({name: astuple(cost) for name, cost in own.items()} for own in (self.tests, self.fixtures))
            output["costs"] = [*sums, self.collected]

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any) -> None:
        """Take over what a worker counted; one that crashed has nothing."""
        tests, fixtures, collected = getattr(node, "workeroutput", {}).get("costs", ({}, {}, []))
        for own, theirs in ((self.tests, tests), (self.fixtures, fixtures)):
            for name, cost in theirs.items():
                own[name] = own.get(name, Cost()) + Cost(*cost)
        self.collected.extend(collected)

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        """The tables, as shares of the whole."""
        for line in self.tables(self._begin.since().wall):
            terminalreporter.write_line(line)

    def tables(self, wall: float) -> list[str]:
        """Lines of a report.

        Args:
            wall: seconds that the run took.
        """
        collected = sum(self.collected)
        whole = sum((one.processor for one in self.tests.values()), collected)
        cores = os.cpu_count() or 1
        out = [
            f"processor {whole:.1f} s in {wall:.1f} s on {cores} cores, busy {100.0 * whole / (wall * cores):.0f} %; "
            f"start and collection of {len(self.collected)} processes {_share(collected, whole)}"
        ]
        for part, (keep, by) in PARTS.items():
            out += ["", *_table(part, keep, _summed(self.tests, by), whole)]
        return [*out, "", *_table("fixture", 25, self.fixtures, whole)]


def _summed(costs: Mapping[str, Cost], by: Callable[[str], str]) -> dict[str, Cost]:
    out: dict[str, Cost] = {}
    for test, cost in costs.items():
        out[by(test)] = out.get(by(test), Cost()) + cost
    return out


def _share(seconds: float, whole: float) -> str:
    return f"{100.0 * seconds / whole if whole else 0.0:.1f} %"


def _table(title: str, keep: int, costs: dict[str, Cost], whole: float) -> list[str]:
    first = sorted(costs.items(), key=lambda one: -one[1].processor)[:keep]
    return [
        f"{'processor':>9} {'children':>9} {'waiting':>9}  {title}",
        *(
            f"{_share(cost.processor, whole):>9} {_share(cost.children, whole):>9} {cost.waiting:8.1f}s  {name}"
            for name, cost in first
        ),
    ]


def pytest_configure(config: pytest.Config) -> None:
    config.pluginmanager.register(Costs(), "costs")
