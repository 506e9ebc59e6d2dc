"""Void fraction across the bed against the experiment, pressure drop and its spectrum.

usage: compare.py RUN [FROM]        FROM: what comes before is left out of the pressures [s]; 2 unless given
"""

import csv
import re
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


def profile(path, what):
    """Places [m] and the averages of the last row."""
    found = [(float(re.search(r" at x (\S+) m", name).group(1)), column[-1])
             for name, column in table(path).items() if name.startswith(what + " at ")]
    return np.array(found).T


def main(run, begin):
    for height, known in (("16.4", 0.03), ("31.2", 0.06)):
        measured = table(Path(__file__).parent / f"experiment_y{height}mm.csv")
        x, value = measured["x [m]"], measured["void fraction"]
        places, void = profile(run / f"across_{height}mm.csv", "void fraction")
        difference = np.interp(x, places, void) - value
        print(f"void fraction at {height} mm: mean {np.interp(x, places, void).mean():.3f} (experiment {value.mean():.3f}), "
              f"RMS difference {np.sqrt(np.mean(difference ** 2)):.3f} (at most {known})")

    drop = table(run / "pressure_drop.csv")
    late = drop["pressure drop [Pa]"][drop["time [s]"] >= begin]
    print(f"pressure drop: mean {late.mean():.1f} Pa, standard deviation {late.std():.1f} Pa (bed weight 186.4 Pa)")
    height = table(run / "bed_height.csv")
    late = height["height of 95 % [m]"][height["time [s]"] >= begin]
    print(f"95 % of the grains below: mean {1e3 * late.mean():.1f} mm")
    series = table(run / "pressure_spectrum.csv")
    late = series["time [s]"] >= begin
    for name, values in series.items():
        if name.startswith("time"):
            continue
        frequency, power = spectrum(series["time [s]"][late], values[late])
        print(f"{name}: strongest at {frequency[1 + np.argmax(power[1:])]:.2f} Hz")


if __name__ == "__main__":
    main(Path(sys.argv[1]), float(sys.argv[2]) if len(sys.argv) > 2 else 2.0)
