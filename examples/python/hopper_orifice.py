"""How fast a hopper runs out, against the width of its orifice: a parameter study from Python.

    ./moraine python examples/python/hopper_orifice.py [WIDTH IN MM ...]

For each width: fill, let settle behind a gate, open, count what leaves. The points should lie on Beverloo's law, W = C (D - k d)^5/2
with k near 1.4; the curve is fitted to them. Writes hopper_orifice.png.
"""

import sys

import moraine
import numpy as np

GRAIN, DENSITY = 0.004, 2500.0  # [m] mean diameter, [kg/m3]
OPENING, END = 0.12, 0.35       # [s] the gate goes, the run ends
RADIUS, SLOPE, HEIGHT = 0.03, 0.05, 0.12  # [m] of the bin, of the hopper below it, of both


def scene(width):
    slope = {"base": [0, 0, 0], "radius_base": width / 2, "radius_top": RADIUS, "length": SLOPE}
    cylinder = {"base": [0, 0, SLOPE], "radius": RADIUS, "length": HEIGHT - SLOPE}
    return moraine.Scene(
        domain={"low": [-RADIUS, -RADIUS, -0.02], "high": [RADIUS, RADIUS, HEIGHT]},
        time={"end": END, "gravity": [0, 0, -9.81]},
        material=[{"name": "glass", "density": DENSITY}],
        contact={"normal": "linear", "tangential": "spring",
                 "pair": [{"between": ["glass", "glass"], "normal_stiffness": 500.0, "restitution": 0.8, "friction": 0.4}]},
        particles=[{"material": "glass", "diameter": [0.9 * GRAIN, 1.1 * GRAIN],
                    "fill": {"region": {"cylinder": cylinder}, "solid_fraction": 0.5}}],
        wall=[{"name": "hopper", "material": "glass", "cone": slope},
              {"name": "bin", "material": "glass", "cylinder": cylinder},
              {"name": "gate", "material": "glass", "until": OPENING, "disc": {"centre": [0, 0, 0], "radius": width / 2}}],
        outlet=[{"name": "below", "face": "z-low"}],
        probe=[{"kind": "mass", "interval": 0.01}])


def discharge_rate(width):
    """[kg/s], from the middle half of what leaves: neither the start nor the end."""
    run, rows = moraine.Simulation(scene(width)), []
    run.every(200, lambda r: rows.append((r.time, r.probe("mass")["mass left [kg]"])))
    run.run()
    time, mass = np.array(rows).T
    steady = (mass > 0.25 * mass[-1]) & (mass < 0.75 * mass[-1])
    return np.polyfit(time[steady], mass[steady], 1)[0]


widths = np.array([float(word) for word in sys.argv[1:]] or [16, 20, 24, 28]) * 1e-3
rates = np.array([discharge_rate(width) for width in widths])
law = (widths - 1.4 * GRAIN) ** 2.5
constant = (rates @ law) / (law @ law)
if moraine.rank() == 0:
    for width, rate in zip(widths, rates):
        print(f"{1000 * width:5.1f} mm  {1000 * rate:7.2f} g/s")
    from matplotlib import pyplot
    fine = np.linspace(1.4 * GRAIN, 1.1 * widths.max())
    pyplot.plot(1000 * widths, 1000 * rates, "o", label="runs")
    pyplot.plot(1000 * fine, 1000 * constant * (fine - 1.4 * GRAIN) ** 2.5, label="Beverloo, fitted")
    pyplot.xlabel("width of the orifice [mm]"), pyplot.ylabel("discharge [g/s]"), pyplot.legend()
    pyplot.savefig("hopper_orifice.png", dpi=120)
