"""Sweeps of speed against error, and reports, through the real program.

usage: pareto_test.py PROJECT PROGRAM

Needs the standard library; draws plots where gnuplot is installed.
"""

import csv
import json
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from html.parser import HTMLParser
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import environment_without, grains_in_a_box  # noqa: E402

PROJECT, PROGRAM = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
MORE = """[[probe]]
kind = "region"
name = "all"
interval = 0.001
[pareto]
steps_per_contact = [10, 40]
"""
PAIR = "{ positions = [[0.03, 0.05, 0.02], [0.07, 0.05, 0.03]] }"


def scene(fill):
    return grains_in_a_box(0.05, title="two grains on the floor & a wall", step=None, high=(0.1, 0.1, 0.1), stiffness=2000.0,
                           diameter="0.01", fill=fill, more=MORE)


SCENE, CROWD = scene(PAIR), scene("{ count = 60 }")
PATIENCE = 120  # [s] for what takes seconds on an idle machine
ENVIRONMENT = environment_without("OMPI_", "PMIX_")


class Page(HTMLParser):
    """Collects what a page refers to, and whether its tags close."""

    def __init__(self):
        super().__init__()
        self.outside, self.open, self.tables, self.drawings = [], [], 0, 0

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in ("src", "href", "xlink:href") and value and not value.startswith("#"):
                self.outside.append(value)
        if tag in ("table", "tr", "td", "figure", "dl", "body", "details", "svg"):
            self.open.append(tag)
        self.tables += tag == "table"
        self.drawings += tag == "svg"

    def handle_endtag(self, tag):
        if self.open and self.open[-1] == tag:
            self.open.pop()


class Pareto(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="moraine_pareto_"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.scene = self.folder / "box.toml"
        self.scene.write_text(SCENE)
        self.out = self.folder / "out"

    def moraine(self, code, *words, environment=None):
        done = subprocess.run([str(word) for word in (PROGRAM, *words)], text=True, capture_output=True,
                              timeout=5 * PATIENCE, env=environment or ENVIRONMENT, cwd=self.folder)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def pareto(self, code, *more, layout="1x1", **options):
        return self.moraine(code, "pareto", self.scene, "--layout", layout, "--out", self.out, *more, **options)

    def settings(self):
        return {row["name"]: row for row in json.loads((self.out / "pareto.json").read_text())["settings"]}

    def test_paths_of_few_grains_give_errors_that_shrink_with_the_step_and_one_setting_is_recommended(self):
        done = self.pareto(0)
        rows = self.settings()
        error = {name: row["errors"][0]["error"] for name, row in rows.items() if row["errors"]}
        self.assertGreater(error["10 steps a contact"], 3 * error["40 steps a contact"])
        self.assertLess(error["40 steps a contact"], 0.05)
        self.assertEqual([row["is_recommended"] for row in rows.values() if "is_recommended" in row].count(True), 1)
        self.assertIn("recommended: ", done.stdout)
        skins = [row for row in rows.values() if row["kind"] == "skin"]
        self.assertEqual(len(skins), 2)
        for row in skins:
            self.assertEqual(row["state_hashes"], rows["scene"]["state_hashes"], "a skin changes no bit")
            self.assertEqual(row["errors"], rows["scene"]["errors"])
        with open(self.out / "pareto.csv", newline="") as file:
            self.assertEqual(len(list(csv.DictReader(file))), len(rows))
        if shutil.which("gnuplot"):
            self.assertIn("efficient front", (self.out / "pareto.svg").read_text())

    def test_runs_that_are_done_are_kept_also_where_more_is_asked_for_and_on_other_layouts_errors_are_the_same(self):
        self.pareto(0)
        first = self.settings()
        again = self.pareto(0, "--set", "pareto.accept=0.5", "--set", "pareto.steps_per_contact=[10, 40, 20]")
        self.assertRegex(again.stdout, r"6 of 8 runs are done already|7 of 8 runs are done already")
        self.assertEqual(self.settings()["10 steps a contact"]["errors"], first["10 steps a contact"]["errors"])
        moved = self.pareto(0, layout="1x2")
        self.assertIn("pareto on 1x1, now pareto on 1x2", moved.stdout)
        for name, row in self.settings().items():
            self.assertEqual((row["state_hashes"], row["errors"]), (first[name]["state_hashes"], first[name]["errors"]))

    def test_statistics_of_a_crowd_have_intervals_from_repeats_with_other_seeds(self):
        self.scene.write_text(CROWD + 'statistics = ["all.coordination number", "all.velocity z"]\nfrom = 0.02\n')
        self.pareto(0, "--repeats", "2")
        rows = self.settings()
        self.assertEqual(len(set(rows["scene"]["state_hashes"])), 2)
        for error in rows["10 steps a contact"]["errors"]:
            self.assertGreater(error["half_width"], 0)
        self.assertEqual(rows["scene"]["runs"], 2)

    def test_a_setting_that_stops_is_a_row_and_not_the_end(self):
        self.scene.write_text(SCENE + '[[pareto.variant]]\nname = "soft as butter"\nset = '
                              '["contact.pair[0].normal_stiffness=1.0"]\n')
        done = self.pareto(0)
        self.assertIn("stopped: soft as butter: step", done.stdout)
        self.assertIn("of its radius in one step", self.settings()["soft as butter"]["failure"])
        self.assertNotIn("run ", self.pareto(0).stderr, "it is not tried again")

    def test_paths_of_a_crowd_are_not_taken_for_errors(self):
        # At its end a crowd has collided often enough for paths to have parted.
        self.scene.write_text(CROWD.replace("end = 0.05", "end = 0.6").replace("velocity = [0.2, 0.1, -1.0]",
                                                                               "velocity_deviation = 1.0"))
        done = self.pareto(1, "--set", "time.gravity=[0,0,0]", "--set", "contact.pair[0].restitution=1.0")
        self.assertIn("the scene is chaotic", done.stdout)
        self.assertIn("statistics = ", done.stdout)

    def test_an_interrupted_sweep_goes_on_where_it_was(self):
        more = ("--repeats", 1, "--set", "time.end=3", "--set", 'pareto.statistics=["all.grains"]')
        words = [str(w) for w in (PROGRAM, "pareto", self.scene, "--layout", "1x1", "--out", self.out, *more)]
        with subprocess.Popen(words, env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as job:
            self.addCleanup(job.kill)
            for _ in range(20 * PATIENCE):
                if (self.out / "runs" / "scene-1.request").exists() or job.poll() is not None:
                    break
                time.sleep(0.02)
            job.send_signal(signal.SIGINT)
            said, errors = job.communicate(timeout=PATIENCE)
        self.assertEqual(job.returncode, 130, said + errors)
        self.assertRegex(said, r"ended by signal 2: [2345] of 7 runs done, and kept in ")
        done = self.pareto(0, *more)
        self.assertRegex(done.stdout, r"[2345] of 7 runs are done already")

    def test_what_is_wrong_is_said_before_anything_is_run(self):
        for change, text in (('pareto.values=["all.speed"]', "no such column; it has"),
                             ("pareto.end=7", "is after time.end"),
                             ("pareto.steps_per_contact=[1]", "expected numbers from 2, found 1"),
                             ("pareto.step=[1]", "unknown key"),
                             ('time.end="x"', "time.end")):
            with self.subTest(text=text):
                self.assertIn(text, self.pareto(2, "--set", change).stderr)
                self.assertFalse(self.out.exists())
        self.assertIn("expected a whole number from 1", self.pareto(2, "--repeats", "0").stderr)

    def check_page(self, path, *texts):
        page = Page()
        text = path.read_text()
        page.feed(text)
        self.assertEqual(page.outside, [], "a page needs nothing beside itself")
        self.assertEqual(page.open, [])
        self.assertGreater(page.tables, 0)
        for expected in texts:
            self.assertIn(expected, text)
        names = re.findall(r"\bid=['\"]([^'\"]+)", text)
        self.assertEqual(len(names), len(set(names)), "names in drawings do not take each other's")
        return page

    def test_a_report_is_one_page_of_a_pareto_sweep_a_run_or_a_scaling_sweep(self):
        self.pareto(0)
        self.moraine(0, "report", self.out)
        page = self.check_page(self.out / "report.html", "two grains on the floor &amp; a wall", "moraine pareto",
                               "recommended", "commit", "normal_stiffness")
        run = self.folder / "run"
        self.moraine(0, "run", self.scene, "--layout", "1x1", "--out", run)
        self.moraine(0, "report", run, "--out", self.folder / "page.html")
        hash_ = json.loads((run / "summary.json").read_text())["state_hash"]
        drawn = self.check_page(self.folder / "page.html", hash_, "moraine run", "scene.toml, as run")
        scaling = self.folder / "scaling"
        self.moraine(0, "scale", self.scene, "--strong", "--layouts", "1x1", "--steps", 50, "--warm-up", 10, "--repeats",
                     1, "--out", scaling)
        self.moraine(0, "report", scaling)
        self.check_page(scaling / "report.html", "Strong scaling", "moraine scale", "speed-up")
        if shutil.which("gnuplot"):
            self.assertEqual(page.drawings, 1)
            self.assertGreater(drawn.drawings, 1)
        self.assertFalse(list(run.glob("report*")), "nothing is left beside the page")

    def test_a_report_of_nothing_says_what_it_expects(self):
        self.assertIn("expected the directory of a run", self.moraine(2, "report", self.folder).stderr)
        self.assertIn("is not a directory", self.moraine(2, "report", self.folder / "none").stderr)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
