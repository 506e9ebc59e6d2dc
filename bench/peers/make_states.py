#!/usr/bin/env python3
"""Write start states of the peer comparison into the current folder: make_states.py [NAME]... (all).

bed20k.csv.gz (beside this script) is a settled bed of 20,000 spheres, d 4 mm, periodic in x (0.08 m), walls at
y = 0 and 0.16 m, floor z = 0. bed200k is ten copies of it along x (0.8 m). gas200k is a granular gas at solid fraction 0.1 in a
periodic cube of 0.406 m, velocities normal with an rms speed of 1 m/s. drum38k and hopper40k are a drum of two sizes and a hopper in
flow, as Moraine left them (start_drum.toml, start_hopper.toml), with their meshes drum.stl and hopper.stl.

For each: NAME.csv (SI) for Moraine, NAME.data and NAME.lig for LAMMPS and LIGGGHTS. Standard library only.

    make_states.py --keep RUN NAME    # for who makes them anew: NAME.csv.gz, beside this script, from a run that was exported by --csv
    make_states.py --meshes           # the meshes alone
"""
import glob, gzip, math, os, random, sys

here = os.path.dirname(os.path.abspath(__file__))
RADIUS, DENSITY = 0.002, 2700.0
DRUM = [("small", 0.001, 2500.0), ("large", 0.002, 2000.0)]    # material, radius, density; types 1 and 2, the drum is type 3
N_AROUND = 64    # facets of a mesh


class Grain:
    def __init__(self, position, radius=RADIUS, velocity=(0, 0, 0), spin=(0, 0, 0)):
        self.position, self.radius, self.velocity, self.spin = position, radius, velocity, spin


def columns(motion, with_material):
    return ["x", "y", "z", "r"] + (["vx", "vy", "vz", "wx", "wy", "wz"] if motion else []) + (["material"] if with_material else [])


def write_csv(name, grains, kinds, motion):
    with open(name + ".csv", "w") as out:
        out.write(",".join(columns(motion, len(kinds) > 1)) + "\n")
        for g in grains:
            row = [f"{v:.10g}" for v in (*g.position, g.radius, *((*g.velocity, *g.spin) if motion else ()))]
            out.write(",".join(row + ([kind_of(g, kinds)[1]] if len(kinds) > 1 else [])) + "\n")


def kind_of(grain, kinds):
    """Type of the peers, material of Moraine, density."""
    if len(kinds) == 1:
        return 1, kinds[0][0], kinds[0][2]
    return next((i, name, density) for i, (name, radius, density) in enumerate(kinds, 1) if abs(grain.radius - radius) < 1e-9)


def write_data(name, grains, kinds, motion, box, n_types):
    for suffix, types in ((".data", len(kinds)), (".lig", n_types)):
        with open(name + suffix, "w") as out:
            out.write(f"{name}\n\n{len(grains)} atoms\n{types} atom types\n")
            for axis, (low, high) in zip("xyz", box):
                out.write(f"{low:g} {high:g} {axis}lo {axis}hi\n")
            out.write("\nAtoms\n\n")
            for i, g in enumerate(grains, 1):
                kind, _, density = kind_of(g, kinds)
                out.write(f"{i} {kind} {2 * g.radius:g} {density:g} " + " ".join(f"{v:.10g}" for v in g.position) + "\n")
            if motion:
                out.write("\nVelocities\n\n")
                for i, g in enumerate(grains, 1):
                    out.write(f"{i} " + " ".join(f"{v:.8g}" for v in (*g.velocity, *g.spin)) + "\n")


def write(name, grains, box, motion=False, kinds=(("glass", RADIUS, DENSITY),), n_types=1):
    write_data(name, grains, kinds, motion, box, n_types)
    write_csv(name, grains, kinds, motion)  # last: where it is there, the state is complete


def read_rows(name):
    with gzip.open(os.path.join(here, name + ".csv.gz"), "rt") as source:
        return [tuple(map(float, line.split(","))) for line in source.read().split("\n")[1:] if line]


def bed(name, copies):
    grains = read_rows("bed20k")
    many = [Grain((x + 0.08 * copy, y, z)) for copy in range(copies) for x, y, z, *_ in grains]
    write(name, many, ((0, 0.08 * copies), (0, 0.16), (0, 0.12)))


def gas(name):
    count, side, length = 200_000, 59, 0.406
    rng = random.Random(7)
    step = length / side
    sites = sorted(rng.sample(range(side**3), count))
    jitter = lambda: rng.uniform(-1, 1) * 0.3 * 0.004
    place = lambda i: (i + 0.5) * step + jitter()
    places = [(place(s % side), place(s // side % side), place(s // side**2)) for s in sites]
    speed = [[rng.gauss(0, 3**-0.5) for _ in range(3)] for _ in range(count)]
    mean = [sum(v[k] for v in speed) / count for k in range(3)]
    grains = [Grain(p, velocity=[v[k] - mean[k] for k in range(3)]) for p, v in zip(places, speed)]
    write(name, grains, ((0, length),) * 3, motion=True)


def in_flow(name):
    return [Grain(row[:3], row[3], row[4:7], row[7:10]) for row in read_rows(name)]


def drum(name):
    write_stl("drum.stl", drum_mesh())
    write(name, in_flow(name), ((-0.105, 0.105), (-0.005, 0.105), (-0.105, 0.105)), True, DRUM, 3)


def hopper(name):
    write_stl("hopper.stl", hopper_mesh())
    write(name, in_flow(name), ((-0.095, 0.095), (-0.095, 0.095), (0, 0.4)), True)


def drum_mesh():
    """A closed cylinder along y, radius 0.1 m, from 0 to 0.1 m."""
    radius, length = 0.1, 0.1
    at = lambda i, y: (radius * math.cos(2 * math.pi * i / N_AROUND), y, radius * math.sin(2 * math.pi * i / N_AROUND))
    rings = [length * k / 8 for k in range(9)]
    for i in range(N_AROUND):
        for low, high in zip(rings, rings[1:]):
            yield from quad(at(i, low), at(i + 1, low), at(i + 1, high), at(i, high))
        for y in (0.0, length):
            yield (0.0, y, 0.0), at(i, y), at(i + 1, y)


def hopper_mesh():
    """A bin of radius 90 mm from z = 0.16 to 0.4 m, on a cone that narrows to 22 mm at 0.06 m."""
    profile = [(0.022, 0.06), (0.039, 0.085), (0.056, 0.11), (0.073, 0.135)] + [(0.09, 0.16 + 0.03 * k) for k in range(9)]
    at = lambda i, r, z: (r * math.cos(2 * math.pi * i / N_AROUND), r * math.sin(2 * math.pi * i / N_AROUND), z)
    for low, high in zip(profile, profile[1:]):
        for i in range(N_AROUND):
            yield from quad(at(i, *low), at(i + 1, *low), at(i + 1, *high), at(i, *high))


def quad(a, b, c, d):
    yield a, b, c
    yield a, c, d


def write_stl(path, triangles):
    """In text: all codes read it."""
    number = lambda p: " ".join(f"{v:.9g}" for v in p)
    with open(path, "w") as out:
        out.write("solid mesh\n")
        for t in triangles:
            u, v = [[q - p for p, q in zip(t[0], corner)] for corner in t[1:]]
            n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
            size = math.sqrt(sum(x * x for x in n))
            out.write(f"facet normal {number([x / size for x in n])}\nouter loop\n")
            out.writelines(f"vertex {number(corner)}\n" for corner in t)
            out.write("endloop\nendfacet\n")
        out.write("endsolid mesh\n")


def keep(run, name):
    """Positions to 1e-7 m, radii, velocities and spins, from the last table that `moraine export RUN --csv` has left."""
    tables = sorted(glob.glob(os.path.join(run, "csv", "grains_*.csv")))
    if not tables:
        sys.exit(f"make_states.py: no tables in {run}/csv: moraine export {run} --csv writes them")
    with open(tables[-1]) as source:
        head = [h.split(" ")[0] for h in source.readline().strip().split(",")]
        at = [head.index(c) for c in ("position.x", "position.y", "position.z", "radius", "velocity.x", "velocity.y", "velocity.z",
                                      "angular_velocity.x", "angular_velocity.y", "angular_velocity.z")]
        rows = [[float(line.split(",")[k]) for k in at] for line in source]
    text = "x,y,z,r,vx,vy,vz,wx,wy,wz\n" + "".join(
        ",".join([f"{v:.7f}".rstrip("0") for v in r[:3]] + [f"{r[3]:g}"] + [f"{v:.2g}" for v in r[4:]]) + "\n" for r in rows)
    with open(os.path.join(here, name + ".csv.gz"), "wb") as out, gzip.GzipFile("", "wb", 9, out, mtime=0) as packed:
        packed.write(text.encode())
    print(f"{name}.csv.gz: {len(rows)} grains from {tables[-1]}")


states = {"bed20k": lambda: bed("bed20k", 1), "bed200k": lambda: bed("bed200k", 10), "gas200k": lambda: gas("gas200k"),
          "drum38k": lambda: drum("drum38k"), "hopper40k": lambda: hopper("hopper40k")}


def main(arguments):
    if arguments[:1] == ["--keep"] and len(arguments) == 3:
        return keep(*arguments[1:])
    if arguments == ["--meshes"]:
        write_stl("drum.stl", drum_mesh())
        return write_stl("hopper.stl", hopper_mesh())
    for name in arguments or states:
        if name not in states:
            sys.exit(f"make_states.py: there is no state {name}; there are {', '.join(states)}")
        states[name]()


if __name__ == "__main__":
    main(sys.argv[1:])
