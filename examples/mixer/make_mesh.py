#!/usr/bin/env python3
"""Writes the mixer's blades as binary STL: two flat blades on a shaft along z, pitched by 45 degrees against its turn.

    python3 make_mesh.py            # blades.stl
"""

import math
import struct
from pathlib import Path

INNER, OUTER, HEIGHT, LOW = 0.004, 0.028, 0.012, 0.002    # [m]
PITCH = math.radians(45.0)
N_ALONG = 6


def blade(turn):
    def place(radius, up):
        along, across = radius, (up - 0.5) * HEIGHT / math.tan(PITCH)
        c, s = math.cos(turn), math.sin(turn)
        return (c * along - s * across, s * along + c * across, LOW + up * HEIGHT)

    for k in range(N_ALONG):
        near, far = (INNER + (OUTER - INNER) * (k + i) / N_ALONG for i in (0, 1))
        a, b, c, d = place(near, 0.0), place(far, 0.0), place(far, 1.0), place(near, 1.0)
        yield a, b, c
        yield a, c, d


def normal(a, b, c):
    u, v = [q - p for p, q in zip(a, b)], [q - p for p, q in zip(a, c)]
    n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    length = sum(x * x for x in n) ** 0.5
    return [x / length for x in n]


def write_stl(path, triangles):
    records = [struct.pack("<12fH", *normal(*t), *t[0], *t[1], *t[2], 0) for t in triangles]
    path.write_bytes(b"Moraine example: blades of a mixer, metres".ljust(80) + struct.pack("<I", len(records)) + b"".join(records))
    print(f"{path}: {len(records)} triangles")


if __name__ == "__main__":
    write_stl(Path(__file__).resolve().parent / "blades.stl", [t for k in range(2) for t in blade(math.pi * k)])
