"""A simulated cell: robots with geometric errors, measured by a simulated tracker and calibrated for a box."""

import numpy as np

import taskcal as tc

model = tc.ErrorModel(tc.load_robot("abb-irb6660-205-1.9"))
print(model)

# the task: a box of 500 × 700 × 500 mm, in which the tool tilts and turns by up to 20°
task = tc.demo.reference_task(spread=np.radians(20.0))
measured = tc.reach_task(model, task, count=60)
new = tc.reach_task(model, task, count=200, seed=1)

means, inside = {"nominal (registered)": [], "all parameters": []}, []
for seed in range(20):
    campaign, truth = tc.simulate(model, measured.q, rng=np.random.default_rng(seed))
    for label, kept in (("nominal (registered)", []), ("all parameters", None)):
        calibration = tc.identify(model, campaign, keep=kept)
        error = (calibration.predict(new.q) - truth.points(new.q))[:, 0]
        means[label].append(np.linalg.norm(error, axis=1).mean() * 1e3)
    # coverage of the last calibration's 95 % intervals
    variance = np.diagonal(calibration.predict_covariance(new.q)[:, 0], axis1=1, axis2=2)
    inside.append(np.mean(np.abs(error) < 1.96 * np.sqrt(variance)))

print("mean 3D error at 200 held-out poses, median of 20 simulated robots:")
for label, values in means.items():
    print(f"  {label}: {np.median(values):.4f} mm")
print(f"coverage of the 95 % intervals: {np.mean(inside):.1%}")
