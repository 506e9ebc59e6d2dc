#!/usr/bin/env python3
"""Angle of repose of the heap on the table, for several cohesions and rolling frictions.

    python3 angles.py [--program ../../moraine] [--out runs/wet_pile] [-- ARGUMENT...]

Runs the scene once for each case and measures the last snapshot: the heap is cut into twelve slices like a cake, the height of the highest
grain in each of six rings is taken, and a line is fitted through all of them between 0.3 and 0.9 of the table's radius. Needs h5py and
numpy.
"""

import argparse
import math
import subprocess
from pathlib import Path

import h5py
import numpy

HERE = Path(__file__).resolve().parent
TABLE = 0.035  # [m] radius
CASES = [  # name, settings
    ("dry, free rolling", {"contact.cohesion": "none", "contact.rolling": "none"}),
    ("dry, mu_r 0.1", {"contact.cohesion": "none"}),
    ("dry, mu_r 0.3", {"contact.cohesion": "none", "contact.pair[0].rolling_friction": 0.3}),
    ("wet, free rolling", {"contact.rolling": "none"}),
    ("wet, mu_r 0.1", {}),
    ("four times the tension, mu_r 0.1", {"contact.pair[0].surface_tension": 0.288}),
]


def angle_of(snapshot):
    """[degrees], and its standard error over the slices."""
    with h5py.File(snapshot) as file:
        position, radius = file["/particles/position"][:], file["/particles/radius"][:]
    stays = position[:, 2] > 0
    position, radius = position[stays], radius[stays]
    distance = numpy.hypot(position[:, 0], position[:, 1])
    top = position[:, 2] + radius
    slice_of = ((numpy.arctan2(position[:, 1], position[:, 0]) / (2 * math.pi) + 0.5) * 12).astype(int) % 12
    angles = []
    for k in range(12):
        points = []
        for ring in range(6):
            low, high = TABLE * (0.3 + 0.1 * ring), TABLE * (0.4 + 0.1 * ring)
            inside = (slice_of == k) & (distance >= low) & (distance < high)
            if inside.any():
                highest = numpy.argmax(numpy.where(inside, top, -1))
                points.append((distance[highest], top[highest]))
        if len(points) >= 4:
            x, y = numpy.array(points).T
            angles.append(math.degrees(math.atan(-numpy.polyfit(x, y, 1)[0])))
    return numpy.mean(angles), numpy.std(angles) / math.sqrt(len(angles)), len(position)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--program", default=str(HERE.parents[1] / "moraine"))
    parser.add_argument("--out", type=Path, default=Path("runs/wet_pile"))
    parser.add_argument("extra", nargs="*", help="further arguments of the runs, after --")
    arguments = parser.parse_args()
    print(f"{'':34} angle [degrees]   grains on the table")
    for number, (name, settings) in enumerate(CASES):
        out = arguments.out / str(number)
        if not (out / "summary.txt").exists():
            words = [word for key, value in settings.items() for word in ("--set", f"{key}={value}")]
            subprocess.run([arguments.program, "run", HERE / "scene.toml", "--out", out, *words, *arguments.extra], check=True,
                           stdout=subprocess.DEVNULL)
        angle, error, n = angle_of(sorted((out / "snapshots").glob("*.h5"))[-1])
        print(f"{name:34} {angle:6.1f} +- {error:.1f}      {n}")


if __name__ == "__main__":
    main()
