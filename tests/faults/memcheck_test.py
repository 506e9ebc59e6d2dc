#!/usr/bin/python3
"""Small runs under MPI by valgrind's memcheck: nothing of ours reads what was not written, or beyond what it has. Their hashes are not
compared: valgrind gives some zeros of fused multiply-adds the other sign.

usage: memcheck_test.py PROGRAM [STEPS]
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import PASSAGE, environment_without, grains_in_a_box, state_hash  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parent))
from chaos_test import SCENES  # noqa: E402

HERE = Path(__file__).resolve().parent / "memcheck"
SCENES = SCENES | {"passage": grains_in_a_box(1.0, step=2e-5, stiffness=10000.0, more=PASSAGE)}
RUNS = [("bed", 2, 2), ("gas", 2, 1), ("gas", 3, 1), ("passage", 2, 1)]  # scene, ranks, threads of each
FOUND = 9
# The program would start itself anew to choose how threads wait; valgrind does not follow it there.
ENVIRONMENT = environment_without("OMPI_", "PMIX_") | {
    "OMP_WAIT_POLICY": "passive", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}


def stand_in(folder):
    """A library that is loaded first; None where there is no compiler."""
    library = f"{folder}/timer.so"
    made = subprocess.run(["c++", "-shared", "-fPIC", "-o", library, HERE / "timer.cpp"], capture_output=True)
    return library if made.returncode == 0 else None


def findings(program, folder, name, n_ranks, n_threads, n_steps):
    scene = folder / f"{name}.toml"
    scene.write_text(SCENES[name])
    library = stand_in(folder)
    command = ["mpirun", "-n", n_ranks, "--oversubscribe", "--bind-to", "none", *(["-x", f"LD_PRELOAD={library}"] if library else []),
               "valgrind", "--quiet", f"--error-exitcode={FOUND}", f"--log-file={folder}/valgrind.%p.txt",
               "--suppressions=/usr/share/openmpi/openmpi-valgrind.supp", f"--suppressions={HERE}/suppressions.txt",
               program, "run", scene, "--layout", f"{n_ranks}x{n_threads}", "--steps", n_steps, "--out", folder / "run"]
    done = subprocess.run([str(word) for word in command], text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env=ENVIRONMENT, timeout=1500)
    found = "".join(path.read_text() for path in sorted(folder.glob("valgrind.*.txt")))
    if done.returncode or state_hash(done.stdout) is None:
        found += f"\nexit code {done.returncode}\n{done.stdout}"
    return found


def main():
    if not shutil.which("valgrind"):
        print("valgrind is not installed")
        return 77
    n_bad = 0
    for name, n_ranks, n_threads in RUNS:
        with tempfile.TemporaryDirectory(prefix="moraine-memcheck-") as folder:
            found = findings(sys.argv[1], Path(folder), name, n_ranks, n_threads, sys.argv[2] if len(sys.argv) > 2 else "120")
        print(f"{'BAD' if found.strip() else 'ok '} {name} on {n_ranks}x{n_threads} {found}", flush=True)
        n_bad += bool(found.strip())
    return 1 if n_bad else 0


if __name__ == "__main__":
    sys.exit(main())
