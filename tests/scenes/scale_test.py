"""Scaling sweeps through the real program: what they leave, how they go on, what they say is wrong.

usage: scale_test.py PROJECT PROGRAM

Needs the standard library and Open MPI's mpirun; draws plots where gnuplot is installed.
"""

import csv
import json
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import environment_without, grains_in_a_box  # noqa: E402

PROJECT, PROGRAM = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
SCENE = grains_in_a_box(40, step=2e-5, stiffness=5000.0, more="""[output]
snapshots = 0.01
checkpoints = 0.01
[[probe]]
kind = "contacts"
interval = 0.001
""")
RULE = '[scale]\nweak = ["domain.high.z", "particles[0].fill.count"]\n'
PATIENCE = 120  # [s] for what takes seconds on an idle machine
ENVIRONMENT = environment_without("OMPI_", "PMIX_")


class Scale(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="moraine_scale_"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.scene = self.folder / "box.toml"
        self.scene.write_text(SCENE + RULE)
        self.out = self.folder / "out"

    def words(self, kind="--strong", layouts="1x1,2x1", steps=200, warm_up=50, repeats=2, more=()):
        counts = ("--steps", steps, "--warm-up", warm_up) if steps is not None else ()
        return [str(word) for word in (PROGRAM, "scale", self.scene, kind, "--layouts", layouts, *counts, "--repeats",
                                       repeats, "--out", self.out, *more)]

    def scale(self, code, environment=None, **options):
        done = subprocess.run(self.words(**options), text=True, capture_output=True, timeout=5 * PATIENCE,
                              env=environment or ENVIRONMENT, cwd=self.folder)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def results(self):
        return json.loads((self.out / "scale.json").read_text())

    def test_a_sweep_leaves_a_row_for_each_layout_and_one_summary_for_each_run(self):
        done = self.scale(0, more=["--project", "4,16"])
        self.assertIn("all 4 runs ended in the same state", done.stdout)
        self.assertIn("run 4 of 4: layout 2x1, repeat 2 of 2", done.stderr)
        self.assertIn("best layout: ", done.stdout)
        results = self.results()
        self.assertEqual([(row["layout"], row["runs"]) for row in results["layouts"]], [("1x1", 2), ("2x1", 2)])
        self.assertEqual(results["layouts"][0]["efficiency"], 1.0)
        self.assertEqual(len({h for row in results["layouts"] for h in row["state_hashes"]}), 1)
        self.assertEqual(results["layouts"][1]["messages_per_step"], 2)
        self.assertGreater(results["layouts"][1]["ghosts"], 0)
        self.assertEqual([row["ranks"] for row in results["projected"]], [4, 16])
        with open(self.out / "scale.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual([row["kind"] for row in rows], ["measured", "measured", "projected", "projected"])
        self.assertGreater(float(rows[1]["particle-steps/s"]), 0)
        for name in ("1x1-1", "1x1-2", "2x1-1", "2x1-2"):
            run = json.loads((self.out / "runs" / name / "summary.json").read_text())
            self.assertEqual((run["steps"], run["warm_up_steps"]), (200, 50))
            self.assertEqual([len(rank["cpus"]) for rank in run["ranks"]], [1] * int(name[0]))
            self.assertEqual(run["reductions"]["mean"] > 0, name.startswith("2"))
            self.assertFalse(list((self.out / "runs" / name).glob("**/*.h5")), "snapshots are not timed")
        if shutil.which("gnuplot"):
            self.assertIn("projected, not measured", (self.out / "scale.svg").read_text())
            self.assertEqual((self.out / "scale.png").read_bytes()[1:4], b"PNG")

    def test_an_interrupted_sweep_keeps_what_is_done_and_goes_on_from_there(self):
        first = self.out / "runs" / "1x1-1" / "summary.json"
        steps = 2000
        with subprocess.Popen(self.words(steps=steps), env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                              text=True) as job:
            self.addCleanup(job.kill)
            for _ in range(20 * PATIENCE):
                if first.exists() or job.poll() is not None:
                    break
                time.sleep(0.05)
            time.sleep(0.2)  # into the next run
            job.send_signal(signal.SIGINT)
            said, errors = job.communicate(timeout=PATIENCE)
        self.assertEqual(job.returncode, 130, said + errors)
        self.assertRegex(said, r"ended by signal 2: [123] of 4 runs done, and kept in ")
        self.assertFalse((self.out / "scale.json").exists())
        written = first.stat().st_mtime_ns
        done = self.scale(0, steps=steps)
        self.assertRegex(done.stdout, r"[123] of 4 runs are done already")
        self.assertNotIn("run 1 of 4", done.stderr)
        self.assertEqual(first.stat().st_mtime_ns, written)
        self.assertIn("all 4 runs ended in the same state", done.stdout)
        again = self.scale(0, steps=steps)
        self.assertNotIn("run ", again.stderr)
        self.assertIn("best layout: ", again.stdout)
        more = self.scale(0, steps=steps, repeats=3)
        self.assertIn("run 5 of 6", more.stderr)
        self.assertNotIn("run 4 of 6", more.stderr)

    def test_a_sweep_of_a_changed_scene_starts_anew_and_keeps_the_old_one(self):
        self.scale(0, layouts="1x1", repeats=1)
        old = (self.out / "runs" / "1x1-1" / "summary.json").read_text()
        done = self.scale(0, layouts="1x1", repeats=1, more=["--set", "particles[0].seed=2"])
        self.assertIn("changed since the sweep in ", done.stdout)
        self.assertIn("the scene", done.stdout)
        self.assertEqual((self.folder / "out.old" / "runs" / "1x1-1" / "summary.json").read_text(), old)
        new = json.loads((self.out / "runs" / "1x1-1" / "summary.json").read_text())
        self.assertNotEqual(new["state_hash"], json.loads(old)["state_hash"])

    def test_runs_that_end_in_different_states_are_an_error_with_both_hashes(self):
        self.scale(0)
        path = self.out / "runs" / "2x1-2" / "summary.json"
        summary = json.loads(path.read_text())
        good, summary["state_hash"] = summary["state_hash"], "0" * 32
        path.write_text(json.dumps(summary))
        done = self.scale(1)
        self.assertIn(f"layout 1x1 with the hash {good}, layout 2x1 with {'0' * 32}", done.stderr)
        self.assertFalse(self.results()["is_same_state"])

    def test_in_weak_scaling_the_scene_grows_with_the_cores(self):
        done = self.scale(0, kind="--weak", layouts="1x1,1x2,2x1", repeats=1)
        self.assertIn("runs on as many cores ended in the same state", done.stdout)
        rows = self.results()["layouts"]
        self.assertEqual([row["grains"] for row in rows], [120, 240, 240])
        self.assertEqual(rows[1]["state_hashes"], rows[2]["state_hashes"])

    def test_weak_scaling_of_a_scene_without_a_rule_says_what_to_add(self):
        self.scene.write_text(SCENE)
        done = self.scale(2, kind="--weak")
        self.assertIn('[scale]\nweak = ["domain.high.z"]', done.stderr)
        self.assertFalse(self.out.exists())

    def test_what_is_wrong_with_a_request_is_said_before_anything_is_run(self):
        for options, text in ((dict(layouts="1x1,2"), 'layout "2"'),
                              (dict(steps=10**7), "the scene ends after 2 000 000 steps"),
                              (dict(more=["--set", "time.edn=1"]), 'did you mean "end"?'),
                              (dict(steps=0), "expected a whole number from 1"),
                              (dict(more=["--project", "0"]), "--project: expected")):
            with self.subTest(text=text):
                self.assertIn(text, self.scale(2, **options).stderr)
                self.assertFalse(self.out.exists())

    def test_a_run_that_fails_ends_the_sweep_with_its_last_words_and_what_is_done_stays(self):
        # The grains overlap as they start, and are flung apart.
        wrong = ["--set", "run.max_overlap=1e-9"]
        done = self.scale(1, layouts="1x1", repeats=1, more=wrong)
        self.assertIn("run 1x1-1 ended with exit code 1; the last that it said", done.stderr)
        self.assertIn("max_overlap", done.stderr)

    def test_a_short_scene_is_timed_over_three_quarters_of_its_steps(self):
        self.scale(0, layouts="1x1", repeats=1, steps=None, more=["--set", "time.end=0.0016"])  # 80 steps
        self.assertEqual((self.results()["steps"], self.results()["warm_up_steps"]), (60, 20))

    def test_a_projection_that_cannot_be_made_leaves_what_was_measured(self):
        # The block that is run for the projection's rates goes on for longer, and its grains come too close.
        done = self.scale(0, layouts="1x1", repeats=1, steps=1, warm_up=0,
                          more=["--project", "4", "--set", "run.max_overlap=1e-3"])
        self.assertIn("warning: there is no projection: ", done.stderr)
        self.assertIn("best layout: 1x1", done.stdout)
        self.assertEqual(self.results()["projected"], [])

    def test_without_gnuplot_the_sweep_succeeds_and_names_the_package(self):
        folder = self.folder / "bin"
        folder.mkdir()
        done = self.scale(0, layouts="1x1", repeats=1, environment=dict(ENVIRONMENT, PATH=str(folder)))
        self.assertIn("gnuplot-nox", done.stdout)
        self.assertTrue((self.out / "scale.csv").exists())
        self.assertFalse((self.out / "scale.svg").exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
