"""Measure anew the tables that answer integrators' questions: ``python docs/questions_study.py reflectors|outside|change``.

Simulated IRB 120 are measured, identified, and compared with the truth. ``reflectors`` prints the table of *One reflector or
three?*, ``outside`` that of *Read the uncertainty*, ``change`` that of *Monitor robots*; each takes some minutes of one core.
"""

import argparse
from collections.abc import Callable, Iterator

import numpy as np

import taskcal as tc

TILTED = 20.0, 40.0
"""Cone and spin of an orientation, degrees: the tool tilted and turned."""


def task(
    name: str, center: tuple[float, float, float], size: tuple[float, float, float], turned: bool = True
) -> tc.Task:
    """Return a box, metres, in which the tool points down."""
    cone, spin = np.radians(TILTED) if turned else (0.0, 0.0)
    return tc.Task(
        name=name,
        workspace=tc.Workspace(
            T_base_frame=np.eye(4),
            shape="box",
            center=np.array(center),
            size=np.array(size),
            turned=np.eye(3),
            orientations=(tc.Orientation(rotation=np.diag([-1.0, 1.0, -1.0]), cone=cone, spin=spin),),
        ),
    )


def model() -> tc.ErrorModel:
    """Return the model of the robots."""
    return tc.ErrorModel(tc.load_robot("abb-irb120"))


FRONT = (0.4, 0.0, 0.35), (0.2, 0.4, 0.2)
"""Centre and size of the box of ``reflectors`` and ``change``, metres."""


def reflectors(robots: int) -> Iterator[tuple[str, int, float, float]]:
    """Yield poses measured, reflectors, and the median errors at new poses: of a reflector, mm, and of the tool's turns, mrad."""
    robot = model()
    tool = {"a": np.array([0.0, 0.0, 0.08]), "b": np.array([0.1, 0.0, 0.0]), "c": np.array([0.0, 0.1, 0.0])}
    tasks = {"one orientation": task("one", *FRONT, turned=False), "tilted and turned": task("tilted", *FRONT)}
    new = tc.reach_task(robot, tasks["tilted and turned"], count=100, seed=7).q
    for name, each in tasks.items():
        measured = tc.reach_task(robot, each, count=60).q
        for seen in ("a", "abc"):
            targets = {target: tool[target] for target in seen}
            errors = [_reflector_errors(robot, measured, new, targets, seed) for seed in range(robots)]
            millimetres, milliradians = np.median(errors, axis=0)
            yield name, len(seen), float(millimetres), float(milliradians)


def _reflector_errors(
    robot: tc.ErrorModel, measured: np.ndarray, new: np.ndarray, targets: dict[str, np.ndarray], seed: int
) -> tuple[float, float]:
    """Of the first reflector, and of the tool's rotation from the first pose to each other; mean over the new poses."""
    campaign, truth = tc.simulate(robot, measured, rng=np.random.default_rng(seed), targets=targets, model_error=5e-5)
    calibration = tc.identify(robot, campaign)
    off = calibration.predict(new)[:, 0] - truth.points(new)[:, 0]
    found, true = calibration.predict_tool(new)[:, :3, :3], truth.poses(new)[:, 0, :3, :3]
    between = np.swapaxes(found[0].T @ found[1:], 1, 2) @ (true[0].T @ true[1:])
    turned = np.arccos(np.clip((np.trace(between, axis1=1, axis2=2) - 1.0) / 2.0, -1.0, 1.0))
    return np.linalg.norm(off, axis=1).mean() * 1e3, turned.mean() * 1e3


def outside(robots: int) -> Iterator[tuple[str, str, float, float, float, float]]:
    """Yield robot, box measured, and for either box the median error and stated uncertainty, mm, of a fit by geometry alone."""
    geometry = model()
    cube = (0.2, 0.2, 0.2)
    tasks = task("here", (0.4, -0.15, 0.3), cube), task("elsewhere", (0.25, 0.35, 0.45), cube)
    new = [tc.reach_task(geometry, each, count=100, seed=7).q for each in tasks]
    small = tc.reach_task(geometry, tasks[0], count=60).q
    both = np.concatenate([tc.reach_task(geometry, each, count=30).q for each in tasks])
    true_models = {"geometric errors only": geometry, "gear errors, too": geometry + tc.effects.GEARS}
    for name, robot in true_models.items():
        for where, measured in (("the first", small), ("both", both)):
            errors = [
                [n for q in new for n in _error_and_stated(geometry, robot, measured, q, s)] for s in range(robots)
            ]
            one, stated_one, two, stated_two = np.median(errors, axis=0)
            yield name, where, float(one), float(stated_one), float(two), float(stated_two)


def _error_and_stated(
    fitted: tc.ErrorModel, robot: tc.ErrorModel, measured: np.ndarray, new: np.ndarray, seed: int
) -> tuple[float, float]:
    """Mean 3D error, and mean stated 3D standard uncertainty, mm."""
    campaign, truth = tc.simulate(robot, measured, rng=np.random.default_rng(seed))
    calibration = tc.identify(fitted, campaign)
    off = np.linalg.norm(calibration.predict(new) - truth.points(new), axis=-1)
    stated = np.sqrt(np.trace(calibration.predict_covariance(new), axis1=-2, axis2=-1))
    return off.mean() * 1e3, stated.mean() * 1e3


def change(robots: int) -> Iterator[tuple[float, int, float, float, float]]:
    """Yield turn of axis 3, mrad, poses measured again, share of robots that show it, difference and expected one, mm."""
    robot, box = model(), task("front", *FRONT)
    first, used = tc.reach_task(robot, box, count=60).q, tc.reach_task(robot, box, count=100, seed=7).q
    again = {count: tc.reach_task(robot, box, count=count, seed=1).q for count in (10, 20, 40)}
    elbow = np.array([name == "J3.rz" for name in robot.names])
    for milliradians in (0.0, 0.5, 1.0):
        for count, q in again.items():
            found = [_compared(robot, first, q, used, 1e-3 * milliradians * elbow, seed) for seed in range(robots)]
            share, difference, expected = np.mean(found, axis=0)
            yield milliradians, count, float(share), float(difference), float(expected)


def _compared(
    robot: tc.ErrorModel, first: np.ndarray, again: np.ndarray, used: np.ndarray, change: np.ndarray, seed: int
) -> tuple[bool, float, float]:
    """Whether the change is detected at 1 %, the difference over the task, and the expected one without a change, mm rms."""
    rng = np.random.default_rng(seed)
    campaign, truth = tc.simulate(robot, first, rng=rng)
    later, _ = tc.simulate(robot, again, rng=rng, x=truth.x + change)
    comparison = tc.compare(tc.identify(robot, campaign), tc.identify(robot, later), used)
    return comparison.chance < 0.01, comparison.rms * 1e3, comparison.expected * 1e3


STUDIES: dict[str, tuple[Callable[[int], Iterator[tuple[str | float, ...]]], int]] = {
    "reflectors": (reflectors, 20),
    "outside": (outside, 20),
    "change": (change, 10),
}
"""What makes each table, and of how many robots the page has it."""


def main() -> None:
    """Print the rows of a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("study", choices=STUDIES)
    study, robots = STUDIES[parser.parse_args().study]
    for row in study(robots):
        print(*(value if isinstance(value, str) else f"{value:.2g}" for value in row), sep="  ", flush=True)


if __name__ == "__main__":
    main()
