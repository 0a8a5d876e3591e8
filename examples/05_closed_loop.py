"""Close the loop on virtual robots: plan, measure, identify, correct a milling program, and cut."""

import numpy as np

import taskcal as tc
from taskcal.demo import prepare_closed_loop, run_closed_loop

loop = prepare_closed_loop(tc.load_robot("abb-irb6660-205-1.9"), poses=60)
print(f"{len(loop.program.moves)} motions in {loop.milling.source.path}, {len(loop.q)} poses to measure")

runs = [run_closed_loop(loop, seed) for seed in range(2)]
print("largest error of the true cutter on the part, mm")
for number, run in enumerate(runs, start=1):
    before, after = run.before.length.max() * 1e3, run.after.length.max() * 1e3
    stated = np.nanmax(run.correction.uncertainty[np.unique(run.before.move)]) * 1e3
    print(f"  robot {number}: {before:.2f} before, {after:.3f} after; stated uncertainty {stated:.3f} (rms)")

print("\nrelative to")
for statement in runs[0].correction.statements:
    print(f"  {statement}")
runs[0].correction.write("corrected.mod")
