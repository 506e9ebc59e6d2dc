"""What other programs make of a run: VTK's own readers, a browser, gnuplot, POV-Ray.

usage: pictures_test.py PROJECT PROGRAM

Each reader is the real one, and its tests are skipped where it is not installed: python3-vtk9, paraview, chromium, gnuplot, povray,
python3-h5py.
"""

import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

try:
    import numpy as np
    import h5py
except ImportError:
    h5py = None
try:
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOGeometry import vtkTecplotReader
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLPolyDataReader
    has_vtk = True
except ImportError:
    has_vtk = False
try:
    from matplotlib import image as matplotlib_image
except ImportError:
    matplotlib_image = None

PROJECT, PROGRAM = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
ENVIRONMENT = dict(os.environ, GOMP_SPINCOUNT="1000", OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1")
SCENE = """
title = "grains in a 'box' <of glass> with gas & walls"
[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.2]
[time]
end = 0.1
step = 1e-4
gravity = [0, 0, -9.81]
[[material]]
name = "glass"
density = 2500.0
[contact]
normal = "linear"
tangential = "spring"
[[contact.pair]]
normal_stiffness = 1000.0
restitution = 0.9
friction = 0.4
[[particles]]
diameter = [0.008, 0.012]
fill = { region = { box = { low = [0, 0, 0.02], high = [0.1, 0.1, 0.2] } }, count = 300 }
[[wall]]
name = "box"
box = { low = [0, 0, 0], high = [0.1, 0.1, 0.2] }
[[wall]]
name = "funnel"
cone = { base = [0.05, 0.05, 0.01], radius_base = 0.02, radius_top = 0.05, length = 0.05 }
until = 0.06
[gas]
cells = [5, 4, 10]
density = 1.2
viscosity = 1.8e-5
drag = "gidaspow"
[output]
snapshots = 0.02
fields = ["position", "radius", "velocity", "gid", "material", "inverse_mass"]
[[probe]]
kind = "mass"
interval = 0.005
[[probe]]
kind = "profile"
interval = 0.01
bins = 6
[[probe]]
kind = "wall_force"
wall = "box"
interval = 0.005
"""


def program(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments)], text=True, capture_output=True, env=ENVIRONMENT)
    if done.returncode != 0:
        raise AssertionError(f"moraine {' '.join(map(str, arguments))}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def setUpModule():
    global FOLDER, RUN, SHARED
    FOLDER = Path(tempfile.mkdtemp(prefix="moraine_pictures_"))
    unittest.addModuleCleanup(shutil.rmtree, FOLDER)
    (FOLDER / "scene.toml").write_text(SCENE)
    RUN, SHARED = FOLDER / "run", FOLDER / "distributed"
    program("run", FOLDER / "scene.toml", "--out", RUN, "--layout", "1x2")
    program("run", FOLDER / "scene.toml", "--out", SHARED, "--layout", "2x1", "--set", "output.distributed=true")


def snapshots(run):
    return sorted(path for path in (run / "snapshots").glob("snapshot_*.h5") if re.fullmatch(r"snapshot_\d+\.h5", path.name))


@unittest.skipUnless(has_vtk and h5py, "python3-vtk9 or python3-h5py is not installed")
class Exports(unittest.TestCase):
    def each_frame(self, kind, ending):
        """Of one file a snapshot and of one a rank: number, snapshot, exported grains."""
        for run in RUN, SHARED:
            out = FOLDER / f"{run.name}-{kind}"
            program("export", run, f"--{kind}", "--out", out)
            files = snapshots(run)
            self.assertEqual(len(files), 6)
            self.assertEqual(len(list(out.glob(f"grains_*{ending}"))), 6)
            for file in files:
                step = re.search(r"\d+", file.name).group()
                with h5py.File(file) as snapshot:
                    yield step, snapshot, out

    def test_vtk_reads_grains_and_gas_of_every_snapshot_bit_by_bit(self):
        for step, snapshot, out in self.each_frame("vtk", ".vtp"):
            reader = vtkXMLPolyDataReader()
            reader.SetFileName(str(out / f"grains_{step}.vtp"))
            reader.Update()
            grains = reader.GetOutput()
            np.testing.assert_array_equal(vtk_to_numpy(grains.GetPoints().GetData()), snapshot["particles/position"][:])
            self.assertEqual(grains.GetNumberOfVerts(), 300)
            for name in "radius", "velocity", "gid", "material":
                np.testing.assert_array_equal(vtk_to_numpy(grains.GetPointData().GetArray(name)), snapshot[f"particles/{name}"][:])
            reader = vtkXMLImageDataReader()
            reader.SetFileName(str(out / f"gas_{step}.vti"))
            reader.Update()
            gas = reader.GetOutput()
            self.assertEqual(gas.GetDimensions(), (6, 5, 11))
            np.testing.assert_array_equal(vtk_to_numpy(gas.GetCellData().GetArray("void_fraction")), snapshot["gas/void_fraction"][:].ravel())

    def read_tecplot(self, file):
        reader = vtkTecplotReader()
        reader.SetFileName(str(file))
        reader.Update()
        return reader.GetOutput().GetBlock(0)

    def test_tecplot_s_reader_finds_the_gas_and_the_grains_are_a_zone_of_points(self):
        # VTK's reader has no zones along one line only, as Tecplot wants scattered points
        for step, snapshot, out in self.each_frame("tecplot", ".dat"):
            lines = (out / f"grains_{step}.dat").read_text().splitlines()
            self.assertIn("I=300, J=1, K=1", lines[2])
            names = re.findall(r'"([^"]*)"', lines[1])
            rows = np.loadtxt(lines[3:])
            np.testing.assert_array_equal(rows[:, :3], snapshot["particles/position"][:])
            np.testing.assert_array_equal(rows[:, names.index("radius [m]")], snapshot["particles/radius"][:])
            np.testing.assert_array_equal(rows[:, names.index("velocity_z [m/s]")], snapshot["particles/velocity"][:, 2])
            gas = self.read_tecplot(out / f"gas_{step}.dat")
            self.assertEqual(gas.GetDimensions(), (5, 4, 10))
            void = next(name for name in (gas.GetPointData().GetArrayName(k) for k in range(gas.GetPointData().GetNumberOfArrays()))
                        if name.startswith("void_fraction"))
            np.testing.assert_allclose(vtk_to_numpy(gas.GetPointData().GetArray(void)), snapshot["gas/void_fraction"][:].ravel(), rtol=1e-6)

    def test_a_table_has_the_numbers_of_the_snapshot(self):
        for step, snapshot, out in self.each_frame("csv", ".csv"):
            rows = np.genfromtxt(out / f"grains_{step}.csv", delimiter=",", names=True)
            np.testing.assert_array_equal(rows["gid"], snapshot["particles/gid"][:])
            np.testing.assert_array_equal(rows["positionz_m"], snapshot["particles/position"][:, 2])


@unittest.skipUnless(shutil.which("pvpython") and h5py, "paraview or python3-h5py is not installed")
class ParaView(unittest.TestCase):
    def test_it_opens_runs_and_exports_with_every_grain(self):
        program("export", RUN, "--vtk", "--out", FOLDER / "for-paraview")
        done = subprocess.run(["pvpython", "--force-offscreen-rendering", Path(__file__).parent / "paraview_test.py", RUN, FOLDER / "for-paraview"],
                              capture_output=True, text=True, timeout=300, env=dict(ENVIRONMENT, QT_QPA_PLATFORM="offscreen"))
        found = re.search(r"^RESULT (.*)$", done.stdout, re.MULTILINE)
        self.assertTrue(found, done.stdout + done.stderr)
        for source, frames in json.loads(found.group(1)).items():
            self.assertEqual(len(frames), 6, source)
            for frame, file in zip(frames, snapshots(RUN)):
                with h5py.File(file) as snapshot:
                    self.assertAlmostEqual(frame["time"], snapshot.attrs["time"], places=9)
                    self.assertEqual(frame["grains"], 300)
                    self.assertAlmostEqual(frame["radii"], snapshot["particles/radius"][:].sum(), places=9)
                    self.assertAlmostEqual(frame["heights"], snapshot["particles/position"][:, 2].sum(), places=5)
                    self.assertTrue({"radius", "velocity", "gid"} <= set(frame["fields"]))
                    if source == "xdmf":
                        self.assertEqual(frame["cells"], 200)
                        self.assertAlmostEqual(frame["void"], snapshot["gas/void_fraction"][:].sum(), places=6)


@unittest.skipUnless(shutil.which("gnuplot"), "gnuplot is not installed")
class Plots(unittest.TestCase):
    def test_each_table_and_the_phases_are_drawn(self):
        text = program("plot", RUN)
        for name in ("mass", "mass_kg", "mass_kg_s", "profile_solid_fraction", "profile_velocity_z", "wall_force_N", "phases"):
            self.assertIn(name, text)
            self.assertIn("<svg", (RUN / "plots" / f"{name}.svg").read_text()[:1000])
            self.assertEqual((RUN / "plots" / f"{name}.png").read_bytes()[:4], b"\x89PNG")

    def test_a_directory_without_anything_to_plot_is_named(self):
        (FOLDER / "bare").mkdir()
        done = subprocess.run([PROGRAM, "plot", FOLDER / "bare"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 2)
        self.assertIn("holds nothing to plot", done.stderr)


def page_data(page):
    text = re.search(r'<script id="data" type="application/json">(.*?)</script>', page.read_text(), re.DOTALL).group(1)
    return json.loads(text)


class View(unittest.TestCase):
    def test_the_page_stands_alone_and_holds_the_run(self):
        program("view", RUN)
        page = RUN / "view.html"
        self.assertNotRegex(page.read_text(), r"https?:|src=|@import|url\(")
        data = page_data(page)
        self.assertEqual([frame["n"] for frame in data["frames"]], [300] * 6)
        self.assertEqual(data["label"], "speed [m/s]")
        self.assertEqual([wall["name"] for wall in data["walls"]], ["box", "funnel"])
        self.assertEqual(data["walls"][1]["until"], 0.06)
        self.assertIn("wall_force", [series["name"] for series in data["series"]])
        self.assertIn("&lt;of glass&gt; with gas &amp; walls", page.read_text())

    @unittest.skipUnless(h5py, "python3-h5py is not installed")
    def test_its_grains_are_those_of_the_snapshots_to_sixteen_bits(self):
        import base64
        import zlib
        page = FOLDER / "radius.html"
        program("view", RUN, "--field", "radius", "--out", page)
        data = page_data(page)
        low, size = np.array(data["low"]), np.subtract(data["high"], data["low"])
        for frame, file in zip(data["frames"], snapshots(RUN)):
            words = zlib.decompress(base64.b64decode(frame["data"]))
            shares = np.frombuffer(words[:2 * 4 * 300], dtype="<u2").reshape(4, 300) / 65535
            with h5py.File(file) as snapshot:
                np.testing.assert_allclose(low + size * shares[:3].T, snapshot["particles/position"][:], atol=size.max() / 65535)
                np.testing.assert_allclose(shares[3] * data["radius"], snapshot["particles/radius"][:], atol=data["radius"] / 65535)

    def test_large_runs_are_thinned_evenly_with_the_same_grains_throughout(self):
        page = FOLDER / "thin.html"
        text = program("view", RUN, "--grains", "100", "--frames", "3", "--out", page)
        self.assertIn("of the grains is shown", text)
        data = page_data(page)
        self.assertEqual([frame["time"] for frame in data["frames"]], [0, 0.04, 0.1])
        self.assertEqual(len({frame["n"] for frame in data["frames"]}), 1)
        self.assertAlmostEqual(data["frames"][0]["n"], 100, delta=30)

    @unittest.skipUnless(shutil.which("chromium") and matplotlib_image, "chromium or python3-matplotlib is not installed")
    def test_a_browser_shows_grains_in_colours_and_the_charts(self):
        page = FOLDER / "shown.html"
        program("view", RUN, "--out", page)
        picture = FOLDER / "view.png"
        done = subprocess.run(["chromium", "--headless", "--no-sandbox", "--disable-gpu-sandbox", "--use-angle=swiftshader",
                               "--enable-unsafe-swiftshader", "--hide-scrollbars", "--window-size=1280,800", "--virtual-time-budget=20000",
                               "--enable-logging=stderr", f"--user-data-dir={FOLDER / 'profile'}", f"--screenshot={picture}",
                               f"file://{page}#frame=2"], capture_output=True, text=True, timeout=120)
        self.assertTrue(picture.is_file(), done.stderr)
        self.assertNotRegex(done.stderr, r"CONSOLE.*(Error|error)")
        pixels = matplotlib_image.imread(picture)[:, :, :3]
        colourful = (pixels.max(axis=2) - pixels.min(axis=2)) > 0.25
        self.assertGreater(colourful[100:, 100:850].mean(), 0.03)  # the grains
        self.assertGreater(colourful[40:, 900:].mean(), 0.002)  # lines of the charts


@unittest.skipUnless(shutil.which("povray") and matplotlib_image, "povray or python3-matplotlib is not installed")
class Render(unittest.TestCase):
    def test_povray_draws_grains_in_colours(self):
        picture = FOLDER / "picture.png"
        program("render", RUN, "--size", "320x240", "--out", picture)
        pixels = matplotlib_image.imread(picture)[:, :, :3]
        self.assertEqual(pixels.shape, (240, 320, 3))
        self.assertGreater(((pixels.max(axis=2) - pixels.min(axis=2)) > 0.25).mean(), 0.03)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
