"""Close the loop on virtual robots: plan, measure, identify, correct a milling program, and cut."""

import numpy as np

import taskcal as tc
from taskcal.demo.closed_loop import furnish, go_round

shop = furnish(tc.load_robot("abb-irb6660-205-1.9"), poses=60)
print(f"{len(shop.program.moves)} motions in {shop.milling.source.path}, {len(shop.q)} poses to measure")

trips = [go_round(shop, seed) for seed in range(2)]
print("largest error of the true cutter on the part, mm")
for number, trip in enumerate(trips, start=1):
    before, after = trip.before.length.max() * 1e3, trip.after.length.max() * 1e3
    stated = np.nanmax(trip.correction.uncertainty[np.unique(trip.before.move)]) * 1e3
    print(f"  robot {number}: {before:.2f} before, {after:.3f} after; stated uncertainty {stated:.3f} (rms)")

print("\nrelative to")
for statement in trips[0].correction.statements:
    print(f"  {statement}")
trips[0].correction.write("corrected.mod")
