#!/usr/bin/env python3
"""Fills the silo slowly, and compares the pressure on its wall with Janssen's law before anything runs out.

    python3 janssen.py [--program ../../moraine] [--out runs/silo_janssen] [-- ARGUMENT...]

Janssen (1895): sigma_h = K sigma_v, sigma_v = rho_b g lambda (1 - exp(-depth / lambda)), lambda = D / (4 mu K). It supposes that the
grains slide down the wall everywhere. A bed that has fallen rebounds, and its wall friction points anywhere; so the filling settles under a
bulk viscosity that keeps it from rebounding. K is the one number that is fitted. Needs Python 3 and nothing else.
"""

import argparse
import csv
import math
import statistics
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
GRAVITY, DIAMETER, FRICTION, DENSITY = 9.81, 0.1, 0.4, 2500.0
END = 0.4  # [s]


def mean_row(path):
    """Means of the columns of a record over its last tenth."""
    with open(path) as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    rows = [row for row in rows if row["time [s]"] > 0.9 * END]
    return {key: statistics.fmean(row[key] for row in rows) for key in rows[0]}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=str(HERE.parents[1] / "moraine"))
    parser.add_argument("--out", type=Path, default=Path("runs/silo_janssen"))
    parser.add_argument("extra", nargs="*", help="further arguments of the run, after --")
    arguments = parser.parse_args()
    if not (arguments.out / "summary.txt").exists():
        subprocess.run([arguments.program, "run", HERE / "scene.toml", "--out", arguments.out, "--set", f"time.end={END}",
                        "--set", "time.damping=200", *arguments.extra], check=True, stdout=subprocess.DEVNULL)

    area = math.pi * DIAMETER ** 2 / 4
    mass = mean_row(arguments.out / "mass.csv")["mass inside [kg]"]
    bulk = DENSITY * mean_row(arguments.out / "region.csv")["solid fraction"]
    depth_of_floor = mass / (bulk * area)
    on_wall, on_floor, on_gate = (-mean_row(arguments.out / f"{name}.csv")["force z [N]"]
                                  for name in ("wall_force", "floor_force", "gate_force"))
    measured = [(float(key.split(" z ")[1].split()[0]), value)
                for key, value in mean_row(arguments.out / "wall_pressure.csv").items() if key.startswith("pressure")]
    measured = [(z, p) for z, p in measured if z < depth_of_floor - 0.01]  # slices that are full

    def vertical(z, k):
        length = DIAMETER / (4 * FRICTION * k)
        return bulk * GRAVITY * length * (1 - math.exp(-(depth_of_floor - z) / length))

    def misfit(k):
        return sum((p - k * vertical(z, k)) ** 2 for z, p in measured)

    k = min((i / 1000 for i in range(100, 1000)), key=misfit)
    print(f"bulk density {bulk:.1f} kg/m3, height {depth_of_floor:.4f} m, weight {mass * GRAVITY:.2f} N, K = {k:.3f}")
    print("height [m]   pressure [Pa]   Janssen [Pa]   ratio")
    for z, p in measured:
        print(f"{z:8.3f}   {p:12.1f}   {k * vertical(z, k):12.1f}   {p / (k * vertical(z, k)):8.3f}")
    base = vertical(0.0, k) * area
    print(f"on the floor and the gate: {on_floor + on_gate:.2f} N, Janssen {base:.2f} N, ratio {(on_floor + on_gate) / base:.3f}")
    print(f"on the wall by friction: {on_wall:.2f} N, Janssen {mass * GRAVITY - base:.2f} N")


if __name__ == "__main__":
    main()
