#!/usr/bin/python3
"""The memory that `moraine check` foretells is that which a run takes at its peak, within 30 %: for the examples, and for
larger ones. And a run of many steps, through which grains come and go, takes no more at its end than at its beginning.

usage: memory_test.py PROJECT PROGRAM plain|long
       memory_test.py PROJECT PROGRAM flat [STEPS [LAYOUT...]]
"""

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import PASSAGE, environment_without, grains_in_a_box  # noqa: E402

sys.path.insert(0, str(Path(__file__).resolve().parent))
from chaos_test import session_members  # noqa: E402

PROJECT, PROGRAM = Path(sys.argv[1]), sys.argv[2]
TOLERANCE = 0.3
DEEP_TENTH = ["domain.high=[0.64,0.64,0.2]", "gas.cells=[64,64,20]", "particles[0].fill.count=256000"]
CASES = {
    "plain": [("settled_bed", []), ("silo", []), ("fluidized_bed", []), ("jet_bed", []),
              ("deep_bed", ["domain.high=[0.64,0.64,0.1]", "gas.cells=[64,64,10]", "particles[0].fill.count=100000"])],
    "long": [("large_bed", ["particles[0].fill.count=640000"]), ("deep_bed", DEEP_TENTH),
             ("deep_bed", ["particles[0].fill.count=2560"]), ("large_bed", []), ("deep_bed", [])],
}
UNITS = {"kB": 1e3, "MB": 1e6, "GB": 1e9, "TB": 1e12}


def amount(pattern, text):
    number, unit = re.search(pattern + r" ([0-9.]+) ([kMGT]B)", text).groups()
    return float(number) * UNITS[unit]


def moraine(*words):
    return subprocess.run([PROGRAM, *words], text=True, capture_output=True, check=True).stdout


STEP = 2e-5  # [s]
MAY_GROW = 1 << 20  # [bytes] a leak of one byte a step would be seen in a million steps


def resident(session):
    """Memory of the processes of a run [bytes]."""
    total = 0
    for pid, (name, _) in session_members(session).items():
        try:
            status = Path(f"/proc/{pid}/status").read_text()
        except OSError:  # gone meanwhile
            continue
        found = re.search(r"^VmRSS:\s+(\d+) kB", status, re.MULTILINE)
        total += int(found.group(1)) << 10 if found and name == "moraine" else 0
    return total


def is_flat(n_steps, layout):
    """Runs so many steps with an inlet, an outlet, probes, snapshots and checkpoints, and watches the memory."""
    with tempfile.TemporaryDirectory(prefix="moraine-flat-") as folder:
        scene = Path(folder) / "scene.toml"
        scene.write_text(grains_in_a_box(n_steps * STEP, step=STEP, stiffness=10000.0, more=PASSAGE))
        run = subprocess.Popen([PROGRAM, "run", scene, "--layout", layout, "--out", folder + "/run"], text=True,
                               stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment_without("OMPI_", "PMIX_"),
                               start_new_session=True)
        samples = []
        while run.poll() is None:
            samples.append(resident(run.pid))
            time.sleep(0.1)
        said = run.stdout.read()
    n = len(samples)
    if run.returncode != 0 or n < 20:
        print(said, f"exit code {run.returncode}, {n} samples of memory")
        return False
    passed = re.search(r"^.*born.*$", said, re.MULTILINE)
    first, last = max(samples[n // 5:n // 2]), max(samples[-n // 4:-2])
    print(f"{layout}, {n_steps} steps: {first / 1e6:.2f} MB at most in the first half, {last / 1e6:.2f} MB in the last quarter;",
          passed.group(0).strip() if passed else "no grains came and went", flush=True)
    return bool(passed) and 0 < first and last - first <= MAY_GROW


def stays_flat(words):
    n_steps = int(words[0]) if words else 1_000_000
    return all([is_flat(n_steps, layout) for layout in words[1:] or ["1x1", "2x1"]])


def main():
    if sys.argv[3] == "flat":
        return 0 if stays_flat(sys.argv[4:]) else 1
    n_wrong = 0
    for example, settings in CASES[sys.argv[3]]:
        scene = [str(PROJECT / "examples" / example / "scene.toml"), "--layout", "1x1"]
        for setting in settings:
            scene += ["--set", setting]
        said = amount(r"memory +about", moraine("check", *scene))
        with tempfile.TemporaryDirectory(prefix="moraine-memory-") as folder:
            real = amount(r"peak memory:", moraine("run", *scene, "--steps", "30", "--out", folder + "/run"))
        is_good = abs(said - real) <= TOLERANCE * real
        n_wrong += not is_good
        print(f"{'ok ' if is_good else 'BAD'} {example} {' '.join(settings)}: {said / 1e6:.0f} MB foretold, {real / 1e6:.0f} MB at the peak")
    return 1 if n_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
