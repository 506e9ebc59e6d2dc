#!/usr/bin/python3
"""The memory that `moraine check` foretells is that which a run takes at its peak, within 30 %: for the examples, and for
larger ones.

usage: memory_test.py PROJECT PROGRAM plain|long
"""

import re
import subprocess
import sys
import tempfile
from pathlib import Path

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


def main():
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
