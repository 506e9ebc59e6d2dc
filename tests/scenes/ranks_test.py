"""Runs of several ranks through the real program: who starts them, what they say, how they end.

usage: ranks_test.py PROJECT PROGRAM [-k WORD_OF_A_TEST]

Needs the standard library and Open MPI's mpirun.
"""

import filecmp
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import environment_without, grains_in_a_box, state_hash, wait_until  # noqa: E402

PROJECT, PROGRAM = Path(sys.argv[1]).resolve(), Path(sys.argv[2]).resolve()
HOPPER = PROJECT / "examples" / "hopper" / "scene.toml"
SHORT_HOPPER = [word for setting in ("time.end=0.6", "wall[5].until=0.05", "output.snapshots=0.3")
                for word in ("--set", setting)]
OUTPUT = """[output]
snapshots = 0.05
checkpoints = 0.05
"""
# Elastic grains whose step is so long that their energy drifts.
DRIFTING = """[domain]
low = [0, 0, 0]
high = [0.1, 0.1, 0.1]
[time]
end = 5
step = 7e-4
[[material]]
name = "glass"
density = 2500.0
[contact]
rotation = false
[[contact.pair]]
normal_stiffness = 2000.0
restitution = 1.0
[[particles]]
diameter = 0.01
velocity = [0.05, 0.03, -0.02]
velocity_deviation = 0.05
fill = { count = 100 }
[[wall]]
name = "box"
box = { low = [0, 0, 0], high = [0.1, 0.1, 0.1] }
[output]
snapshots = 4
energy = true
"""
PATIENCE = 120  # [s] for what takes a second on an idle machine

ENVIRONMENT = environment_without("OMPI_", "PMIX_")
AS_ROOT = dict(ENVIRONMENT, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1", OMP_WAIT_POLICY="passive")
MPIRUN = ["mpirun", "--oversubscribe"]


def run(*words, environment=None, **more):
    return subprocess.run([str(word) for word in words], text=True, capture_output=True, timeout=10 * PATIENCE,
                          env=environment or ENVIRONMENT, **more)


def moraine(*words, **more):
    return run(PROGRAM, *words, **more)


def children(parent):
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, rest = stat.read_text().split(" ", 1)
        except OSError:  # gone meanwhile
            continue
        if rest.rsplit(")", 1)[1].split()[:2][1] == str(parent):
            found.append(int(pid))
    return sorted(found)


def lives(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


class Ranks(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp(prefix="moraine_ranks_"))
        self.addCleanup(shutil.rmtree, self.folder)

    def scene(self, end=0.2):
        path = self.folder / f"box_{end}.toml"
        path.write_text(grains_in_a_box(end, more=OUTPUT))
        return path

    def must_end(self, code, done):
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done

    def moraine(self, code, *words, **more):
        return self.must_end(code, moraine(*words, **more))

    def start(self, *words):
        """A run that goes on for long; comes back when it has written a checkpoint."""
        out = self.folder / "out"
        with open(self.folder / "stdout", "w") as stdout, open(self.folder / "stderr", "w") as stderr:
            job = subprocess.Popen([PROGRAM, "run", self.scene(1e4), "--out", out, *words], stdout=stdout,
                                   stderr=stderr, env=ENVIRONMENT)
        self.addCleanup(job.kill)
        wait_until(lambda: list(out.glob("checkpoints/*.h5")) or job.poll() is not None, "the first checkpoint", PATIENCE)
        self.assertIsNone(job.poll(), self.said())
        (mpirun,) = children(job.pid)
        return out, job, children(mpirun)

    def said(self):
        return (self.folder / "stdout").read_text() + (self.folder / "stderr").read_text()

    def test_the_hopper_has_the_same_bits_on_one_two_and_four_ranks(self):
        hashes = set()
        for layout in ("1x1", "2x1", "4x1"):
            done = self.moraine(0, "run", HOPPER, "--out", self.folder / layout, "--layout", layout, *SHORT_HOPPER)
            self.assertIn(f"layout {layout}", done.stdout)
            hashes.add(state_hash(done.stdout))
            self.moraine(0, "compare", self.folder / "1x1", self.folder / layout)
            for path in sorted((self.folder / "1x1").glob("*.csv")):
                if path.name == "balance.csv":  # times of the machine
                    continue
                is_equal = filecmp.cmp(path, self.folder / layout / path.name, shallow=False)
                self.assertTrue(is_equal, f"{layout}: {path.name}")
        self.assertEqual(len(hashes), 1)

    def test_a_run_under_mpirun_takes_the_ranks_it_is_given_and_says_all_once(self):
        scene = self.scene()
        done = self.must_end(0, run(*MPIRUN, "-n", 2, PROGRAM, "run", scene, "--out", self.folder / "given",
                                    environment=AS_ROOT))
        self.assertRegex(done.stdout, r"layout 2x\d")
        self.assertEqual(done.stdout.count("state hash:"), 1)
        alone = self.moraine(0, "run", scene, "--out", self.folder / "alone", "--layout", "1x1")
        self.assertEqual(state_hash(done.stdout), state_hash(alone.stdout))

    def test_ranks_that_may_use_the_same_cores_share_them(self):
        cores = len(os.sched_getaffinity(0))
        done = self.must_end(0, run(*MPIRUN, "--bind-to", "none", "-n", 2, PROGRAM, "run", self.scene(), "--out",
                                    self.folder / "out", environment=AS_ROOT))
        self.assertIn(f"layout 2x{max(1, cores // 2)}\n", done.stdout)

    def test_threads_that_openmp_binds_still_get_all_cores_of_the_process(self):
        cores = sorted(os.sched_getaffinity(0))[:2]
        for settings in ({}, {"GOMP_SPINCOUNT": "1000"}):
            done = self.moraine(0, "check", self.scene(),
                                environment=dict(ENVIRONMENT, OMP_PROC_BIND="true", **settings),
                                preexec_fn=lambda: os.sched_setaffinity(0, cores))
            self.assertRegex(done.stdout, rf"layout +1x1 \({len(cores)} CPU")

    def test_threads_stay_on_the_cpus_that_the_run_may_use_whatever_its_layout(self):
        """Also on a single one, with more threads than cores, and where cores change hands."""
        hashes = set()
        every = sorted(os.sched_getaffinity(0))
        for number, cpus in enumerate(([every[0]], [every[-1]], every)):
            for layout, balance in (("1x1", "auto"), ("1x3", "auto"), ("2x1", "threads"), ("3x2", "auto")):
                out = self.folder / f"{layout}-{number}"
                done = self.moraine(0, "run", self.scene(), "--out", out, "--layout", layout, "--set",
                                    f'run.balance="{balance}"', preexec_fn=lambda: os.sched_setaffinity(0, cpus))
                hashes.add(state_hash(done.stdout))
                for rank in json.loads((out / "summary.json").read_text())["ranks"]:
                    self.assertLessEqual(set(rank["cpus"] + rank["cpus_before"]), set(cpus))
        self.assertEqual(len(hashes), 1)

    def test_a_layout_of_other_ranks_than_the_launcher_gave_is_refused_once(self):
        done = self.must_end(2, run(*MPIRUN, "-n", 2, PROGRAM, "run", self.scene(), "--layout", "3x1", "--out",
                                    self.folder / "out", environment=AS_ROOT))
        self.assertEqual(done.stderr.count('asks for 3 ranks, but the launcher (mpirun, srun) has started 2'), 1)
        self.assertFalse((self.folder / "out").exists())

    def test_a_wrong_command_line_under_mpirun_is_refused_once(self):
        done = self.must_end(2, run(*MPIRUN, "-n", 3, PROGRAM, "run", environment=AS_ROOT))
        self.assertEqual(done.stderr.count("SCENE is required"), 1)

    def test_commands_that_look_at_files_speak_once_under_mpirun(self):
        scene = self.scene()
        done = self.must_end(0, run(*MPIRUN, "-n", 3, PROGRAM, "check", scene, environment=AS_ROOT))
        self.assertEqual(done.stdout.count("a few grains bounce in a box"), 1)

    def test_what_is_wrong_with_a_request_is_said_once_and_nothing_is_started(self):
        folder = self.folder / "bin"
        folder.mkdir()
        (folder / "mpirun").write_text(f"#!/bin/sh\n: >{self.folder}/started\n")
        (folder / "mpirun").chmod(0o755)
        environment = dict(ENVIRONMENT, PATH=str(folder))
        full = self.folder / "full"
        full.mkdir()
        (full / "letter").write_text("dear")
        for words, text in ((["--set", "time.ende=1"], "unknown key"), (["--out", full], "is not empty"),
                            (["--set", "time.step=-1"], "time.step")):
            done = self.moraine(2, "run", self.scene(), "--layout", "4x1", *words, environment=environment)
            self.assertEqual(done.stderr.count(text), 1, done.stderr)
            self.assertFalse((self.folder / "started").exists())
        self.moraine(0, "run", self.scene(), "--layout", "4x1", "--out", self.folder / "out", environment=environment)
        self.assertTrue((self.folder / "started").exists())

    def test_without_mpirun_several_ranks_are_refused_with_the_package_to_install(self):
        done = self.moraine(2, "run", self.scene(), "--layout", "2x2", "--out", self.folder / "out",
                            environment=dict(ENVIRONMENT, PATH=str(self.folder)))
        self.assertIn("openmpi-bin", done.stderr)
        self.assertIn("--layout 1x4", done.stderr)
        self.assertFalse((self.folder / "out").exists())

    def test_what_mpirun_cannot_do_is_said_in_its_own_words(self):
        folder = self.folder / "bin"
        folder.mkdir()
        (folder / "mpirun").write_text("#!/bin/sh\necho there is a hole in my bucket >&2\nexit 3\n")
        (folder / "mpirun").chmod(0o755)
        done = self.moraine(3, "run", self.scene(), "--layout", "2x1", "--out", self.folder / "out",
                            environment=dict(ENVIRONMENT, PATH=str(folder)))
        self.assertEqual(done.stderr, "there is a hole in my bucket\n")

    def test_an_mpirun_that_waits_for_nothing_is_told_of_and_ended(self):
        folder = self.folder / "bin"
        folder.mkdir()
        environment = dict(ENVIRONMENT, PATH=f"{folder}:{os.environ['PATH']}", MORAINE_START_PATIENCE="5")
        for number, (script, text) in enumerate((("exec sleep 1000", "has no ranks and does not end"),
                                                 ("sleep 30 >/dev/null 2>&1 & wait", "has not brought the 2 ranks together in time"),
                                                 ("trap '' TERM; while :; do sleep 1 >/dev/null 2>&1; done", "MORAINE_START_PATIENCE"))):
            (folder / "mpirun.openmpi").write_text(f"#!/bin/sh\n{script}\n")
            (folder / "mpirun.openmpi").chmod(0o755)
            done = self.moraine(1, "run", self.scene(), "--layout", "2x1", "--out", self.folder / f"out{number}",
                                environment=environment)
            self.assertIn("the ranks have not found each other after", done.stderr)
            self.assertIn(text, done.stderr)
            self.assertEqual(done.stderr.count("error:"), 1)
        done = self.moraine(2, "run", self.scene(), "--layout", "2x1", "--out", self.folder / "out",
                            environment=dict(environment, MORAINE_START_PATIENCE="soon"))
        self.assertIn('MORAINE_START_PATIENCE="soon" is not a number of seconds', done.stderr)

    def test_ranks_that_the_limits_on_files_forbid_are_refused_with_the_number_to_ask_for(self):
        def under(kind, value, hard, code, layout):
            return self.moraine(code, "run", self.scene(0.01), "--layout", layout, "--out", self.folder / f"{layout}-{value}",
                                preexec_fn=lambda: resource.setrlimit(kind, (value, hard)))
        for value in (20, 33):
            done = under(resource.RLIMIT_NOFILE, value, value, 2, "2x1")
            self.assertRegex(done.stderr, rf"^error: only {value} open files are allowed here, mpirun for 2 ranks needs 38: "
                                          r".*\(ulimit -n 38")
        under(resource.RLIMIT_NOFILE, 38, 38, 0, "2x1")  # the number that it asks for is enough
        under(resource.RLIMIT_NOFILE, 62, 62, 0, "8x1")
        under(resource.RLIMIT_NOFILE, 20, resource.getrlimit(resource.RLIMIT_NOFILE)[1], 0, "4x1")  # the soft limit is lifted
        done = under(resource.RLIMIT_FSIZE, 4 << 20, 4 << 20, 2, "2x1")
        self.assertIn("files larger than a limit of 4096 kB are not allowed here", done.stderr)
        under(resource.RLIMIT_FSIZE, 8 << 20, 8 << 20, 0, "4x1")

    def test_ranks_without_room_for_the_files_that_they_share_name_the_folder(self):
        unshare = ["unshare", "--mount", "sh", "-c"]
        if run(*unshare, "mount -t tmpfs -o ro tmpfs /dev/shm").returncode != 0:
            self.skipTest("needs the right to mount")
        done = run(*unshare, f"mount -t tmpfs -o ro tmpfs /dev/shm; {PROGRAM} run {self.scene(0.01)} --layout 2x1 --out {self.folder}/out")
        self.must_end(1, done)
        self.assertEqual(done.stderr.count("MPI cannot keep the files that ranks share in /dev/shm: the file system is read-only"), 1, done.stderr)

    def test_an_open_energy_ledger_is_told_of_once_and_each_rank_keeps_a_record_on_any_layout(self):
        path = self.folder / "drifting.toml"
        path.write_text(DRIFTING)
        hashes = set()
        for layout, ranks in (("1x1", [""]), ("2x1", [".rank-0000", ".rank-0001"])):
            out = self.folder / layout
            done = self.moraine(0, "run", path, "--layout", layout, "--out", out)
            self.assertEqual(done.stderr.count("the energy ledger is open by"), 1, done.stderr)
            for rank in ranks:
                self.assertGreaterEqual(len((out / f"flight_record_energy{rank}.csv").read_text().splitlines()), 33)
            hashes.add(state_hash(done.stdout))
        self.assertEqual(len(hashes), 1)

    def test_where_the_scene_asks_for_it_an_open_energy_ledger_ends_the_run_once_its_record_is_complete(self):
        path, out = self.folder / "drifting.toml", self.folder / "out"
        path.write_text(DRIFTING)
        done = self.moraine(1, "run", path, "--layout", "2x1", "--out", out, "--set", 'run.stop_on=["energy"]')
        self.assertEqual(done.stderr.count("error: "), 1, done.stderr)
        self.assertEqual(done.stderr.count("ended as run.stop_on asks: at 3.9998 s: the energy ledger is open by"), 1, done.stderr)
        for rank in range(2):
            rows = (out / f"flight_record_energy.rank-000{rank}.csv").read_text().splitlines()[1:]
            steps = [int(row.split(",")[0]) for row in rows]
            self.assertEqual((steps[0], steps[-1]), (5714, 5745))  # the 32 that follow the warning

    def test_a_rank_that_may_open_too_few_files_says_so_once(self):
        done = self.must_end(2, run(*MPIRUN, "-n", 2, "sh", "-c",
                                    f"ulimit -n 20; exec {PROGRAM} run {self.scene()} --out {self.folder}/out",
                                    environment=AS_ROOT))
        self.assertEqual(done.stderr.count("error: only 20 open files are allowed here, a rank needs 32"), 1, done.stderr)

    def test_an_interrupted_run_of_two_ranks_leaves_a_checkpoint_from_which_another_layout_goes_on(self):
        for number, code in ((signal.SIGTERM, 143), (signal.SIGINT, 130), (signal.SIGHUP, 129)):
            with self.subTest(signal=number.name):
                out, job, _ = self.start("--layout", "2x1")
                job.send_signal(number)
                self.assertEqual(job.wait(PATIENCE), code, self.said())
                ended = rf"^ended by signal {int(number)} at .*, checkpoint (\S+)$"
                path, = re.findall(ended, self.said(), re.MULTILINE)
                self.assertTrue(Path(path).is_file())
                stopped = int(re.search(r"_(\d+)\.h5", path).group(1))
                until = (stopped + 1000) * 5e-5
                on = self.moraine(0, "run", self.scene(1e4), "--out", out, "--layout", "1x2", "--restart", "auto",
                                  "--until", until)
                self.assertIn(f"going on from {path}", on.stdout)
                whole = self.moraine(0, "run", self.scene(1e4), "--out", self.folder / "whole", "--layout", "1x1",
                                     "--until", until)
                self.assertEqual(state_hash(on.stdout), state_hash(whole.stdout))
                shutil.rmtree(out)
                shutil.rmtree(self.folder / "whole")

    def test_a_rank_that_is_killed_ends_the_run_with_one_message(self):
        out, job, ranks = self.start("--layout", "3x1")
        self.assertEqual(len(ranks), 3)
        os.kill(ranks[1], signal.SIGKILL)
        self.assertEqual(job.wait(PATIENCE), 1)
        errors = [line for line in self.said().splitlines() if "error" in line or "ended by" in line]
        self.assertEqual(len(errors), 1, self.said())
        self.assertRegex(errors[0], r"^error: rank \d on \S+ was ended by signal 9 ")
        self.assertNotIn("mpirun", self.said())
        path, = re.findall(r"^the last checkpoint is (\S+)$", self.said(), re.MULTILINE)
        self.moraine(0, "info", path)
        self.assertFalse(any(map(lives, ranks)))
        self.assertIn("--restart auto --out " + str(out), self.said())

    def test_a_killed_mpirun_ends_the_run_with_one_message(self):
        _, job, ranks = self.start("--layout", "2x1")
        os.kill(children(job.pid)[0], signal.SIGKILL)
        self.assertEqual(job.wait(PATIENCE), 1)
        self.assertEqual(self.said().count("error: mpirun was ended by signal 9"), 1, self.said())
        wait_until(lambda: not any(map(lives, ranks)), "the ranks to end", PATIENCE)

    def test_killing_the_program_that_started_the_ranks_ends_them(self):
        _, job, ranks = self.start("--layout", "2x1")
        job.kill()
        wait_until(lambda: not any(map(lives, ranks)), "the ranks to end", PATIENCE)

    def test_a_fault_of_one_rank_ends_all_with_one_message_and_the_way_to_go_on(self):
        out = self.folder / "out"
        scene = self.scene(0.2)
        self.moraine(0, "run", scene, "--out", out, "--layout", "1x1", "--until", 0.1)
        last = sorted(out.glob("checkpoints/*.h5"))[-1]
        shutil.rmtree(out / "snapshots")
        (out / "snapshots").write_text("a file in the place of the folder")  # that only the root makes
        done = self.moraine(1, "run", scene, "--out", out, "--layout", "3x1", "--restart", "auto")
        self.assertEqual(done.stderr.count("error"), 1, done.stderr)
        self.assertRegex(done.stderr, r"error: rank \d: step 3000: ")
        self.assertIn(f"the last checkpoint is {out}/checkpoints/", done.stdout)
        self.assertTrue(last.is_file())
        self.assertRegex((out / "log.txt").read_text(), r"error: rank \d: step 3000: ")

    def test_a_fault_of_the_root_before_the_first_step_ends_all_ranks(self):
        out = self.folder / "out"
        scene = self.scene(0.2)
        self.moraine(0, "run", scene, "--out", out, "--layout", "1x1", "--until", 0.1)
        (out / "hashes.csv").unlink()
        (out / "hashes.csv").mkdir()
        done = self.moraine(1, "run", scene, "--out", out, "--layout", "3x1", "--restart", "auto")
        self.assertEqual(done.stderr.count("error"), 1, done.stderr)
        self.assertIn("error: rank 0: " + str(out / "hashes.csv"), done.stderr)

    def test_a_run_that_is_interrupted_before_its_first_step_ends_by_that_signal(self):
        scene = self.scene(0.2)
        scene.write_text(scene.read_text().replace("count = 120", "solid_fraction = 0.55")
                         .replace("[0.01, 0.012]", "[0.0008, 0.0012]"))  # takes long to fill
        out = self.folder / "out"
        with subprocess.Popen([PROGRAM, "run", scene, "--out", out, "--layout", "2x1"], env=ENVIRONMENT,
                              stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as job:
            self.addCleanup(job.kill)
            wait_until(out.exists, "the directory of the run", PATIENCE)
            job.send_signal(signal.SIGTERM)
            said, errors = job.communicate(timeout=PATIENCE)
        self.assertEqual(job.returncode, 143, said + errors)
        self.assertEqual(said, "ended by signal 15 before the first step or after the last\n")
        self.assertEqual(errors, "")

    def test_a_run_that_goes_wrong_says_so_once_whatever_the_number_of_ranks(self):
        out = self.folder / "out"
        done = self.moraine(1, "run", self.scene(), "--out", out, "--layout", "4x1", "--set", "run.max_overlap=0.01")
        self.assertEqual(done.stderr.count("overlap runs away"), 1, done.stderr)
        self.assertRegex(done.stderr, r"error: rank \d: step \d+")
        self.assertEqual((out / "log.txt").read_text().count("overlap runs away"), 1)
        self.assertNotIn("MPI_ABORT", done.stderr)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    unittest.main(argv=sys.argv[:1] + sys.argv[3:])
