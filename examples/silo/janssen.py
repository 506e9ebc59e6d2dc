#!/usr/bin/env python3
"""Fills the silo slowly, and compares the pressure on its wall with Janssen's law before anything runs out.

    python3 janssen.py [--program ../../moraine] [--out runs/silo_janssen] [-- ARGUMENT...]

Janssen (1895): sigma_h = K sigma_v, sigma_v = rho_b g lambda (1 - exp(-depth / lambda)), lambda = D / (4 mu K). It supposes that the
grains slide down the wall everywhere, with all of their friction. A bed that has fallen in lies still, and its wall friction points anywhere.
So, as in experiments, the floor is then lowered by a fraction of a grain, slowly: first the filling settles under a bulk viscosity that keeps
it from rebounding, then the floor and the gate go down together, and the pressures are means over the second half of that. K is the one
number that is fitted. Needs Python 3 and nothing else.
"""

import argparse
import csv
import math
import statistics
import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent
GRAVITY, DIAMETER, DENSITY = 9.81, 0.1, 2500.0
BEADS, FRICTION = 0.5, 0.3  # between beads; at the wall: smoother than the beads, or they roll down the wall and do not slide
FILLED, END = 0.4, 0.65  # [s] when the floor begins to go down, and the end
SPEED = 0.002  # [m/s] of the floor


def mean_row(path):
    """Means of the columns of a record over the second half of the floor's way."""
    with open(path) as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    rows = [row for row in rows if row["time [s]"] > (FILLED + END) / 2]
    return {key: statistics.fmean(row[key] for row in rows) for key in rows[0]}


def run(program, out, extra):
    """Fills under a bulk viscosity; goes on from there without it (it would hold the grains up) and lowers floor and gate."""
    down = f'[{{ type = "translate", velocity = [0.0, 0.0, {-SPEED}], ramp = [[{FILLED}, 0.0], [{FILLED + 0.02}, 1.0]] }}]'
    always = {"wall[0].cylinder.base": "[0.0, 0.0, -0.02]", "wall[0].cylinder.length": 0.22, "probe[1].bins": 11,  # room below
              "probe[7].region.low": "[-0.05, -0.05, 0.02]", "probe[7].region.high": "[0.05, 0.05, 0.12]",  # all of the cross-section
              "contact.pair[0].friction": BEADS, "contact.pair[1].friction": FRICTION,
              "wall[1].motion": down, "wall[2].motion": down, "wall[2].until": 100.0}
    for end, damping in ((FILLED, 200.0), (END, 2.0)):
        settings = [f"{key}={value}" for key, value in {**always, "time.end": end, "time.damping": damping}.items()]
        subprocess.run([program, "run", HERE / "scene.toml", "--out", out, "--restart", "auto",
                        *(word for setting in settings for word in ("--set", setting)), *extra], check=True, stdout=subprocess.DEVNULL)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=str(HERE.parents[1] / "moraine"))
    parser.add_argument("--out", type=Path, default=Path("runs/silo_janssen"))
    parser.add_argument("extra", nargs="*", help="further arguments of the run, after --")
    arguments = parser.parse_args()
    run(arguments.program, arguments.out, arguments.extra)

    area = math.pi * DIAMETER ** 2 / 4
    mass = mean_row(arguments.out / "mass.csv")["mass inside [kg]"]
    bulk = DENSITY * mean_row(arguments.out / "region.csv")["solid fraction"] / (math.pi / 4)  # the box around it
    depth_of_floor = mass / (bulk * area)
    on_wall, on_floor, on_gate = (-mean_row(arguments.out / f"{name}.csv")["force z [N]"]
                                  for name in ("wall_force", "floor_force", "gate_force"))
    slices = [(float(key.split(" z ")[1].split()[0]), value)
              for key, value in mean_row(arguments.out / "wall_pressure.csv").items() if key.startswith("pressure")]
    measured = [(z, p) for z, p in slices if 0 < z < depth_of_floor - 0.01]  # slices that are full

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
    pushed = math.pi * DIAMETER * 0.02 * sum(p for z, p in slices)
    print(f"friction at work on the wall: {on_wall / (FRICTION * pushed):.3f} of Coulomb's")


if __name__ == "__main__":
    main()
