"""Mean pressure drop, symmetry of the mean profiles and spectrum of a run of jet_bed.

usage: analyse.py RUN [FROM]        FROM: what comes before is left out [s]; 1 unless given
"""

import csv
import sys
from pathlib import Path

import numpy as np


def table(path):
    """Columns by name; the first is the time."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    values = np.array([[float(x) for x in row] for row in rows[1:]])
    return dict(zip(rows[0], values.T))


def spectrum(time, pressure):
    """Power by frequency, mean of overlapping Hann windows (Welch 1967)."""
    n = min(256, len(pressure))
    window, step = np.hanning(n), max(1, n // 2)
    pieces = [pressure[i:i + n] for i in range(0, len(pressure) - n + 1, step)]
    power = np.mean([np.abs(np.fft.rfft(window * (piece - piece.mean()))) ** 2 for piece in pieces], axis=0)
    return np.fft.rfftfreq(n, time[1] - time[0]), power


def main(run, begin):
    drop = table(run / "pressure_drop.csv")
    time = drop["time [s]"]
    late = drop["pressure drop [Pa]"][time >= begin]
    low, high = np.percentile(late, [5, 95])
    print(f"pressure drop from {begin:g} s on: mean {late.mean():.0f} Pa, 90 % of it within {low:.0f} to {high:.0f} Pa "
          f"(expected: 2200 to 3200 Pa)")

    across = table(run / "across.csv")
    for what in ("void fraction", "solids velocity y", "gas velocity y"):
        values = np.array([column[-1] for name, column in across.items() if name.startswith(what + " at")])
        off = 0.5 * (values - values[::-1])
        print(f"{what:18} across the bed: {values.min():.3f} to {values.max():.3f}, "
              f"asymmetry (RMS) {np.sqrt(np.mean(off ** 2)):.3f}")

    series = table(run / "pressure_spectrum.csv")
    time = series["time [s]"]
    late = time >= begin
    for name, values in series.items():
        if name.startswith("time"):
            continue
        frequency, power = spectrum(time[late], values[late])
        best = 1 + np.argmax(power[1:])
        print(f"{name}: strongest at {frequency[best]:.2f} Hz")


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 1.0)
