#!/usr/bin/env python3
"""Discharges the silo through several orifices and fits Beverloo's law W = C rho_b sqrt(g) (D - k d)^n to the rates.

    python3 study.py [--program ../../moraine] [--diameters 0.024 0.030 0.036 0.042] [--out runs/silo_study]

Beverloo, Leniger and van de Velde (1961) found C = 0.58, n = 5/2 and k = 1.4; later work has C between 0.55 and 0.65 and k
between 1 and 2. k is fixed here, because rates over such a range of D cannot tell it from n. rho_b is the bulk density
above the orifice in the run, measured before it opens. The silo is filled to 0.13 m, less than scene.toml, because the rate
does not depend on the height of the filling. Needs Python 3 and nothing else.
"""

import argparse
import csv
import math
import statistics
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
GRAVITY, GRAIN = 9.81, 0.004  # [m/s2], mean diameter [m]
DENSITY = 2500.0              # [kg/m3] of glass
GATE, END = 0.3, 0.9          # [s]


def read(path):
    with open(path) as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


def run(program, diameter, directory, extra):
    """Runs one orifice unless its results are there. Returns the rate [kg/s], its standard error, and the bulk density [kg/m3]."""
    if not (directory / "summary.txt").exists():
        settings = {"wall[1].disc.hole_radius": diameter / 2, "wall[2].disc.radius": diameter / 2, "wall[2].until": GATE,
                    "time.end": END, "particles[0].fill.region.cylinder.length": 0.13,
                    "output.snapshots": 0, "output.checkpoints": 0}
        arguments = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
        subprocess.run([program, "run", HERE / "scene.toml", "--out", directory, *arguments, *extra],
                       check=True, stdout=subprocess.DEVNULL)
    rows = [(r["time [s]"], r["mass left [kg]"]) for r in read(directory / "mass.csv")]
    # The first tenth of a second after the opening is left out; the rest in four parts gives mean and error.
    edges = [GATE + 0.1 + (END - GATE - 0.1) * i / 4 for i in range(5)]
    left = [min(rows, key=lambda row: abs(row[0] - edge)) for edge in edges]
    rates = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in zip(left, left[1:])]
    solid = [r["solid fraction"] for r in read(directory / "region.csv") if 0.8 * GATE < r["time [s]"] < GATE]
    return statistics.fmean(rates), statistics.stdev(rates) / 2, DENSITY * statistics.fmean(solid)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=str(HERE.parents[1] / "moraine"))
    parser.add_argument("--diameters", type=float, nargs="+", default=[0.024, 0.030, 0.036, 0.042])
    parser.add_argument("--out", type=Path, default=Path("runs/silo_study"))
    parser.add_argument("--k", type=float, default=1.4)
    parser.add_argument("extra", nargs="*", help="further arguments of the runs, after --")
    arguments = parser.parse_args()
    points = []
    print("orifice [m]   rate [kg/s]         bulk density [kg/m3]   C (with n = 5/2)")
    for diameter in arguments.diameters:
        rate, error, bulk = run(arguments.program, diameter, arguments.out / f"orifice_{1000 * diameter:g}mm", arguments.extra)
        free = diameter - arguments.k * GRAIN
        print(f"{diameter:8.4f}      {rate:.4f} +- {error:.4f}    {bulk:8.1f}               "
              f"{rate / (bulk * math.sqrt(GRAVITY) * free ** 2.5):.3f}", flush=True)
        points.append((math.log(free), math.log(rate / (bulk * math.sqrt(GRAVITY)))))
    if len(points) > 1:
        x, y = (statistics.fmean(column) for column in zip(*points))
        exponent = sum((a - x) * (b - y) for a, b in points) / sum((a - x) ** 2 for a, _ in points)
        constant = math.exp(statistics.fmean(b - 2.5 * a for a, b in points))
        print(f"fit with k = {arguments.k:g}: exponent {exponent:.3f} (Beverloo 2.5); with the exponent 2.5, C = {constant:.3f}")


if __name__ == "__main__":
    main()
