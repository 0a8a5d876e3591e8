"""The same seed gives the same bytes, on any number of threads and in any process."""

import hashlib
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np

from taskcal.identification.identify import identify
from taskcal.kernels import chunks
from taskcal.robot.catalogue import load_robot
from taskcal.robot.effects import EncoderGain
from taskcal.robot.error_model import ErrorModel
from taskcal.virtual.cell import simulate

ROOT = Path(__file__).parents[2]


def digest(rows: int) -> str:
    """Of a virtual campaign and all that is identified and predicted of it."""
    rng, model = np.random.default_rng(7), ErrorModel(load_robot("abb-irb120")) + EncoderGain()
    campaign, _ = simulate(model, rng.uniform(-1.0, 1.0, (rows, 6)), rng=rng)
    found = identify(model, campaign)
    q = rng.uniform(-1.0, 1.0, (50, 6))
    arrays = (campaign.points, found.z, found.z_covariance, found.residuals, found.predict_covariance(q))
    return hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()


def test_identify_is_byte_identical_across_threads_and_hashes() -> None:
    """Another process with other thread counts and hash seeds writes the same bytes."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "3")
    code = f"from {__name__} import digest; print(digest(40))"
    ended = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, text=True, check=False, cwd=ROOT, env={**os.environ, **threads, "PYTHONHASHSEED": "5"},
    )  # fmt: skip
    assert ended.stdout.strip() == digest(40), ended.stderr


def test_rows_on_one_thread_and_on_three_give_the_same_bytes(monkeypatch) -> None:
    rows, found = chunks.CHUNK + 100, set()
    for threads in (1, 3):
        with ThreadPoolExecutor(threads) as pool:
            monkeypatch.setattr(chunks, "_pool", lambda pool=pool: pool)
            found.add(digest(rows))
    assert len(found) == 1
