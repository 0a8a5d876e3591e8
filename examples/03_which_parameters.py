"""Parameters of a task: their sensitivity, their identifiability, and the smallest sufficient set."""

import numpy as np

import taskcal as tc

model = tc.ErrorModel(tc.load_robot("abb-irb6660-205-1.9"))
task = tc.demo.reference_task()  # one tool orientation
q = tc.reach_task(model, task, count=60).q

table = tc.sensitivity(model, q).columns()  # with pandas installed, .to_frame()
for k in np.argsort(-table["max_space_um"].round(6), kind="stable")[:5]:
    print(f"{table['parameter'][k]:>11}  {table['tolerance'][k]:8}  {table['max_space_um'][k]:6.1f} µm at most")

found = tc.identifiability(model, q)
print(f"\n{found.rank} of {len(model)} are identifiable; without effect: {', '.join(found.zero)}")
for name, relation in list(found.dependent.items())[:4]:
    print(f"  {name} =", " ".join(f"{c:+.4g}·{other}" for other, c in relation.items()))

chosen = tc.select(model, task)
print(f"\n{chosen.why}: {len(chosen.kept)} parameters")
for nested in chosen.ladder:
    if nested.size in (len(model), 33, 20, len(chosen.kept), 5, 0):
        print(f"  {nested.size:2d} parameters: {nested.expected * 1e3:.4f} mm expected")
