"""The same box of grains in each code: runs the scripts of this folder whose program is installed, and compares what comes out.

    python3 examples/coming_from/compare.py DIR       (from the project's root; each code gets a folder of DIR, one that has results is not run again)

Prints the mean height of the centres over time, and at the end the height below which 95 % of them lie and the contacts of a grain.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np

HERE, RADIUS, END = Path(__file__).resolve().parent, 0.002, 30000
MORAINE = [str(HERE.parents[1] / "moraine"), "run", str(HERE / "scene.toml"), "--out", "run"]
MPI = ["mpirun", "--allow-run-as-root", "--oversubscribe", "--mca", "mpi_yield_when_idle", "1", "-np", "2"]
VISCOUS = [word for setting in ("contact.pair[0].restitution=1", "time.damping=20", "wall[0].frictionless=true") for word in ("--set", setting)]
# name: command, files of its results by number (0 to 6: every 0.05 s), reader of positions [m]
CODES = {
    "Moraine": (MORAINE, lambda k: sorted(Path("run/snapshots").glob("*.h5"))[k], lambda file: h5py.File(file)["particles/position"][:]),
    "LIGGGHTS": (["liggghts", "-in", str(HERE / "liggghts_box.in")], lambda k: f"grains_{5000 * k}.dump",
                 lambda file: np.loadtxt(file, skiprows=9)[:, 1:4]),
    "Yade": (["yade", "-n", "-x", "-j1", str(HERE / "yade_box.py")], lambda k: f"grains_{5000 * k}.txt", lambda file: np.loadtxt(file)[:, :3]),
    "Moraine, viscous": (MORAINE + VISCOUS, lambda k: sorted(Path("run/snapshots").glob("*.h5"))[k],
                         lambda file: h5py.File(file)["particles/position"][:]),
    "ESyS-Particle": (MPI + ["esysparticle", str(HERE / "esys_box.py")], lambda k: f"grains_t={5000 * k}_1.txt",
                      lambda file: np.loadtxt(file, skiprows=1, max_rows=1865)[:, :3]),
}


def contacts(places):
    """Mean number of contacts with other grains."""
    gap = np.linalg.norm(places[:, None] - places[None], axis=2)
    return (np.count_nonzero(gap < 2 * RADIUS) - len(places)) / len(places)


folder = Path(sys.argv[1]).resolve()
print(f"{'':18}" + "".join(f"{0.05 * k:8.2f} s" for k in range(1, 7)) + "      95 %  contacts")
for name, (command, file, read) in CODES.items():
    if not shutil.which(command[0]):
        print(f"{name:18} is not installed")
        continue
    out = folder / name.replace(", ", "-")
    if not out.exists():
        out.mkdir(parents=True)
        with open(out / "log.txt", "w", encoding="utf-8") as log:
            subprocess.run(command, cwd=out, stdout=log, stderr=log, check=True)
    os.chdir(out)
    frames = [read(file(k)) for k in range(1, 7)]
    heights = "".join(f"{1000 * places[:, 2].mean():10.2f}" for places in frames)
    print(f"{name:18}{heights}{1000 * np.percentile(frames[-1][:, 2], 95):10.2f}{contacts(frames[-1]):10.2f}")
