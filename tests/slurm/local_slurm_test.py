"""local_slurm.py leaves nothing behind, however it ends, and says why where it cannot start.

usage: local_slurm_test.py
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import local_slurm

SCRIPT = Path(local_slurm.__file__).resolve()
# A job that goes on in the background, and one in the queue; then the place of all files.
COMMAND = """
sbatch --quiet --output=/dev/null --nodes=2 --ntasks=2 --wrap 'srun sleep 1000'
sbatch --quiet --output=/dev/null --nodes=2 --wrap 'sleep 1000'
until [[ $(squeue --noheader --steps | wc -l) -ge 2 ]]; do sleep 0.1; done
dirname "$SLURM_CONF" >"$1"
sleep "$2"
exit 5
"""


class LocalSlurm(unittest.TestCase):
    def start(self, *options, seconds):
        """One that runs jobs; its process, and the folder of its files."""
        note = tempfile.NamedTemporaryFile()
        self.addCleanup(note.close)
        process = subprocess.Popen([sys.executable, SCRIPT, *options, "bash", "-c", COMMAND, "bash", note.name,
                                    str(seconds)], stderr=subprocess.DEVNULL)  # a limit that is passed makes many words
        self.addCleanup(process.kill)
        end = time.monotonic() + 120
        while not Path(note.name).read_text() and time.monotonic() < end and process.poll() is None:
            time.sleep(0.1)
        folder = Path(note.name).read_text().strip()
        self.assertTrue(folder, "it has not started")
        self.assertGreater(len(self.processes_of(folder)), 6)
        return process, folder

    def only_child(self, pid):
        child, = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
        return int(child)

    def processes_of(self, folder):
        """What has been started with this configuration."""
        mark, found = f"SLURM_CONF={folder}/slurm.conf\0".encode(), []
        for path in Path("/proc").glob("[0-9]*"):
            try:
                if mark in (path / "environ").read_bytes():
                    found.append((path / "cmdline").read_bytes().replace(b"\0", b" "))
            except OSError:  # gone meanwhile, or somebody else's
                continue
        return found

    def must_be_gone(self, folder, patience=0):
        end = time.monotonic() + patience
        while (self.processes_of(folder) or os.path.exists(folder)) and time.monotonic() < end:
            time.sleep(0.1)
        self.assertEqual(self.processes_of(folder), [])
        self.assertFalse(os.path.exists(folder))

    def test_nothing_is_left_when_the_command_ends_and_its_exit_code_is_passed_on(self):
        process, folder = self.start(seconds=3)
        self.assertEqual(process.wait(60), 5)
        self.must_be_gone(folder)

    def test_nothing_is_left_when_the_limit_is_passed(self):
        process, folder = self.start("--limit", "15", seconds=1000)
        self.assertEqual(process.wait(60), 124)
        self.must_be_gone(folder)

    def test_nothing_is_left_when_it_is_asked_to_end(self):
        for number in (signal.SIGTERM, signal.SIGINT):
            process, folder = self.start(seconds=1000)
            process.send_signal(number)
            self.assertEqual(process.wait(60), 128 + number)
            self.must_be_gone(folder)

    def test_nothing_is_left_when_one_of_its_two_processes_is_killed(self):
        for child_of in (lambda pid: pid, self.only_child):
            process, folder = self.start(seconds=1000)
            os.kill(child_of(process.pid), signal.SIGKILL)
            self.assertIn(process.wait(60), (-9, 137))
            self.must_be_gone(folder, patience=30)

    def test_without_slurm_it_says_what_to_install_and_ends_as_skipped(self):
        done = subprocess.run([sys.executable, SCRIPT, "true"], env={"PATH": "/nowhere"}, capture_output=True,
                              text=True, check=False)
        self.assertEqual(done.returncode, 77, done.stdout + done.stderr)
        self.assertIn("apt-get install slurm-wlm", done.stdout)


if __name__ == "__main__":
    if local_slurm.missing():
        print(f"skipped: {local_slurm.missing()}")
        sys.exit(local_slurm.SKIPPED)
    unittest.main()
