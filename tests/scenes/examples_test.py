"""A shipped example, made small by --set, through the real program.

usage: examples_test.py PROJECT PROGRAM NAME of an example

What is looked at is what a user looks at: the files of the run directory. Needs the standard library only; snapshots are opened where
h5py is installed.
"""

import csv
import filecmp
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree as ElementTree
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import state_hash  # noqa: E402
from small_examples import SMALL  # noqa: E402

try:
    import h5py
except ImportError:
    h5py = None

PROJECT, PROGRAM, NAME = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve(), sys.argv[3]
FOLDER = PROJECT / "examples" / NAME


def program(*arguments):
    # Threads that spin while they wait for each other stand still on a busy machine.
    environment = dict(os.environ, GOMP_SPINCOUNT="1000")
    done = subprocess.run([PROGRAM, *map(str, arguments)], text=True, capture_output=True, env=environment)
    if done.returncode != 0:
        raise AssertionError(f"moraine {' '.join(map(str, arguments))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def run(directory, layout, *more):
    settings, _, _ = SMALL[NAME]
    return program("run", FOLDER / "scene.toml", "--out", directory, "--layout", layout,
                   *(word for setting in settings for word in ("--set", setting)), *more)


def table(path):
    with open(path, newline="") as file:
        return [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]


class Example(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = Path(tempfile.mkdtemp(prefix=f"moraine_{NAME}_"))
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.whole = cls.folder / "whole"
        cls.output = run(cls.whole, "1x2")

    def test_the_shipped_scene_is_accepted_as_it_is(self):
        for scene in FOLDER.glob("*.toml"):
            self.assertRegex(program("check", scene), r"grains +\d")

    def test_a_stopped_run_that_goes_on_with_other_threads_ends_with_the_same_hash(self):
        broken, stop = self.folder / "broken", SMALL[NAME][1]
        run(broken, "1x1", "--until", stop)
        output = run(broken, "1x3", "--restart", "auto")
        self.assertEqual(state_hash(output), state_hash(self.output))
        for path in sorted([*self.whole.glob("*.csv"), *self.whole.glob("*.xdmf"), *self.whole.glob("fields/*")]):
            if path.name == "balance.csv":  # how long things took is another each time
                continue
            self.assertTrue(filecmp.cmp(path, broken / path.relative_to(self.whole), shallow=False), f"{path.name} differs after the restart")

    def test_the_series_names_snapshots_that_are_there_with_the_sizes_it_says(self):
        series = ElementTree.parse(self.whole / "snapshots.xdmf")
        # with gas and maps of forces each moment holds several grids
        grids = [grid for grid in series.findall(".//Grid[@GridType='Uniform']") if grid.find("Topology").get("TopologyType") == "Polyvertex"]
        self.assertEqual(len(grids), len(list((self.whole / "snapshots").glob("*.h5"))))
        self.assertGreaterEqual(len(grids), 3)
        times = [float(time.get("Value")) for time in series.iter("Time")]
        self.assertEqual(times, sorted(set(times)))
        for grid in grids:
            n = int(grid.find("Topology").get("NumberOfElements"))
            for item in grid.iter("DataItem"):
                file, dataset = item.text.strip().split(":")
                shape = tuple(map(int, item.get("Dimensions").split()))
                self.assertEqual(shape[0], n)
                self.assertTrue((self.whole / file).is_file(), file)
                if h5py:
                    with h5py.File(self.whole / file) as snapshot:
                        self.assertEqual(snapshot[dataset].shape, shape)

    @unittest.skipUnless(h5py, "h5py is not installed")
    def test_every_series_shows_data_that_are_there(self):
        for path in self.whole.glob("*.xdmf"):
            for item in ElementTree.parse(path).iter("DataItem"):
                if item.get("Format") == "XML":
                    continue
                file, dataset = item.text.strip().split(":")
                with h5py.File(self.whole / file) as data:
                    self.assertEqual(data[dataset].shape, tuple(map(int, item.get("Dimensions").split())), dataset)

    def test_fields_hold_all_of_the_grains(self):
        if NAME != "rotating_drum":
            self.skipTest("this example has no fields")
        for row in table(self.whole / "flow.csv"):
            self.assertAlmostEqual(row["mass on the grid [kg]"], row["mass inside [kg]"], delta=1e-13 * row["mass inside [kg]"])
        tables = sorted((self.whole / "fields").glob("flow_*.csv"))
        self.assertEqual(len(tables), 3)  # two of 0.03 s, and what is left at the end
        volume = (0.102 / 26) ** 2 * 0.026
        for path in tables:
            mass = volume * sum(row["density [kg/m3]"] for row in table(path))
            self.assertAlmostEqual(mass, row["mass inside [kg]"], delta=1e-12 * mass)

    @unittest.skipUnless(h5py, "h5py is not installed")
    def test_the_last_snapshot_holds_every_grain_inside_once(self):
        last = sorted((self.whole / "snapshots").glob("*.h5"))[-1]
        inside = int(re.search(r"(\d+) inside", self.output).group(1))
        with h5py.File(last) as snapshot:
            gids, position = snapshot["/particles/gid"][:], snapshot["/particles/position"][:]
            self.assertEqual(snapshot.attrs["state_hash"], state_hash(self.output))
            self.assertEqual(len(gids), inside)
            self.assertEqual(len(set(gids.tolist())), inside)
            self.assertTrue((position >= snapshot.attrs["domain_low"]).all())
            self.assertTrue((position <= snapshot.attrs["domain_high"]).all())

    def test_grains_and_mass_are_neither_lost_nor_made(self):
        born, inside, left = map(int, re.search(r"(\d+) born, (\d+) inside, (\d+) left", self.output).groups())
        self.assertGreater(born, 1000)
        self.assertEqual(born, inside + left)
        self.assertEqual(left > 0, SMALL[NAME][2])
        if SMALL[NAME][2]:
            rows = table(self.whole / "mass.csv")
            for row in rows:
                self.assertEqual(row["born"], row["inside"] + row["left"])
                self.assertAlmostEqual(row["mass born [kg]"], row["mass inside [kg]"] + row["mass left [kg]"], delta=1e-12)
            self.assertEqual([row["left"] for row in rows], sorted(row["left"] for row in rows))

    def test_the_energy_ledger_closes(self):
        if not (self.whole / "energy.csv").exists():
            self.skipTest("this example keeps no ledger")
        first, *_, last = table(self.whole / "energy.csv")
        moved = first["potential [J]"] - last["potential [J]"]
        self.assertLess(abs(last["error [J]"]), 0.02 * abs(moved))

    def test_gas_and_grains_exchange_the_same_and_the_bed_weighs_on_the_gas(self):
        gas = re.search(r"mass imbalance at most (\S+) of .* equal to (\S+)$", self.output, re.MULTILINE)
        if not gas:
            self.skipTest("this example has no gas")
        self.assertLessEqual(float(gas.group(1)), 1.01e-6)
        self.assertLess(float(gas.group(2)), 1e-10)
        drop = [row["pressure drop [Pa]"] for row in table(self.whole / "pressure_drop.csv")]
        self.assertGreater(drop[-1], 10.0)

    def test_scripts_beside_the_scene_make_the_meshes_that_are_shipped(self):
        script = FOLDER / "make_mesh.py"
        if not script.exists():
            self.skipTest("this example has no meshes")
        copy = shutil.copy(script, self.folder)
        subprocess.run([sys.executable, copy], check=True, stdout=subprocess.DEVNULL)
        meshes = sorted(FOLDER.glob("*.stl"))
        self.assertTrue(meshes)
        for mesh in meshes:
            self.assertTrue(filecmp.cmp(mesh, self.folder / mesh.name, shallow=False), mesh.name)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
