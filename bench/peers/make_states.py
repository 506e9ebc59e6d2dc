#!/usr/bin/env python3
"""Write start states of the peer comparison into the current folder: make_states.py [bed20k] [bed200k] [gas200k] (all).

bed20k.csv.gz (beside this script) is a settled bed of 20,000 spheres, d 4 mm, periodic in x (0.08 m), walls at
y = 0 and 0.16 m, floor z = 0. bed200k is ten copies of it along x (0.8 m). gas200k is a granular gas at solid fraction 0.1 in a
periodic cube of 0.406 m, velocities normal with an rms speed of 1 m/s. For each: NAME.csv (x,y,z,r[,vx,vy,vz] in SI) for
Moraine, NAME.data and NAME.lig for LAMMPS and LIGGGHTS. Standard library only.
"""
import gzip, os, random, sys

here = os.path.dirname(os.path.abspath(__file__))
RADIUS, DENSITY = 0.002, 2700.0


def write_csv(name, positions, velocities=None):
    with open(name + ".csv", "w") as out:
        out.write("x,y,z,r" + (",vx,vy,vz" if velocities else "") + "\n")
        for i, p in enumerate(positions):
            row = [*p, RADIUS] + (list(velocities[i]) if velocities else [])
            out.write(",".join(f"{v:.10g}" for v in row) + "\n")


def write_data(name, positions, velocities, box):
    for suffix in (".data", ".lig"):
        with open(name + suffix, "w") as out:
            out.write(f"{name}\n\n{len(positions)} atoms\n1 atom types\n")
            for axis, (low, high) in zip("xyz", box):
                out.write(f"{low:g} {high:g} {axis}lo {axis}hi\n")
            out.write("\nAtoms\n\n")
            for i, p in enumerate(positions, 1):
                out.write(f"{i} 1 {2 * RADIUS:g} {DENSITY:g} {p[0]:.10g} {p[1]:.10g} {p[2]:.10g}\n")
            if velocities:
                out.write("\nVelocities\n\n")
                for i, v in enumerate(velocities, 1):
                    out.write(f"{i} {v[0]:.8g} {v[1]:.8g} {v[2]:.8g} 0 0 0\n")


def write(name, positions, velocities, box):
    write_data(name, positions, velocities, box)
    write_csv(name, positions, velocities)  # last: where it is there, the state is complete


def settled_bed():
    with gzip.open(os.path.join(here, "bed20k.csv.gz"), "rt") as source:
        return [tuple(map(float, line.split(",")[:3])) for line in source.read().split("\n")[1:] if line]


def bed(name, copies):
    grains = settled_bed()
    many = [(x + 0.08 * copy, y, z) for copy in range(copies) for x, y, z in grains]
    write(name, many, None, ((0, 0.08 * copies), (0, 0.16), (0, 0.12)))


def gas(name):
    count, side, length = 200_000, 59, 0.406
    rng = random.Random(7)
    step = length / side
    sites = sorted(rng.sample(range(side**3), count))
    jitter = lambda: rng.uniform(-1, 1) * 0.3 * 0.004
    place = lambda i: (i + 0.5) * step + jitter()
    grains = [(place(s % side), place(s // side % side), place(s // side**2)) for s in sites]
    speed = [[rng.gauss(0, 3**-0.5) for _ in range(3)] for _ in range(count)]
    mean = [sum(v[k] for v in speed) / count for k in range(3)]
    write(name, grains, [[v[k] - mean[k] for k in range(3)] for v in speed], ((0, length),) * 3)


states = {"bed20k": lambda: bed("bed20k", 1), "bed200k": lambda: bed("bed200k", 10), "gas200k": lambda: gas("gas200k")}
for name in sys.argv[1:] or states:
    if name not in states:
        sys.exit(f"make_states.py: there is no state {name}; there are {', '.join(states)}")
    states[name]()
