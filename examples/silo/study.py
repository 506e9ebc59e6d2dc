#!/usr/bin/env python3
"""Discharges the silo through several orifices and fits Beverloo's law W = C rho_b sqrt(g) (D - k d)^n to the rates.

    python3 study.py [--program ../../moraine] [--diameters 0.024 0.030 0.036 0.042] [--out runs/silo_study]

Beverloo, Leniger and van de Velde (1961) drew W^(2/5) against D: a straight line, whose slope gives C and whose zero, at D = k d, gives
k. They found C = 0.58 and k = 1.4; later work has C between 0.55 and 0.65 and k between 1 and 2. The same is done here, and then
the exponent is fitted to the rates with that k. rho_b is the bulk density above the orifice in the run, measured before it
opens. The silo is filled to 0.13 m, less than scene.toml, because the rate does not depend on the height of the filling.
Needs Python 3 and nothing else.
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


def line(x, y):
    """Slope and intercept of the least-squares line."""
    mean_x, mean_y = statistics.fmean(x), statistics.fmean(y)
    slope = sum((a - mean_x) * (b - mean_y) for a, b in zip(x, y)) / sum((a - mean_x) ** 2 for a in x)
    return slope, mean_y - slope * mean_x


def beverloo(diameters, flows):
    """C, k and, with that k, the exponent n, from W / (rho_b sqrt(g)) [m^(5/2)]."""
    slope, intercept = line(diameters, [flow ** 0.4 for flow in flows])
    k = -intercept / slope / GRAIN
    exponent, _ = line([math.log(d - k * GRAIN) for d in diameters], [math.log(flow) for flow in flows])
    return slope ** 2.5, k, exponent


def with_errors(diameters, flows, errors):
    """The same, each with its standard error as the errors of the flows make it."""
    best = beverloo(diameters, flows)
    squares = [0.0] * len(best)
    for i, error in enumerate(errors):
        moved = beverloo(diameters, flows[:i] + [flows[i] + error] + flows[i + 1:])
        squares = [s + (m - b) ** 2 for s, m, b in zip(squares, moved, best)]
    return [(b, math.sqrt(s)) for b, s in zip(best, squares)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=str(HERE.parents[1] / "moraine"))
    parser.add_argument("--diameters", type=float, nargs="+", default=[0.024, 0.030, 0.036, 0.042])
    parser.add_argument("--out", type=Path, default=Path("runs/silo_study"))
    parser.add_argument("extra", nargs="*", help="further arguments of the runs, after --")
    arguments = parser.parse_args()
    flows, errors = [], []
    print("orifice [m]   rate [kg/s]         bulk density [kg/m3]   C with k = 1.4 alone")
    for diameter in arguments.diameters:
        rate, error, bulk = run(arguments.program, diameter, arguments.out / f"orifice_{1000 * diameter:g}mm", arguments.extra)
        flows.append(rate / (bulk * math.sqrt(GRAVITY)))
        errors.append(error / (bulk * math.sqrt(GRAVITY)))
        print(f"{diameter:8.4f}      {rate:.4f} +- {error:.4f}    {bulk:8.1f}               "
              f"{flows[-1] / (diameter - 1.4 * GRAIN) ** 2.5:.3f}", flush=True)
    if len(flows) > 2:
        (constant, dc), (k, dk), (exponent, dn) = with_errors(arguments.diameters, flows, errors)
        print(f"Beverloo: C = {constant:.3f} +- {dc:.3f}, k = {k:.2f} +- {dk:.2f}; the exponent with that k: {exponent:.3f} +- {dn:.3f}")


if __name__ == "__main__":
    main()
