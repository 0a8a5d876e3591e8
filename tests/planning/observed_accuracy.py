"""How accurate virtual robots become that are measured without a tracker, by plan and by chance: a table of all ways.

``python -m tests.planning.observed_accuracy [ROBOTS [INSTRUMENT …]]``
"""

import sys

import numpy as np

from taskcal.identification.identify import identify
from taskcal.observations.instrument import find_measurable
from taskcal.virtual.cell import draw_defects
from tests.planning.without_tracker import (
    COUNT,
    INSTRUMENTS,
    MODEL,
    TASK,
    aligned_error,
    instrument_of,
    measure,
    plan_of,
)


def main(robots: int, names: list[str]) -> None:
    print(f"{COUNT} postures, {robots} robots: rms over the task, mm")
    for name in names or (*INSTRUMENTS, "pixels"):
        way, made, rng = instrument_of(name), plan_of(name), np.random.default_rng(1)
        pool = find_measurable(MODEL.nominal, TASK, way, 1500 if name == "pixels" else 300, 99)
        planned: list[float] = []
        chance: list[float] = []
        for _ in range(robots):
            x = draw_defects(MODEL, rng)
            each = [rng.permutation(np.flatnonzero(seen))[: COUNT // way.count] for seen in pool.visible.T]
            pick = np.concatenate(each)
            of = pool.visible[pick].argmax(axis=1)
            for q, things, errors in ((made.q, made.of, planned), (pool.q[pick], of, chance)):
                assert things is not None
                calibration = identify(MODEL, measure(way, q, things, x, rng, made.model_error))
                errors.append(aligned_error(calibration, x, way.T_tool_targets[0]) * 1e3)
        better = np.log(np.divide(chance, planned))
        rms = [np.sqrt(np.mean(np.square(errors))) for errors in (planned, chance)]
        expected = made.expected * 1e3, made.random.mean() * 1e3
        print(
            f"{name:8} planned {rms[0]:.3f} (expected {expected[0]:.3f}), by chance {rms[1]:.3f} ({expected[1]:.3f}); by chance "
            f"{100 * np.mean(better):.0f} ± {100 * np.std(better) / np.sqrt(robots):.0f} % more (mean of logarithms, 1σ)"
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 20, sys.argv[2:])
