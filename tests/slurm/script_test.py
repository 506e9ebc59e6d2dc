"""What `moraine submit` says, and what its script does, where srun, sbatch and squeue are stand-ins.

usage: script_test.py PROGRAM

Needs no Slurm. A stand-in of srun notes its words, leaves the checkpoints that it is told to leave, and ends with the
exit code that it is told to end with; that of sbatch notes its words.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PROGRAM = Path(sys.argv[1]).resolve()
SCENE = """
[domain]
low = [0, 0, 0]
high = [1, 1, 1]
[time]
end = 1.0
step = 1e-3
[[material]]
name = "glass"
density = 2500.0
[contact]
normal = "linear"
tangential = "none"
[[contact.pair]]
normal_stiffness = 1000.0
restitution = 0.9
[[particles]]
diameter = 0.1
fill = { positions = [[0.5, 0.5, 0.5]] }
[[wall]]
name = "box"
box = { low = [0, 0, 0], high = [1, 1, 1] }
"""
LAUNCHER = """#!/bin/bash
printf '%s\\n' "$@" >"$NOTES/launched"
out=$(printf '%s\\n' "$@" | grep -A1 -x -e --out | tail -n 1)
mkdir -p "$out/checkpoints"
for step in $LEAVES; do : >"$out/checkpoints/checkpoint_$step.h5"; done
[[ -z $ENDS_SHELL ]] || kill -TERM $PPID
exit "${ENDS:-0}"
"""
SUBMITTER = """#!/bin/bash
printf '%s\\n' "$@" >"$NOTES/submitted"
[[ ! -e $NOTES/greeting ]] || cat "$NOTES/greeting"
exit "${SUBMITTER_ENDS:-0}"
"""


class Script(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="moraine it's a $script "))  # blank, quote and dollar are meant
        self.addCleanup(shutil.rmtree, self.folder)
        self.bin = self.folder / "bin"
        self.bin.mkdir()
        for name in ("srun", "mpirun"):
            self.stand_in(name, LAUNCHER)
        for name in ("sbatch", "qsub", "bsub"):
            self.stand_in(name, SUBMITTER)
        self.stand_in("squeue", "#!/bin/bash\ncat \"$NOTES/queue\" 2>/dev/null || true\n")
        self.scene = self.folder / "my bed.toml"
        self.scene.write_text(SCENE, encoding="utf-8")
        self.out = self.folder / "out"
        self.environment = dict(os.environ, PATH=f"{self.bin}:{os.environ['PATH']}", NOTES=str(self.folder))

    def stand_in(self, name, text):
        (self.bin / name).write_text(text, encoding="utf-8")
        (self.bin / name).chmod(0o755)

    def submit(self, code, *words, **environment):
        done = subprocess.run([PROGRAM, "submit", self.scene, *map(str, words)], text=True, capture_output=True,
                              cwd=self.folder, env=dict(self.environment, **environment), check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def script(self, *words):
        return self.submit(0, "--dry-run", "--restart", "auto", "--out", self.out, *words).stdout

    def carry_out(self, script, code, **environment):
        """What a job says."""
        file = self.folder / "script"
        file.write_text(script, encoding="utf-8")
        done = subprocess.run(["bash", file], text=True, capture_output=True, check=False,
                              env=dict(self.environment, **environment))
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout + done.stderr

    def noted(self, name):
        path = self.folder / name
        return path.read_text(encoding="utf-8").splitlines() if path.exists() else None

    def test_the_ranks_get_every_word_as_it_was_given(self):
        settings = ["time.end=2", "title='a $HOME `of` \"beads\" \\ it'", "run.layout='1x1'"]
        self.carry_out(self.script("--layout", "4x3", "--nodes", "2", *[f"--set={text}" for text in settings]), 0)
        words = self.noted("launched")
        at = words.index(str(PROGRAM))
        self.assertEqual(words[at:], [str(PROGRAM), "run", str(self.scene), "--layout", "4x3", "--restart", "auto",
                                      "--out", str(self.out)] + [word for text in settings for word in ("--set", text)])
        for word in ("--nodes=2", "--ntasks=4", "--ntasks-per-node=2", "--cpus-per-task=3", "--mpi=pmix"):
            self.assertIn(word, words[:at])

    def test_a_job_that_is_done_is_not_submitted_again(self):
        self.assertIn("the scene is done", self.carry_out(self.script("--layout", "1x1"), 0, LEAVES="1000"))
        self.assertIsNone(self.noted("submitted"))

    def test_a_job_that_was_stopped_after_some_steps_submits_its_script_again(self):
        for code, leaves in (("143", "000000000009"), ("140", "000000000010")):
            self.carry_out(self.script("--layout", "1x1"), 0, ENDS=code, LEAVES=leaves)
            self.assertEqual(self.noted("submitted"), [str(self.out / "job" / "submit.sh")])
            (self.folder / "submitted").unlink()

    def test_a_job_that_gains_no_step_says_so_and_is_not_submitted_again(self):
        for code in ("143", "140"):
            said = self.carry_out(self.script("--layout", "1x1"), 1, ENDS=code)
            self.assertIn("error: the time limit came before a step beyond step -1", said)
            self.assertIn(str(self.out / "job" / "submit.sh"), said)
        (self.out / "checkpoints").mkdir(parents=True, exist_ok=True)
        for name in ("checkpoint_000000000700.h5", "checkpoint_000000000900.h5.tmp", "checkpoint_000000000900.h5.old",
                     "checkpoint_000000000800.rank-0003.5bd1aa03.h5"):
            (self.out / "checkpoints" / name).touch()
        self.assertIn("step 700", self.carry_out(self.script("--layout", "1x1"), 1, ENDS="143",
                                                 LEAVES="000000000700"))
        self.assertIsNone(self.noted("submitted"))

    def test_a_run_that_fails_or_is_interrupted_by_hand_is_not_submitted_again_and_its_exit_code_stays(self):
        for code in (1, 2, 137, 130):
            said = self.carry_out(self.script("--layout", "1x1"), code, ENDS=str(code), LEAVES="7")
            self.assertIn(f"error: the run has ended with exit code {code}", said)
            self.assertIn("to go on from step 7:", said)
        self.assertIsNone(self.noted("submitted"))

    def test_a_job_that_is_cancelled_is_not_submitted_again(self):
        said = self.carry_out(self.script("--layout", "1x1"), 143, ENDS="143", LEAVES="7", ENDS_SHELL="yes")
        self.assertIn("job: cancelled", said)
        self.assertIn("at step 7", said)
        self.assertIsNone(self.noted("submitted"))

    def test_a_job_that_cannot_be_submitted_again_says_how_to_go_on_by_hand(self):
        said = self.carry_out(self.script("--layout", "1x1"), 1, ENDS="143", LEAVES="7", SUBMITTER_ENDS="1")
        self.assertIn("error: the next job could not be submitted", said)

    def test_each_job_of_an_array_has_its_layout_and_submits_only_itself_again(self):
        script = self.script("--sweep", "--layouts", "2x3,4x1", "--nodes", "2")
        self.assertIn("#SBATCH --array=0-1\n", script)
        self.assertIn("#SBATCH --cpus-per-task=3\n", script)
        self.carry_out(script, 0, ENDS="143", LEAVES="7", SLURM_ARRAY_TASK_ID="1")
        words = self.noted("launched")
        self.assertIn(str(self.out / "4x1"), words)
        for word in ("--ntasks=4", "--ntasks-per-node=2", "--cpus-per-task=1", "4x1"):
            self.assertIn(word, words)
        self.assertEqual(self.noted("submitted"), ["--array=1", str(self.out / "job" / "submit.sh")])

    def test_the_templates_for_pbs_and_lsf_start_the_ranks_and_go_on_too(self):
        for system, hosts in (("pbs", "PBS_NODEFILE"), ("lsf", "LSB_DJOB_HOSTFILE")):
            script = self.script("--system", system, "--layout", "4x3", "--nodes", "2", "--time", "1:00:00")
            (self.out / "job").mkdir(parents=True)
            (self.out / "job" / "submit.sh").write_text(script, encoding="utf-8")
            said = self.carry_out(script, 0, ENDS="143", LEAVES="7", **{hosts: "hosts"})
            self.assertIn("the next job goes on", said)
            self.assertIn("ppr:2:node:PE=3", self.noted("launched"))
            self.assertIsNotNone(self.noted("submitted"))
            self.assertIn("timeout --preserve-status --signal=USR2 3480 ", script)
            (self.folder / "submitted").unlink()
            shutil.rmtree(self.out)

    def test_submitting_writes_the_script_and_says_the_number_and_how_to_watch_and_cancel(self):
        (self.folder / "greeting").write_text("Welcome to 3 clusters\n4711;north\n", encoding="utf-8")
        done = self.submit(0, "--layout", "1x1", "--out", self.out)
        for text in ("job 4711 submitted", "squeue --me --name=my_bed", "scancel --me --name=my_bed", "4711.out'\n"):
            self.assertIn(text, done.stdout)
        script = self.out / "job" / "submit.sh"
        self.assertEqual(self.noted("submitted"), ["--parsable", str(script)])
        again = self.submit(2, "--layout", "1x1", "--out", self.out)
        self.assertIn("belongs to a job that was submitted before", again.stderr)
        (self.folder / "queue").write_text(f"4712 PENDING {script}\n", encoding="utf-8")
        queued = self.submit(2, "--layout", "1x1", "--out", self.out, "--restart", "auto")
        self.assertIn("belongs to job 4712", queued.stderr)
        (self.folder / "queue").unlink()
        self.submit(0, "--layout", "1x1", "--out", self.out, "--restart", "auto", "--time", "77")
        self.assertIn("--time=01:17:00", script.read_text(encoding="utf-8"))

    def test_a_run_in_the_foreground_leaves_the_directory_of_a_waiting_job_alone(self):
        self.submit(0, "--layout", "1x1", "--name", "first")
        done = subprocess.run([PROGRAM, "run", self.scene, "--layout", "1x1"], text=True, capture_output=True,
                              cwd=self.folder, env=self.environment, check=False)
        self.assertIn("results: runs/my bed-2\n", done.stdout)

    def test_a_refused_job_leaves_what_was_there_before(self):
        script = self.out / "job" / "submit.sh"
        (self.folder / "greeting").write_text("sbatch: error: the cluster is on holiday\n", encoding="utf-8")
        done = self.submit(2, "--layout", "1x1", "--out", self.out, SUBMITTER_ENDS="1")
        self.assertIn("sbatch has refused the job (exit code 1)", done.stderr)
        self.assertIn("the cluster is on holiday", done.stderr)
        self.assertFalse(self.out.exists())
        self.submit(0, "--layout", "1x1", "--out", self.out)
        before = script.read_text(encoding="utf-8")
        self.submit(2, "--layout", "1x1", "--out", self.out, "--restart", "auto", "--time", "5", SUBMITTER_ENDS="1")
        self.assertEqual(script.read_text(encoding="utf-8"), before)

    def test_without_sbatch_the_package_and_the_dry_run_are_named(self):
        (self.folder / "empty").mkdir()
        done = self.submit(2, "--layout", "1x1", "--out", self.out, PATH=str(self.folder / "empty"))
        self.assertIn("slurm-client", done.stderr)
        self.assertIn("--dry-run", done.stderr)
        self.assertFalse(self.out.exists())

    def test_what_is_wrong_is_said_before_anything_is_submitted(self):
        for words, text in ((["--layout", "1x1", "--set", "time.ende=1"], "unknown key"),
                            (["--layout", "1x1", "--set", "time.step=-1"], "time.step"),
                            ([], "--layout RANKSxTHREADS"),
                            (["--layout", "auto"], "--layout RANKSxTHREADS"),
                            (["--layout", "4"], "expected \"auto\" or RANKSxTHREADS"),
                            (["--layout", "3x1", "--nodes", "2"], "take 2 or 4 ranks"),
                            (["--layout", "1x1", "--nodes", "0"], "--nodes 0"),
                            (["--layout", "1x1", "--time", "1 hour"], "--time \"1 hour\""),
                            (["--layout", "1x1", "--time", "1", "--margin", "60"], "more --time, or less --margin"),
                            (["--layout", "1x1", "--mem", "lots"], "--mem \"lots\""),
                            (["--layout", "1x1", "--restart", "file.h5"], "--restart auto"),
                            (["--layout", "1x1", "--sweep"], "--layouts"),
                            (["--layouts", "1x1,2x1"], "--sweep"),
                            (["--sweep"], "--layouts 1x4"),
                            (["--sweep", "--layouts", "1x1,1x1"], "1x1 twice"),
                            (["--layout", "1x1", "--system", "cray"], "slurm, pbs or lsf"),
                            (["--layout", "1x1", "--system", "pbs", "--time", "60"], "--dry-run"),
                            (["--layout", "1x1", "--system", "lsf", "--dry-run"], "need --time"),
                            (["--layout", "1x1", "--out", str(self.bin)], "is not empty")):
            with self.subTest(words=words):
                done = self.submit(2, *words)
                self.assertIn(text, done.stderr)
                self.assertIsNone(self.noted("submitted"))
                self.assertFalse((self.folder / "runs").exists())


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[2:])
