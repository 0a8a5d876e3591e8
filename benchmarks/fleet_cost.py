"""What a robot of a fleet costs: ``python -m benchmarks.fleet_cost [--robots 20] [--rows 60]``, two minutes of one core.

CPU seconds of identification (with five folds) and of looking at a calibration, memory of the process that collects the results,
bytes of the files and on the wire to a Dask cluster of two local workers. Virtual IRB 120, 42 parameters, one reflector.
"""

import resource
import shutil
import tempfile
import time
import tracemalloc
from argparse import ArgumentParser
from collections.abc import Callable
from pathlib import Path

import numpy as np

import taskcal as tc
from taskcal.planning.fleet import find_fleet, identify_campaigns, judge, review_fleet

MANY = 100_000


def cpu_seconds(of: Callable[[], object]) -> float:
    """User and system time of this process."""
    start = time.process_time()
    of()
    return time.process_time() - start


def lay_fleet(folder: Path, model: tc.ErrorModel, robots: int, rows: int) -> None:
    """Campaigns of virtual robots, two of each."""
    rng = np.random.default_rng(0)
    for robot in range(robots):
        place = folder / f"robot-{robot:06d}"
        place.mkdir(parents=True)
        x = None
        for date in ("2026-03-01", "2026-09-01"):
            q = rng.uniform(*0.5 * model.robot.limits.T, size=(rows, 6))
            campaign, truth = tc.simulate(model, q, rng=rng, x=x)
            x = truth.x
            tc.write_campaign(place / f"{date}.csv", campaign, model.robot)


def held_kilobytes(folder: Path, robots: int) -> float:
    """Of the memory that the result holds, for each robot."""
    tracemalloc.start()
    fleet = review_fleet(folder, engine="sequential")
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert len(fleet.robots) == robots
    return held / robots / 1e3


def copies(folder: Path, into: Path, times: int) -> None:
    """The same calibrations under other names."""
    for robot in sorted(folder.iterdir()):
        for k in range(times):
            place = into / f"{robot.name}-{k}"
            place.mkdir(parents=True)
            for file in robot.glob("*.json"):
                (place / file.name).hardlink_to(file)


def over_the_wire(folder: Path, robots: int) -> tuple[float, float]:
    """CPU seconds of the client and kilobytes on this machine's loopback for each robot, both ways, through the scheduler."""
    import psutil

    from tests.laws.cluster import cluster

    def bytes_of(run: Callable[[], object]) -> int:
        start = psutil.net_io_counters(pernic=True)["lo"].bytes_sent
        run()
        return psutil.net_io_counters(pernic=True)["lo"].bytes_sent - start

    with tempfile.TemporaryDirectory() as place, cluster(Path(place)) as started:
        engine = f"dask:{started.address}"
        few = folder.parent / "one"
        copies(folder, few, 0)
        shutil.copytree(next(folder.iterdir()), few / "warm")
        review_fleet(few, engine=engine)
        taken: list[float] = []
        sent = bytes_of(lambda: taken.append(cpu_seconds(lambda: review_fleet(folder, engine=engine))))
    return taken[0] / robots, sent / robots / 1e3


def main() -> None:
    """Measure, and print."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--robots", type=int, default=20)
    parser.add_argument("--rows", type=int, default=60)
    chosen = parser.parse_args()
    model = tc.ErrorModel(tc.load_robot("abb-irb120"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "fleet"
        lay_fleet(folder, model, chosen.robots, chosen.rows)
        sizes = [path.stat().st_size for path in folder.rglob("*.csv")]
        print(f"campaign: {np.mean(sizes) / 1e3:.1f} kB")
        identified = cpu_seconds(lambda: list(identify_campaigns(find_fleet(folder), model, engine="sequential")))
        print(f"identification of {chosen.rows} rows, 5 folds: {identified / len(sizes):.3f} s of CPU time a campaign")
        kept = [path.stat().st_size for path in folder.rglob("*.json")]
        print(f"calibration: {np.mean(kept) / 1e3:.1f} kB")
        looked = cpu_seconds(lambda: review_fleet(folder, engine="sequential"))
        print(f"reading two calibrations and comparing them: {looked / chosen.robots:.3f} s of CPU time a robot")
        large, many = Path(name) / "large", 5 * chosen.robots
        copies(folder, large, 5)
        print(f"memory: {held_kilobytes(large, many):.1f} kB a robot, where the results are collected")
        client, wire = over_the_wire(large, many)
        print(f"through Dask: {client * 1e3:.1f} ms of the client's CPU time and {wire:.0f} kB on the wire a robot")
    rng = np.random.default_rng(0)
    values = rng.standard_normal((MANY, 42))
    judged = cpu_seconds(lambda: judge(values, np.full_like(values, 0.3)))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"outliers among {MANY} robots: {judged:.1f} s of CPU time, {peak:.0f} MB at most")


if __name__ == "__main__":
    main()
