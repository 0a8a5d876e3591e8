"""Closed loop on a simulated robot: plan, measure, identify, correct a milling program, and cut."""

import numpy as np

import taskcal as tc
from taskcal.demo import prepare_closed_loop, run_closed_loop
from taskcal.effects import Backlash, Compliance, Harmonics, WarmUp


def identify(model, campaign):
    """Fit named effects, which is quick; `taskcal demo --full` fits all effects at once."""
    expansion = WarmUp().referred(campaign.conditions)
    effects = Compliance(tolerance=3e-3), Harmonics(tolerance=5e-5), Backlash(), expansion
    return tc.identify(sum(effects, start=model), campaign)


loop = prepare_closed_loop(tc.load_robot("abb-irb6660-205-1.9"), poses=60)
print(f"{len(loop.program.motions)} motions in {loop.milling.source.path}, {len(loop.q)} poses to measure")

run = run_closed_loop(loop, 1, fit=identify)
print("3D error of the true cutter on the part, mm")
for line, error in (("as programmed", run.before), ("touched off", run.touched_off), ("corrected", run.after)):
    rms = np.sqrt((error.length**2).mean())
    print(f"  {line:14} {error.length.max() * 1e3:.3f} max, {rms * 1e3:.3f} rms")
stated = run.correction.uncertainty[np.unique(run.after.move)]
print(f"  {'stated':14} {np.sqrt((stated**2).mean()) * 1e3:.3f} rms")

print("\nrelative to")
for statement in run.correction.statements:
    print(f"  {statement}")
run.correction.write("corrected.mod")
