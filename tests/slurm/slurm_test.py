"""Jobs of `moraine submit` on a real Slurm, which local_slurm.py has started around this script.

usage: local_slurm.py python3 slurm_test.py PROGRAM

Two nodes on one host share its name, its memory and its first two CPUs. What follows from that is the environment's
business here, and no business of the job's script: Open MPI must not take ranks on the other node for neighbours in
shared memory, and who waits must not take the CPU that is waited for.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import environment_without, grains_in_a_box, state_hash, wait_until  # noqa: E402

PROGRAM = Path(sys.argv[1]).resolve()
STEP = 5e-5  # [s]
PATIENCE = 120  # [s] for what takes some seconds on an idle machine

HERE = {"OMPI_MCA_btl": "self,tcp", "OMPI_MCA_pml": "ob1", "OMPI_MCA_mpi_yield_when_idle": "1",
        "OMP_WAIT_POLICY": "passive"}
ENVIRONMENT = dict(environment_without("OMPI_", "PMIX_", "SLURM_", "SBATCH_"), **HERE)
if "SLURM_CONF" in os.environ:
    ENVIRONMENT["SLURM_CONF"] = os.environ["SLURM_CONF"]


def run(*words, **more):
    return subprocess.run([str(word) for word in words], text=True, capture_output=True, timeout=4 * PATIENCE,
                          env=ENVIRONMENT, check=False, **more)


def queue():
    return run("squeue", "--noheader", "--format=%i %T %R").stdout


class Slurm(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="moraine slurm "))  # the blank is meant
        self.addCleanup(shutil.rmtree, self.folder)
        self.addCleanup(run, "scancel", "--me", "--state=RUNNING")
        self.addCleanup(run, "scancel", "--me", "--state=PENDING")
        self.scene = self.folder / "bed.toml"
        self.scene.write_text(grains_in_a_box(1e4, step=STEP), encoding="utf-8")

    def must_end(self, code, done):
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def moraine(self, code, *words):
        return self.must_end(code, run(PROGRAM, *words, cwd=self.folder))

    def submit(self, out, *words):
        done = self.moraine(0, "submit", self.scene, "--mem", 500, "--out", out, *words)
        return re.search(r"^job (\d+) submitted", done.stdout, re.MULTILINE).group(1)

    def said(self, out):
        """What the jobs of a directory have written, in their order."""
        paths = sorted((out / "job").glob("*.out"), key=lambda path: [int(n) for n in re.findall(r"\d+", path.name)])
        return "".join(path.read_text(encoding="utf-8") for path in paths)

    def wait_for_jobs(self, patience=PATIENCE):
        wait_until(lambda: not queue(), f"the jobs to end: {queue()}", patience, 0.2)

    def first_part(self, out):
        """Steps of the first job, and steps a second, once the second job goes on from them."""
        wait_until(lambda: "going on from" in self.said(out), f"the first stop: {self.said(out)}", PATIENCE, 0.2)
        said = self.said(out)
        steps = int(re.search(r"^job: time is up at step (\d+)", said, re.MULTILINE).group(1))
        return steps, steps / float(re.search(r"^total +([\d.]+)", said, re.MULTILINE).group(1))

    def test_a_job_that_its_time_limit_stops_twice_ends_with_the_bits_of_the_unbroken_run(self):
        # The signal comes 25 s before the limit of a minute, or up to 30 s earlier: Slurm looks at limits each half
        # minute. Nobody knows how fast this machine is, so the scene gets its end when the second job has started: the
        # third will heed it.
        out, whole = self.folder / "broken", self.folder / "whole"
        first = self.submit(out, "--layout", "2x1", "--time", 1, "--margin", 25)
        steps, steps_a_second = self.first_part(out)
        end = round(steps + 70 * steps_a_second) * STEP
        self.scene.write_text(grains_in_a_box(end, step=STEP), encoding="utf-8")
        unbroken = self.moraine(0, "run", self.scene, "--layout", "1x1", "--out", whole)
        self.wait_for_jobs(6 * PATIENCE)
        said = self.said(out)
        n_stops = said.count("the next job goes on")
        self.assertGreaterEqual(n_stops, 2, said)
        for text in ("ended by signal 15", "going on from", "Submitted batch job"):
            self.assertEqual(said.count(text), n_stops, said)
        self.assertEqual(said.count("job: the scene is done"), 1, said)
        self.assertEqual(state_hash((out / "summary.txt").read_text()), state_hash(unbroken.stdout))
        self.moraine(0, "compare", out, whole)
        self.assertIn("JobState=COMPLETED", run("scontrol", "show", "job", first).stdout)

    def test_a_job_on_two_nodes_of_two_ranks_has_the_bits_of_one_rank(self):
        out = self.folder / "nodes"
        end = ("--set", "time.end=0.02")
        job = self.submit(out, "--nodes", 2, "--layout", "4x1", *end)
        self.wait_for_jobs()
        said = self.said(out)
        self.assertIn("layout 4x1", said)
        self.assertIn("job: the scene is done", said)
        shown = run("scontrol", "show", "job", job).stdout
        self.assertIn("NodeList=n[1-2]", shown)
        self.assertIn("NumNodes=2", shown)
        whole = self.moraine(0, "run", self.scene, "--layout", "1x1", "--out", self.folder / "whole", *end)
        self.assertEqual(state_hash(said), state_hash(whole.stdout))

    def test_an_array_of_layouts_runs_each_in_a_directory_of_its_own_with_the_same_bits(self):
        out = self.folder / "sweep"
        layouts = ("2x1", "2x2", "4x1")
        self.submit(out, "--sweep", "--layouts", ",".join(layouts), "--nodes", 2, "--set", "time.end=0.02")
        self.wait_for_jobs()
        self.assertEqual(self.said(out).count("job: the scene is done"), 3, self.said(out))
        hashes = set()
        for layout in layouts:
            text = (out / layout / "summary.txt").read_text()
            self.assertIn(f"layout {layout}", text)
            hashes.add(state_hash(text))
        self.assertEqual(len(hashes), 1)

    def test_a_job_that_sbatch_refuses_is_told_in_its_words_and_leaves_nothing_behind(self):
        for words, reason in ((["--layout", "1x1", "--partition", "nowhere"], "invalid partition"),
                              (["--layout", "1x3"], "not available"),
                              (["--layout", "1x1", "--mem", "900T"], "not available"),
                              (["--layout", "1x1", "--directive", "qos"], "requires an argument")):
            with self.subTest(reason=reason):
                done = self.moraine(2, "submit", self.scene, "--out", self.folder / "out", *words)
                self.assertEqual(done.stdout, "")
                self.assertIn("error: sbatch has refused the job", done.stderr)
                self.assertIn(reason, done.stderr)
                self.assertFalse((self.folder / "out").exists())

    def test_tasks_of_srun_that_do_not_find_each_other_are_refused_with_one_message(self):
        done = run("srun", "--mpi=none", "--ntasks=2", "--mem=500", PROGRAM, "run", self.scene, "--out",
                   self.folder / "out")
        self.must_end(2, done)
        self.assertEqual(done.stderr.count("srun has started 2 tasks that do not find each other"), 1, done.stderr)
        self.assertIn("--mpi=pmix", done.stderr)
        self.assertFalse((self.folder / "out").exists())

    def test_a_job_that_the_partition_can_never_run_is_warned_of(self):
        done = self.moraine(0, "submit", self.scene, "--layout", "1x999", "--out", self.folder / "out")
        self.assertRegex(done.stderr, r"^warning: job \d+ waits by reason of PartitionConfig")

    def test_a_cancelled_job_leaves_a_checkpoint_goes_no_further_and_can_be_submitted_again(self):
        out = self.folder / "cancelled"
        job = self.submit(out, "--layout", "2x1", "--time", 10)
        wait_until((out / "log.txt").exists, "the run to start", PATIENCE)
        refused = self.moraine(2, "submit", self.scene, "--layout", "2x1", "--out", out, "--restart", "auto")
        self.assertIn(f"belongs to job {job}, which has not ended yet", refused.stderr)
        time.sleep(3)
        self.must_end(0, run("scancel", job))
        self.wait_for_jobs()
        said = self.said(out)
        step, = re.findall(r"^job: cancelled.* at step (\d+);", said, re.MULTILINE)
        self.assertGreater(int(step), 0, said)
        self.assertNotIn("Submitted batch job", said)
        end = f"time.end={(int(step) + 100) * STEP!r}"
        self.submit(out, "--layout", "1x2", "--restart", "auto", "--set", end)
        self.wait_for_jobs()
        self.assertRegex(self.said(out), rf"going on from .*: step {step},")
        self.assertIn("job: the scene is done", self.said(out))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[2:], verbosity=2)
