#!/usr/bin/env python3
"""Does one quarter between symmetry planes discharge like the whole? Runs both with several seeds and compares the rates.

    python3 compare.py [--program ../../moraine] [--seeds 4] [--out runs/hopper_compare] [-- ARGUMENT...]

The rate is that of the straight part: from 20 % to 70 % of the grains' mass having left. Arguments after -- go to both
runs. Needs Python 3 and nothing else.
"""

import argparse
import csv
import statistics
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent


def run(program, scene, seed, directory, extra):
    if not (directory / "summary.txt").exists():
        subprocess.run([program, "run", HERE / scene, "--out", directory, "--set", f"particles[0].seed={seed}",
                        "--set", f"particles[1].seed={seed + 1000}", "--set", "output.snapshots=0",
                        "--set", "output.checkpoints=0", *extra], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    with open(directory / "mass.csv") as file:
        rows = [(float(r["time [s]"]), float(r["mass left [kg]"]), float(r["mass born [kg]"])) for r in csv.DictReader(file)]
    return rows


def rate(rows):
    """Mass flow [kg/s] between 20 % and 70 % discharged, by a straight line through the record."""
    part = [(t, left) for t, left, born in rows if 0.2 * born <= left <= 0.7 * born]
    mean_t, mean_left = (statistics.fmean(column) for column in zip(*part))
    return sum((t - mean_t) * (m - mean_left) for t, m in part) / sum((t - mean_t) ** 2 for t, m in part)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=str(HERE.parents[1] / "moraine"))
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--out", type=Path, default=Path("runs/hopper_compare"))
    parser.add_argument("extra", nargs="*", help="further arguments of the runs, after --")
    arguments = parser.parse_args()
    summary = {}
    for name, scene, share in (("quarter", "scene.toml", 4.0), ("whole", "full.toml", 1.0)):
        rates = []
        for seed in range(1, arguments.seeds + 1):
            rates.append(share * rate(run(arguments.program, scene, seed, arguments.out / f"{name}_{seed}", arguments.extra)))
            print(f"{name:8} seed {seed}: {rates[-1]:.3f} kg/s" + (" (4 times the quarter's)" if share > 1 else ""), flush=True)
        error = statistics.stdev(rates) / len(rates) ** 0.5 if len(rates) > 1 else float("nan")
        summary[name] = statistics.fmean(rates), error
        print(f"{name:8} mean  : {summary[name][0]:.3f} +- {error:.3f} kg/s")
    (q, dq), (w, dw) = summary["quarter"], summary["whole"]
    error = (dq ** 2 + dw ** 2) ** 0.5
    print(f"quarter / whole = {q / w:.3f} +- {error / w:.3f}: they differ by {abs(q - w) / error:.1f} standard errors")


if __name__ == "__main__":
    main()
