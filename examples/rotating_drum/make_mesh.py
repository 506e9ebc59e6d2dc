#!/usr/bin/env python3
"""Writes the drum's mesh as binary STL: a cylinder along y with lifters, and its two end walls.

    python3 make_mesh.py            # drum.stl

Radius 50 mm, from y = 0 to y = 24 mm, axis through the origin; 60 facets around, so that neighbours meet at 6 degrees and the
shell counts as smooth. Six lifters, 5 mm high.
"""

import math
import struct
from pathlib import Path

RADIUS, LENGTH, LIFTER = 0.05, 0.024, 0.005    # [m]
N_AROUND, N_ALONG, N_LIFTERS = 60, 4, 6


def at(radius, i, y):
    angle = 2.0 * math.pi * i / N_AROUND
    return (radius * math.cos(angle), y, radius * math.sin(angle))


def quad(a, b, c, d):
    yield a, b, c
    yield a, c, d


def drum():
    ys = [LENGTH * j / N_ALONG for j in range(N_ALONG + 1)]
    for i in range(N_AROUND):
        for low, high in zip(ys, ys[1:]):
            yield from quad(at(RADIUS, i, low), at(RADIUS, i + 1, low), at(RADIUS, i + 1, high), at(RADIUS, i, high))
        for y in (0.0, LENGTH):
            yield (0.0, y, 0.0), at(RADIUS, i, y), at(RADIUS, i + 1, y)
    for k in range(N_LIFTERS):
        i = k * N_AROUND // N_LIFTERS
        yield from quad(at(RADIUS, i, 0.0), at(RADIUS - LIFTER, i, 0.0), at(RADIUS - LIFTER, i, LENGTH), at(RADIUS, i, LENGTH))


def normal(a, b, c):
    u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)]
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    length = sum(x * x for x in n) ** 0.5
    return [x / length for x in n]


def write_stl(path, triangles):
    records = [struct.pack("<12fH", *normal(*t), *t[0], *t[1], *t[2], 0) for t in triangles]
    path.write_bytes(b"Moraine example: drum with lifters, metres".ljust(80) + struct.pack("<I", len(records)) + b"".join(records))
    print(f"{path}: {len(records)} triangles")


if __name__ == "__main__":
    write_stl(Path(__file__).resolve().parent / "drum.stl", list(drum()))
