#!/usr/bin/python3
"""More ranks or threads than cores, and one core alone, do the same run to the same bits.

usage: overload_test.py PROGRAM
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import state_hash  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parent))
from chaos_test import ENVIRONMENT, SCENES  # noqa: E402

LAYOUTS = [("1x1", None), ("64x1", None), ("1x64", None), ("8x8", None), ("2x2", 1), ("4x1", 1)]  # CPUs allowed


def main():
    program = str(Path(sys.argv[1]).resolve())
    hashes = {}
    with tempfile.TemporaryDirectory(prefix="moraine-overload-") as folder:
        scene = Path(folder) / "gas.toml"
        scene.write_text(SCENES["gas"])
        for layout, n_cpus in LAYOUTS:
            limit = None
            if n_cpus:
                cpus = sorted(os.sched_getaffinity(0))[:n_cpus]
                limit = lambda: os.sched_setaffinity(0, cpus)  # noqa: E731
            done = subprocess.run([program, "run", scene, "--layout", layout, "--steps", "60", "--no-output", "--out",
                                   f"{folder}/{layout}-{n_cpus}"], text=True, capture_output=True, env=ENVIRONMENT,
                                  preexec_fn=limit, timeout=900)
            found = state_hash(done.stdout) if done.returncode == 0 else None
            hashes[layout, n_cpus] = found or done.stdout + done.stderr
            print(layout, "on one CPU:" if n_cpus else "on all CPUs:", hashes[layout, n_cpus], flush=True)
    return 0 if len(set(hashes.values())) == 1 else 1


if __name__ == "__main__":
    sys.exit(main())
