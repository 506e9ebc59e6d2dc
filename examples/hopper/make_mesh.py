#!/usr/bin/env python3
"""Writes the hopper's mesh: four slopes from a square of side 20 m down to a square outlet of side 14 m, as binary STL.

    python3 make_mesh.py            # hopper.stl, the whole hopper, and hopper_quarter.stl, the part with x > 0 and y > 0

The slopes begin at z = 7 m and end at z = 1 m (63 degrees). They are cut into more triangles than planes need, because
that is what meshes look like that come from a CAD program; grains feel the smooth surface all the same.
"""

import struct
from pathlib import Path

HALF_TOP, HALF_OUTLET = 10.0, 7.0 # [m] from the axis to the middle of a side
Z_TOP, Z_OUTLET = 7.0, 1.0          # [m]
N_DOWN, N_ACROSS = 4, 8           # cells of one slope (of half a slope in the quarter)


def slope(turn, across_low):
    """Triangles of one slope, the one towards +x turned by `turn` quarters; across_low: -1 (all of it) or 0 (y > 0 only)."""
    n_across = N_ACROSS if across_low < 0 else N_ACROSS // 2

    def corner(i, j):
        share = i / N_DOWN
        half = HALF_TOP + share * (HALF_OUTLET - HALF_TOP)
        x, y = half, half * (across_low + (1 - across_low) * j / n_across)
        for _ in range(turn):
            x, y = -y, x
        return (x, y, Z_TOP + share * (Z_OUTLET - Z_TOP))

    for i in range(N_DOWN):
        for j in range(n_across):
            a, b, c, d = corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)
            yield a, c, b
            yield a, d, c


def mirrored(triangles):
    """Mirrored at the plane x = y, so that the slope towards +x with y > 0 becomes that towards +y with x > 0."""
    for a, b, c in triangles:
        yield tuple((p[1], p[0], p[2]) for p in (a, c, b))


def normal(a, b, c):
    u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)]
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    length = sum(x * x for x in n) ** 0.5
    return [x / length for x in n]


def write_stl(path, triangles):
    records = [struct.pack("<12fH", *normal(*t), *t[0], *t[1], *t[2], 0) for t in triangles]
    path.write_bytes(b"Moraine example: square hopper, metres".ljust(80) + struct.pack("<I", len(records)) + b"".join(records))
    print(f"{path}: {len(records)} triangles")


if __name__ == "__main__":
    folder = Path(__file__).resolve().parent
    write_stl(folder / "hopper.stl", [t for turn in range(4) for t in slope(turn, -1)])
    half_slope = list(slope(0, 0))
    write_stl(folder / "hopper_quarter.stl", half_slope + list(mirrored(half_slope)))
