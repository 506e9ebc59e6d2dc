"""What other programs make of a run: VTK's own readers, a browser, gnuplot, POV-Ray.

usage: pictures_test.py PROJECT PROGRAM

Each reader is the real one, and its tests are skipped where it is not installed: python3-paraview (VTK is part of it), chromium, gnuplot, povray, ffmpeg,
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
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader, vtkXMLPolyDataReader, vtkXMLPPolyDataReader
    has_vtk = True
except ImportError:
    has_vtk = False
try:
    from matplotlib import image as matplotlib_image
except ImportError:
    matplotlib_image = None

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from small_examples import SMALL  # noqa: E402

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


@unittest.skipUnless(has_vtk and h5py, "python3-paraview (or python3-vtk9) or python3-h5py is not installed")
class Exports(unittest.TestCase):
    def each_frame(self, kind, ending):
        """Of one file a snapshot and of one a rank: number, snapshot, exported grains."""
        for run in RUN, SHARED:
            out = FOLDER / f"{run.name}-{kind}"
            program("export", run, f"--{kind}", "--out", out)
            files = snapshots(run)
            self.assertEqual(len(files), 6)
            self.assertEqual(len(list(out.glob(f"grains_????????????{ending}"))), 6)
            for file in files:
                step = re.search(r"\d+", file.name).group()
                with h5py.File(file) as snapshot:
                    yield step, snapshot, out

    def test_vtk_reads_grains_and_gas_of_every_snapshot_bit_by_bit(self):
        for step, snapshot, out in self.each_frame("vtk", ".*vtp"):
            whole = out / f"grains_{step}.vtp"
            is_whole = whole.is_file()
            self.assertEqual(is_whole, out.name == "run-vtk")
            reader = vtkXMLPolyDataReader() if is_whole else vtkXMLPPolyDataReader()
            reader.SetFileName(str(whole if is_whole else whole.with_suffix(".pvtp")))
            reader.Update()
            grains = reader.GetOutput()
            if not is_whole:  # what each rank has written, in order of gid
                pieces = [vtkXMLPolyDataReader() for _ in range(2)]
                for number, piece in enumerate(pieces):
                    piece.SetFileName(str(out / f"grains_{step}_{number}.vtp"))
                    piece.Update()
                counts = [h5py.File(file)["particles/gid"].size for file in sorted((SHARED / "snapshots").glob(f"snapshot_{step}.rank-*.h5"))]
                self.assertEqual([piece.GetOutput().GetNumberOfPoints() for piece in pieces], counts)
                self.assertTrue(all(counts))
                self.assertEqual((out / "grains.pvd").read_text().count(".pvtp"), 6)
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

    def test_tecplot_s_reader_finds_grains_and_gas(self):
        for step, snapshot, out in self.each_frame("tecplot", ".dat"):
            rows = np.loadtxt((out / f"grains_{step}.dat").read_text().splitlines()[3:303])
            np.testing.assert_array_equal(rows[:, :3], snapshot["particles/position"][:])
            grains = self.read_tecplot(out / f"grains_{step}.dat")
            self.assertEqual([grains.GetNumberOfPoints(), grains.GetNumberOfCells()], [300, 300])
            np.testing.assert_allclose(vtk_to_numpy(grains.GetPoints().GetData()), snapshot["particles/position"][:], rtol=1e-6)
            data = {grains.GetPointData().GetArrayName(k): vtk_to_numpy(grains.GetPointData().GetArray(k))
                    for k in range(grains.GetPointData().GetNumberOfArrays())}
            for name, column in ("radius [m]", "radius"), ("gid", "gid"), ("material", "material"):
                np.testing.assert_allclose(data[name], snapshot[f"particles/{column}"][:], rtol=1e-6)
            for k, axis in enumerate("xyz"):
                np.testing.assert_allclose(data[f"velocity_{axis} [m_s]"], snapshot["particles/velocity"][:, k], rtol=1e-6)
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


def sums(group):
    """The sum of each dataset of an open file's group, and its components."""
    return {name: [1 if values.ndim != 2 else values.shape[1], float(values[:].astype(float).sum())] for name, values in group.items()}


@unittest.skipUnless(shutil.which("pvpython") and h5py, "paraview (python3-paraview) or python3-h5py is not installed")
class ParaView(unittest.TestCase):
    """It opens every example, and every export, and finds in each moment what the snapshot holds."""

    @classmethod
    def setUpClass(cls):
        cls.runs = {"of one rank": RUN, "of two, in files of their own": SHARED}
        files = []
        for name, (settings, _, _) in SMALL.items():
            run = cls.runs[name] = FOLDER / f"example-{name}"
            interval = next(setting.split("=")[1] for setting in settings if setting.startswith("output.snapshots="))
            program("run", PROJECT / "examples" / name / "scene.toml", "--out", run, "--layout", "1x2",
                    *(word for setting in [*settings, f"time.end={interval}"] for word in ("--set", setting)))
        for name, run in cls.runs.items():
            program("export", run, "--vtk")
            files += [*run.glob("*.xdmf"), *(run / "vtk").glob("*.pvd")]
        done = subprocess.run(["pvpython", "--force-offscreen-rendering", Path(__file__).parent / "paraview_test.py", *files],
                              capture_output=True, text=True, timeout=300, env=dict(ENVIRONMENT, QT_QPA_PLATFORM="offscreen"))
        found = re.search(r"^RESULT (.*)$", done.stdout, re.MULTILINE)
        if not found:
            raise AssertionError(done.stdout + done.stderr)
        cls.found = {Path(file): moments for file, moments in json.loads(found.group(1)).items()}

    def check_arrays(self, found, expected, n_expected=None):
        self.assertEqual(set(found), set(expected))
        for name, (components, total) in expected.items():
            self.assertEqual(found[name][0], components, name)
            size = max(abs(total), 1e-300)
            self.assertLess(abs(found[name][1] - total), 1e-9 * size + 1e-9 * (n_expected or 0), name)

    def check_grains(self, data, snapshot):
        grains = sums(snapshot["particles"])
        self.assertEqual(data["points"], snapshot.attrs["grains"])
        self.assertAlmostEqual(data["heights"], snapshot["particles/position"][:, 2].sum(), delta=1e-6 * max(1, data["points"]))
        self.check_arrays({name: value for name, value in data["of points"].items() if name != "position"},
                          {name: value for name, value in grains.items() if name != "position"}, data["points"])

    def check_gas(self, data, snapshot):
        shown = {name: values for name, values in snapshot["gas"].items() if values.size == np.prod(snapshot["gas"].attrs["cells"])}
        self.assertEqual(data["cells"], np.prod(snapshot["gas"].attrs["cells"]))
        expected = sums(shown)
        found = {}
        for name, (components, total) in data["of cells"].items():
            found[name] = [components, total]
        for stem in {name[:-2] for name in expected if name.endswith("_x") and name not in found}:
            expected[stem] = [3, sum(expected.pop(f"{stem}_{axis}")[1] for axis in "xyz")]
        self.check_arrays(found, expected, data["cells"])

    def test_every_series_of_every_run_has_each_grain_radius_and_field_and_the_gas(self):
        n_moments = n_gas = 0
        for name, run in self.runs.items():
            files = snapshots(run)
            self.assertGreaterEqual(len(files), 2)
            for source in run / "snapshots.xdmf", run / "vtk" / "grains.pvd", run / "vtk" / "gas.pvd":
                if source not in self.found:
                    self.assertEqual(source.name, "gas.pvd")
                    continue
                self.assertEqual(len(self.found[source]), len(files), source)
                for moment, file in zip(self.found[source], files):
                    with self.subTest(run=name, source=source.name, file=file.name), h5py.File(file) as snapshot:
                        self.assertAlmostEqual(moment["time"], snapshot.attrs["time"], places=9)
                        grains = [data for data in moment["sets"] if "radius" in data["of points"]]
                        gas = [data for data in moment["sets"] if "void_fraction" in data["of cells"]]
                        self.assertEqual(len(grains), 0 if source.name == "gas.pvd" else 1)
                        self.assertEqual(len(gas), 1 if "gas" in snapshot and source.name != "grains.pvd" else 0)
                        for data in grains:
                            self.check_grains(data, snapshot)
                        for data in gas:
                            self.check_gas(data, snapshot)
                        n_moments += len(grains)
                        n_gas += len(gas)
        self.assertGreaterEqual(n_moments, 2 * 2 * len(self.runs))
        self.assertGreaterEqual(n_gas, 2 * 2 * 5)

    def test_coarse_grained_fields_are_those_of_their_files(self):
        n_files = 0
        for run in self.runs.values():
            files = sorted((run / "fields").glob("*.h5"))
            for source in (path for path in self.found if path.parent in (run, run / "vtk") and re.fullmatch(r"flow.xdmf|fields_flow.pvd", path.name)):
                self.assertEqual(len(self.found[source]), len(files))
                for moment, file in zip(self.found[source], files):
                    with h5py.File(file) as fields:
                        data, = moment["sets"]
                        self.assertEqual(data["cells"], np.prod(fields["fields"].attrs["cells"]))
                        self.check_gas(data, {"gas": fields["fields"]})
                    n_files += 1
        self.assertGreater(n_files, 1)


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
    @unittest.skipUnless(shutil.which("ffmpeg"), "ffmpeg is not installed")
    def test_movies_have_every_frame(self):
        for ending in "mp4", "gif":
            movie = FOLDER / f"run.{ending}"
            text = program("render", RUN, "--size", "161x121", "--movie", movie, "--rate", "5")
            self.assertIn(f"run.{ending}: 6 frames, 1.2 s", text)
            frames = FOLDER / ending
            frames.mkdir()
            subprocess.run(["ffmpeg", "-nostdin", "-loglevel", "error", "-i", movie, "-fps_mode", "passthrough", frames / "%d.png"], check=True)
            pictures = [matplotlib_image.imread(frames / f"{k}.png")[:, :, :3] for k in range(1, 7)]
            self.assertEqual(len(list(frames.iterdir())), 6)
            self.assertEqual(pictures[0].shape[:2], (122, 162) if ending == "mp4" else (121, 161))
            for before, after in zip(pictures, pictures[1:]):
                self.assertGreater(abs(after - before).mean(), 0.002)
        self.assertFalse((RUN / "pictures").exists())

    def test_what_a_movie_cannot_be_is_said(self):
        elsewhere = FOLDER / "path"
        elsewhere.mkdir()
        (elsewhere / "povray").symlink_to(shutil.which("povray"))
        for words, path, message in ((["run.avi"], None, "ends in .mp4, .webm or .gif"), (["run.mp4", "--frame", "2"], None, "a movie has all frames"),
                                     (["run.mp4", "--rate", "0"], None, "rate 0"), (["run.mp4"], elsewhere, "ffmpeg is not installed")):
            done = subprocess.run([PROGRAM, "render", RUN, "--movie", *words], capture_output=True, text=True, cwd=FOLDER,
                                  env=dict(ENVIRONMENT, PATH=str(path)) if path else ENVIRONMENT)
            self.assertEqual(done.returncode, 2)
            self.assertIn(message, done.stderr)

    def test_a_preview_is_text(self):
        text = program("render", RUN, "--preview", "40")
        lines = text.splitlines()
        self.assertEqual(len(lines), 15)
        self.assertEqual({line.count("\u2580") for line in lines}, {40})
        self.assertGreater(len(set(re.findall(r"38;2;([0-9;]+)m", text))), 20)

    def test_povray_draws_what_is_exported_of_single_and_distributed_snapshots_alike(self):
        pictures = []
        for run in RUN, SHARED:
            out = FOLDER / f"{run.name}-povray"
            program("export", run, "--povray", "--frame", "3", "--out", out)
            scene, = out.glob("*.pov")
            self.assertEqual(scene.read_text().count("sphere {"), 300)
            subprocess.run(["povray", "-D", "+W160", "+H120", f"+I{scene}", f"+O{out / 'picture.png'}"], check=True, capture_output=True)
            pictures.append(matplotlib_image.imread(out / "picture.png")[:, :, :3])
        self.assertGreater(((pictures[0].max(axis=2) - pictures[0].min(axis=2)) > 0.25).mean(), 0.03)
        self.assertLess(abs(pictures[0] - pictures[1]).mean(), 0.01)  # but for the jitter of soft shadows

    def test_povray_draws_grains_in_colours(self):
        picture = FOLDER / "picture.png"
        program("render", RUN, "--size", "320x240", "--out", picture)
        pixels = matplotlib_image.imread(picture)[:, :, :3]
        self.assertEqual(pixels.shape, (240, 320, 3))
        self.assertGreater(((pixels.max(axis=2) - pixels.min(axis=2)) > 0.25).mean(), 0.03)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
