"""Our own timings in a process of their own: the number of threads is settled when a process starts."""

import json
import os
import subprocess
import sys
from typing import Any

THREAD_VARIABLES = ("RAYON_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def one_thread() -> None:
    """Keep this process, peers included, to one thread; to be called before NumPy is imported."""
    for name in THREAD_VARIABLES:
        os.environ[name] = "1"


def measured_with_threads(module: str, threads: int) -> Any:
    """What `python -m benches.<module>` prints as JSON when truearm may use so many threads."""
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    command = [sys.executable, "-m", f"benches.{module}"]
    found = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(found.stdout)
