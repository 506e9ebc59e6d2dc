#!/usr/bin/python3
"""Does to runs what machines and people do to them, at random moments, and sees that nothing is lost: after each fault the
run goes on from its newest checkpoint and ends with the hash of an undisturbed one, or it has refused with a message
that names what is wrong and its checkpoints are as they were.

usage: chaos_test.py PROGRAM [--faults N] [--seed S] [--only KIND,...] [--table FILE]

The same seed gives the same faults; their moments are counted in checkpoints, so that a busy machine sees them too.
Kinds that need to mount a small disk are left out unless this is root, and a leaping clock where there is no libfaketime.
Needs the standard library and Open MPI's mpirun.
"""

import argparse
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
from program import environment_without, grains_in_a_box, state_hash  # noqa: E402

PATIENCE = 300  # [s], for busy machines, until a job must have ended after it was hurt, or have come to its next checkpoint
LAYOUTS = ["1x1", "2x1", "1x2", "3x1", "2x2"]
N_STEPS = 600
BED = grains_in_a_box(0.03, high=(0.06, 0.06, 0.12), diameter="[0.008, 0.01]", more="""[output]
snapshots = 0.005
checkpoints = 0.001
""")
GAS = """
[gas]
cells = [3, 3, 6]
density = 1.2
viscosity = 1.8e-5
drag = "gidaspow"
step = 2e-4
[[gas.boundary]]
face = "z-low"
type = "velocity"
velocity = [0, 0, 1.0]
[[gas.boundary]]
face = "z-high"
type = "pressure"
[[probe]]
kind = "pressure_drop"
interval = 0.001
"""
SCENES = {"bed": BED, "gas": BED + GAS}
ENVIRONMENT = environment_without("OMPI_", "PMIX_")
FAKE_CLOCK = next(map(str, Path("/usr/lib").glob("*/faketime/libfaketime.so.1")), None)


class Lost(Exception):
    """What must not happen: the text says what has."""


def session_members(session):
    """Processes of a session that have not ended: {pid: (name, parent)}."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            text = stat.read_text()
        except OSError:  # gone meanwhile
            continue
        name, rest = text.split("(", 1)[1].rsplit(")", 1)
        state, parent, _, its_session = rest.split()[:4]
        if int(its_session) == session and state != "Z":
            found[int(stat.parent.name)] = (name, int(parent))
    return found


def checkpoints(run):
    """Steps of the complete checkpoints, newest first."""
    try:
        names = os.listdir(run / "checkpoints")
    except OSError:
        return []
    return sorted((int(m.group(1)) for m in (re.fullmatch(r"checkpoint_(\d+)\.h5", name) for name in names) if m),
                  reverse=True)


class Job:
    """A run in a session of its own."""

    def __init__(self, words, limit=None, environment=ENVIRONMENT):
        self.out = tempfile.TemporaryFile("w+", errors="replace")
        self.process = subprocess.Popen([str(word) for word in words], stdin=subprocess.DEVNULL, stdout=self.out,
                                        stderr=subprocess.STDOUT, env=environment, start_new_session=True,
                                        preexec_fn=limit)

    def said(self):
        self.out.seek(0)
        return self.out.read()

    def members(self):
        return session_members(self.process.pid)

    def ranks(self):
        members = self.members()
        parents = {pid for pid, (name, _) in members.items() if name.startswith("mpirun")}
        ranks = [pid for pid, (_, parent) in members.items() if parent in parents]
        return sorted(ranks) or [self.process.pid]  # alone, or before mpirun has started them

    def wait_for(self, run, step):
        """Until the run has come so far, or has ended."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and self.process.poll() is None:
            if step <= 0 or (checkpoints(run) or [0])[0] >= step:
                return
            time.sleep(0.002)

    def end(self):
        """The exit code, once all of its processes have gone."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and (self.process.poll() is None or self.members()):
            time.sleep(0.01)
        left = self.members()
        if self.process.poll() is not None and not left:
            return self.process.returncode
        for pid in left:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:  # at last
                pass
        self.process.wait()
        raise Lost(f"hung: {sorted(left.values())} had not ended after {PATIENCE} s\n{self.said()}")


class Chaos:
    def __init__(self, program, folder, seed):
        self.program, self.folder, self.seed = program, folder, seed
        self.expected = {}

    def reference(self, scene):
        """Hash and table of hashes of the undisturbed run."""
        if scene not in self.expected:
            path = self.folder / f"{scene}.toml"
            path.write_text(SCENES[scene])
            run = self.folder / f"reference-{scene}"
            job = Job([self.program, "run", path, "--out", run, "--layout", "1x1"])
            if job.end() != 0:
                sys.exit("the undisturbed run failed:\n" + job.said())
            self.expected[scene] = (state_hash(job.said()), (run / "hashes.csv").read_text())
        return self.expected[scene]

    def command(self, case, layout=None, *more):
        words = [self.program, "run", self.folder / f"{case.scene}.toml", "--out", case.run, "--layout",
                 layout or case.layout, "--restart", "auto"]
        if case.is_distributed:
            words += ["--set", "output.distributed=true"]
        return words + list(more)

    def start(self, case, layout=None, limit=None, more=(), environment=ENVIRONMENT):
        return Job(self.command(case, layout, *more), limit, environment)

    def go_on(self, case, newest, may_go_back=False):
        """The run must go on from its newest checkpoint and end as if nothing had happened."""
        job = self.start(case, case.choose.choice(LAYOUTS))
        code, said = job.end(), job.said()
        if code != 0:
            raise Lost(f"could not go on, exit code {code}\n{said}")
        self.must_be_as_undisturbed(case, said)
        found = re.search(r"^going on from .*: step (\d+)", said, re.MULTILINE)
        step = int(found.group(1)) if found else 0
        if step < newest and not may_go_back:
            raise Lost(f"went on from step {step}, though there was a checkpoint of step {newest}\n{said}")
        return said

    def must_be_as_undisturbed(self, case, said):
        state, hashes = self.reference(case.scene)
        if state_hash(said) != state:
            raise Lost(f"ended with the hash {state_hash(said)}, the undisturbed run with {state}\n{said}")
        if (case.run / "hashes.csv").read_text() != hashes:
            raise Lost("hashes.csv differs from that of the undisturbed run")
        left = [str(path) for path in case.run.rglob("*.tmp")]
        if left:
            raise Lost(f"left {left} behind")

    @staticmethod
    def must_be_named(code, said, words):
        """A run that ends early says why. Before the program begins it is the system's loader that does, with a code of its own."""
        is_refused = code in (1, 2) or code == 127 and "error while loading shared libraries" in said
        if not is_refused or not re.search(words, said):
            raise Lost(f"ended with exit code {code} without naming its cause ({words})\n{said}")

    # ---- faults: each returns how it ended

    def kill(self, case, times=1):
        for _ in range(times):
            job = self.start(case, case.choose.choice(LAYOUTS))
            case.reach(job)
            victims = sorted(job.members()) if case.choose.random() < 0.4 else job.ranks()
            case.strike(victims, signal.SIGKILL)
            code = job.end()
            newest = (checkpoints(case.run) or [0])[0]
            if code == 0:
                self.must_be_as_undisturbed(case, job.said())
        self.go_on(case, newest)
        return "went on"

    def kill_again(self, case):
        return self.kill(case, 3)

    def stop_and_continue(self, case):
        job = self.start(case)
        case.reach(job)
        victims = job.ranks()
        victim = case.choose.choice(victims)
        for what, pause in ((signal.SIGSTOP, case.choose.uniform(0.02, 0.4)), (signal.SIGCONT, 0.0)):
            case.strike([victim], what)
            time.sleep(pause)
        if job.end() != 0:
            raise Lost("did not go on after SIGCONT\n" + job.said())
        self.must_be_as_undisturbed(case, job.said())
        return "ended well"

    def terminate(self, case):
        job = self.start(case)
        case.reach(job)
        victim = case.choose.choice([job.process.pid] + job.ranks())
        case.strike([victim], case.choose.choice([signal.SIGTERM, signal.SIGINT]))
        code = job.end()
        newest = (checkpoints(case.run) or [0])[0]
        if code == 0:
            self.must_be_as_undisturbed(case, job.said())
            return "ended well"
        self.go_on(case, newest)
        return "went on"

    def full_disk(self, case):
        kilobytes = case.choose.randrange(120, 600)
        with Disk(case.run.parent, f"size={kilobytes}k"):
            job = self.start(case)
            code, newest = job.end(), (checkpoints(case.run) or [0])[0]
            if code == 0:
                self.must_be_as_undisturbed(case, job.said())
                return "ended well"
            self.must_be_named(code, job.said(), r"error: .*: no space left on the disk")
            Disk.change(case.run.parent, "size=100m")
            self.go_on(case, newest)
        return "named"

    def read_only(self, case):
        with Disk(case.run.parent, "size=50m"):
            newest = self.run_until(case)
            Disk.change(case.run.parent, "ro")
            job = self.start(case)
            self.must_be_named(job.end(), job.said(), r"error: .*read-only")
            Disk.change(case.run.parent, "rw")
            self.go_on(case, newest)
        return "named"

    def vanished(self, case):
        job = self.start(case)
        case.reach(job)
        elsewhere = case.run.with_name("elsewhere")
        try:
            case.run.rename(elsewhere)
        except OSError:  # not there yet
            job.end()
            self.go_on(case, 0)
            return "ended well"
        code = job.end()
        if case.run.exists():
            raise Lost(f"made its directory anew, without what was in it: {os.listdir(case.run)}\n{job.said()}")
        elsewhere.rename(case.run)
        if code != 0:
            self.must_be_named(code, job.said(), r"error: .*no such file or directory")
        self.go_on(case, (checkpoints(case.run) or [0])[0])
        return "named" if code != 0 else "ended well"

    def limited(self, case, kind, least, most, words):
        """A resource limit; small ones of files and memory with one rank only, as the MPI library does not bear them."""
        value = case.choose.randrange(least, most)
        job = self.start(case, limit=lambda: resource.setrlimit(kind, (value, value)))
        code, newest = job.end(), (checkpoints(case.run) or [0])[0]
        if code == 0:
            self.must_be_as_undisturbed(case, job.said())
            return "ended well"
        self.must_be_named(code, job.said(), words)
        self.go_on(case, newest)
        return "named"

    def few_files(self, case):
        return self.limited(case, resource.RLIMIT_NOFILE, 5, 60, r"(?i)too many open files|open files are allowed here")

    def short_files(self, case):
        case.layout = case.choose.choice(["1x1", "1x2"])
        return self.limited(case, resource.RLIMIT_FSIZE, 1 << 10, 200 << 10, r"error: .*larger than a limit")

    def little_memory(self, case):
        case.layout = case.choose.choice(["1x1", "1x2"])
        return self.limited(case, resource.RLIMIT_AS, 40 << 20, 400 << 20,
                            r"(?i)of memory here|not enough memory|cannot allocate memory|libgomp: |failed to map segment")

    def flipped_bit(self, case):
        newest = self.run_until(case)
        steps = checkpoints(case.run)
        is_all = case.choose.random() < 0.25
        for step in steps if is_all else steps[:1]:
            self.damage(case, step)
        before = {path: path.read_bytes() for path in case.run.rglob("*") if path.is_file()}
        if is_all:
            job = self.start(case)
            self.must_be_named(job.end(), job.said(), r"holds no sound checkpoint")
            if before != {path: path.read_bytes() for path in case.run.rglob("*") if path.is_file()}:
                raise Lost("a refused run has changed files")
            return "named"
        said = self.go_on(case, newest, may_go_back=True)
        if "taking the one before it" not in said or f": step {steps[1]}," not in said:
            raise Lost(f"a damaged checkpoint was not named, or another than step {steps[1]} taken\n{said}")
        return "went on"

    def jumping_clock(self, case):
        """The time of day leaps, to and fro, as when a machine is set right; all processes of the run see it."""
        offset = case.run.parent / "clock"
        leap = lambda: offset.write_text(f"{case.choose.uniform(-1e9, 1e9):+.0f}")
        leap()
        job = self.start(case, environment=ENVIRONMENT | {
            "LD_PRELOAD": FAKE_CLOCK, "FAKETIME_TIMESTAMP_FILE": str(offset), "FAKETIME_NO_CACHE": "1",
            "FAKETIME_DONT_FAKE_MONOTONIC": "1"})
        for _ in range(case.choose.randrange(1, 4)):
            case.reach(job)
            leap()
        code, newest = job.end(), (checkpoints(case.run) or [0])[0]
        if code != 0:
            raise Lost(f"ended with exit code {code} as the clock leapt\n{job.said()}")
        self.must_be_as_undisturbed(case, job.said())
        if newest < N_STEPS:
            raise Lost(f"its newest checkpoint is of step {newest}")
        return "ended well"

    def damage(self, case, step):
        """Flips a bit of a file of a checkpoint, cuts it, or takes it away."""
        pattern = f"checkpoint_{step:012d}*.h5"
        path = case.choose.choice(sorted((case.run / "checkpoints").glob(pattern)))
        data = bytearray(path.read_bytes())
        way = case.choose.random()
        if way < 0.8:
            bit = case.choose.randrange(8 * len(data))
            data[bit // 8] ^= 1 << bit % 8
            path.write_bytes(data)
        elif way < 0.9 or ".rank-" not in path.name:
            path.write_bytes(data[:case.choose.randrange(len(data))])
        else:
            path.unlink()

    def run_until(self, case):
        """A run that was ended, with two checkpoints at least; the step of the newest."""
        job = self.start(case, more=["--until", f"{case.choose.uniform(0.1, 0.9) * 0.03:.4g}"])
        if job.end() != 0:
            raise Lost("could not be made\n" + job.said())
        return checkpoints(case.run)[0]

    KINDS = {
        "kill -9 of a rank, mpirun or the launcher": kill,
        "kill -9, and again in the restarts": kill_again,
        "SIGSTOP, then SIGCONT": stop_and_continue,
        "SIGTERM or SIGINT": terminate,
        "full disk": full_disk,
        "read-only disk": read_only,
        "directory moved away": vanished,
        "limit on open files": few_files,
        "limit on the size of files": short_files,
        "limit on memory": little_memory,
        "bit flipped, file cut or gone": flipped_bit,
        "clock that leaps": jumping_clock,
    }
    NEED_ROOT = ("full disk", "read-only disk")


class Disk:
    """A small disk in a place."""

    def __init__(self, place, options):
        self.place = place
        subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", place], check=True)

    @staticmethod
    def change(place, option):
        subprocess.run(["mount", "-o", "remount," + option, place], check=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        subprocess.run(["umount", "-l", self.place], check=False)


class Case:
    """What one fault is done to; all of it follows from the seed and the number."""

    def __init__(self, chaos, kind, number):
        self.choose = random.Random(f"{chaos.seed} {number}")
        self.kind = kind
        self.scene = self.choose.choice(sorted(SCENES))
        self.layout = self.choose.choice(LAYOUTS)
        self.is_distributed = self.choose.random() < 0.3
        place = chaos.folder / f"fault-{number}"
        place.mkdir()
        self.run = place / "run"
        chaos.reference(self.scene)

    def text(self):
        return f"{self.kind}; {self.scene}, {self.layout}{', distributed' if self.is_distributed else ''}"

    def reach(self, job):
        """Waits for the moment: one in ten comes while the ranks start."""
        moment = self.choose.uniform(-0.1, 1.0)
        if moment < 0:
            time.sleep(self.choose.uniform(0.0, 0.4))
        else:
            job.wait_for(self.run, moment * N_STEPS)
            time.sleep(self.choose.uniform(0.0, 0.02))

    def strike(self, victims, what):
        try:
            os.kill(self.choose.choice(victims), what)
        except (ProcessLookupError, IndexError):  # it has ended
            pass


def try_fault(chaos, kind, number):
    """How it ended, and what was lost, or None."""
    case = Case(chaos, kind, number)
    try:
        return Chaos.KINDS[kind](chaos, case), None
    except Lost as loss:
        return "lost", f"fault {number} ({case.text()}): {loss}"
    finally:
        shutil.rmtree(case.run.parent, ignore_errors=True)


def table_of(counts, seed, seconds):
    ends = ("went on", "named", "ended well", "lost")
    rows = ["| fault | tried | went on from its newest sound checkpoint | refused by name, went on later | not hurt | lost |",
            "|---|---|---|---|---|---|"]
    total = dict.fromkeys(ends, 0)
    for kind, found in counts.items():
        rows.append(f"| {kind} | {sum(found.values())} | " + " | ".join(str(found[end]) for end in ends) + " |")
        for end in ends:
            total[end] += found[end]
    rows.append(f"| all | {sum(total.values())} | " + " | ".join(str(total[end]) for end in ends) + " |")
    return "\n".join(rows) + f"\n\nSeed {seed}, {seconds:.0f} s.\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("program", type=Path)
    parser.add_argument("--faults", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first fault, to repeat one")
    parser.add_argument("--only", default="", help="words of the kinds wanted, separated by commas")
    parser.add_argument("--table", type=Path)
    given = parser.parse_args()
    kinds = [kind for kind in Chaos.KINDS if (os.geteuid() == 0 or kind not in Chaos.NEED_ROOT)
             and (FAKE_CLOCK or kind != "clock that leaps")]
    is_wanted = lambda kind: not given.only or any(word in kind for word in given.only.split(","))
    counts, losses, start = {}, [], time.monotonic()
    folder = Path(tempfile.mkdtemp(prefix="moraine-chaos-"))
    try:
        chaos = Chaos(given.program.resolve(), folder, given.seed)
        for number in range(given.first, given.first + given.faults):
            kind = kinds[number % len(kinds)]
            if not is_wanted(kind):
                continue
            end, loss = try_fault(chaos, kind, number)
            counts.setdefault(kind, dict.fromkeys(("went on", "named", "ended well", "lost"), 0))[end] += 1
            if loss:
                losses.append(loss)
                print(loss, flush=True)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    text = table_of(counts, given.seed, time.monotonic() - start)
    print(text)
    if given.table:
        given.table.write_text(text)
    n = sum(sum(found.values()) for found in counts.values())
    print(f"faults tried: {n}, survived: {n - len(losses)}, lost: {len(losses)}")
    return 1 if losses or n == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
