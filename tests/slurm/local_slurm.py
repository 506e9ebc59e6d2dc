"""A Slurm of two nodes on this machine, for as long as a command runs.

usage: local_slurm.py [--limit SECONDS] COMMAND [ARGUMENT...]

Starts munged, slurmctld and two slurmd with keys, sockets, ports and files of their own, waits until both nodes are
idle, and runs the command with SLURM_CONF set. Whatever happens to the command, to this script, or to the one who has
started it, the daemons and all that they have started end with it, and the files are removed. Ends with the exit code
of the command; 77 where Slurm is not installed; 124 where the limit was passed.

For a look at it by hand: local_slurm.py --limit 3600 bash
Needs: slurm-wlm and munge (Debian), root or a user of one's own; no configuration, no network.
"""

import ctypes
import os
import pwd
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SKIPPED, TIMED_OUT = 77, 124
PROGRAMS = {"munged": "munge", "slurmctld": "slurm-wlm", "slurmd": "slurm-wlm", "sbatch": "slurm-wlm",
            "srun": "slurm-wlm"}
SUPERUSER_PATH = os.environ.get("PATH", "") + ":/usr/sbin:/sbin"
PR_SET_PDEATHSIG, PR_SET_CHILD_SUBREAPER = 1, 36
LIBC = ctypes.CDLL(None, use_errno=True)


def missing():
    """What is not there, with the package that holds it; empty where all is there."""
    absent = [name for name in PROGRAMS if shutil.which(name, path=SUPERUSER_PATH) is None]
    if absent:
        packages = " ".join(sorted({PROGRAMS[name] for name in absent}))
        return f"Slurm is not installed: {', '.join(absent)} not found (Debian: apt-get install {packages})"
    try:
        socket.getaddrinfo("127.0.0.1", None, family=socket.AF_INET, flags=socket.AI_ADDRCONFIG)
    except socket.gaierror:
        return "this machine has no network address but that of the loopback interface, and Slurm's daemons ask for one"
    return ""


def binding(host):
    """Slurm binds to all addresses, or to that of the host's name: which may be a loopback address, or not."""
    try:
        is_loopback = socket.gethostbyname(host).startswith("127.")
    except OSError:
        is_loopback = False
    return "CommunicationParameters=NoInAddrAny,NoCtldInAddrAny" if is_loopback else ""


def free_ports(n):
    held = [socket.socket() for _ in range(n)]
    for one in held:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in held]
    for one in held:
        one.close()
    return ports


def descendants(root):
    """All processes below this one, however deep."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            pid, rest = stat.read_text().split(" ", 1)
        except OSError:  # gone meanwhile
            continue
        parents[int(pid)] = int(rest.rsplit(")", 1)[1].split()[1])
    found, fresh = set(), {root}
    while fresh:
        fresh = {pid for pid, parent in parents.items() if parent in fresh} - found
        found |= fresh
    return found


def end_all_below():
    """Ends what this process and its children have started. Orphans among them become its children: none gets away."""
    for patience, number in ((5, signal.SIGTERM), (10, signal.SIGKILL)):
        for pid in descendants(os.getpid()):
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                pass
        end = time.monotonic() + patience
        while time.monotonic() < end and descendants(os.getpid()):
            try:
                while os.waitpid(-1, os.WNOHANG)[0] > 0:
                    pass
            except ChildProcessError:
                pass
            if number == signal.SIGKILL:  # what was started meanwhile
                for pid in descendants(os.getpid()):
                    try:
                        os.kill(pid, number)
                    except ProcessLookupError:
                        pass
            time.sleep(0.05)


class LocalSlurm:
    """The daemons, from start() to stop()."""

    def __init__(self, scratch):
        self.scratch = scratch
        self.environment = dict(os.environ, SLURM_CONF=str(self.scratch / "slurm.conf"))

    def start(self):
        for folder in ("run", "log", "state", "spool/n1", "spool/n2", "tmp/n1", "tmp/n2"):
            (self.scratch / folder).mkdir(parents=True)
        self.write_configuration()
        key = self.scratch / "munge.key"
        key.write_bytes(os.urandom(128))
        key.chmod(0o400)
        run = self.scratch / "run"
        self.daemon("munged", "munged", "--foreground", "--force", f"--key-file={key}", f"--socket={run}/munge.sock",
                    f"--pid-file={run}/munged.pid", f"--log-file={self.scratch}/log/munged.log",
                    f"--seed-file={self.scratch}/state/munged.seed")
        self.wait_until(lambda: (run / "munge.sock").exists(), "munged")
        self.daemon("slurmctld", "slurmctld", "-c", "-D")
        for node in ("n1", "n2"):
            self.daemon(f"slurmd.{node}", "slurmd", "-N", node, "-D")
        self.wait_until(lambda: self.states() == ["idle", "idle"], "the two nodes")

    def write_configuration(self):
        controller, first, second = free_ports(3)
        with open("/proc/meminfo", encoding="ascii") as file:
            memory = int(file.readline().split()[1]) // 1024
        text = (Path(__file__).parent / "slurm.conf.in").read_text(encoding="ascii")
        host = socket.gethostname().split(".")[0]
        for name, value in {"HOST": host, "BINDING": binding(host), "USER": pwd.getpwuid(os.getuid()).pw_name,
                            "SCRATCH": self.scratch, "CONTROLLER_PORT": controller, "PORT_1": first, "PORT_2": second,
                            "MEMORY": memory // 2}.items():
            text = text.replace(f"@{name}@", str(value))
        (self.scratch / "slurm.conf").write_text(text)

    def daemon(self, log_name, program, *options):
        """In the foreground, so that it stays a child; what it says goes to a log."""
        with open(self.scratch / "log" / f"{log_name}.out", "w", encoding="utf-8") as log:
            subprocess.Popen([shutil.which(program, path=SUPERUSER_PATH), *options], stdin=subprocess.DEVNULL,
                             stdout=log, stderr=log, env=self.environment, start_new_session=True,
                             preexec_fn=lambda: LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM))

    def states(self):
        try:
            done = subprocess.run(["sinfo", "--Node", "--noheader", "--format=%T"], capture_output=True, text=True,
                                  env=self.environment, timeout=20, check=False)
        except subprocess.TimeoutExpired:
            return []
        return done.stdout.split()

    def wait_until(self, is_so, what):
        end = time.monotonic() + 60
        while time.monotonic() < end:
            if is_so():
                return
            time.sleep(0.1)
        raise RuntimeError(f"waited a minute in vain for {what}\n{self.logs()}")

    def logs(self):
        text = ""
        for path in sorted((self.scratch / "log").glob("*.out")):
            text += f"--- {path.name}\n" + "".join(path.read_text(errors="replace").splitlines(True)[-20:])
        return text


def ask_to_end(number, _frame):
    signal.signal(number, signal.SIG_IGN)
    raise SystemExit(128 + number)


def clean_up(scratch):
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # it ends already; to be told again must not keep it from cleaning up
    end_all_below()
    shutil.rmtree(scratch, ignore_errors=True)


def carry_out(words, limit, slurm):
    """Runs the command beside the daemons; its exit code."""
    slurm.start()
    command = subprocess.Popen(words, env=slurm.environment)
    end = time.monotonic() + limit
    while time.monotonic() < end:
        pid, status = os.waitpid(-1, os.WNOHANG)  # orphans, too: Slurm waits until they are gone
        if pid == command.pid:
            command.returncode = os.waitstatus_to_exitcode(status)
            return command.returncode if command.returncode >= 0 else 128 - command.returncode
        if pid == 0:
            time.sleep(0.02)
    print(f"local_slurm: {words[0]} has taken more than {limit:g} s\n{slurm.logs()}", file=sys.stderr)
    return TIMED_OUT


def as_inner_process(words, limit, scratch, outer):
    """The parent of all that is started; ends it when the work is done, and when the outer process is no more."""
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, ask_to_end)
    LIBC.prctl(PR_SET_CHILD_SUBREAPER, 1)
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != outer:  # gone already
        return 1
    try:
        return carry_out(words, limit, LocalSlurm(scratch))
    except RuntimeError as error:
        print(f"local_slurm: {error}", file=sys.stderr)
        return 1
    finally:
        clean_up(scratch)


def supervise(words, limit):
    """Two processes, so that there is always one to clean up, even when somebody kills the other."""
    LIBC.prctl(PR_SET_CHILD_SUBREAPER, 1)
    scratch = Path(tempfile.mkdtemp(prefix="moraine-slurm-", dir="/tmp"))  # a socket's path must be short
    outer = os.getpid()
    inner = os.fork()
    if inner == 0:
        code = 1
        try:
            code = as_inner_process(words, limit, scratch, outer)
        except SystemExit as asked:
            code = asked.code
        finally:
            sys.stdout.flush()
            os._exit(code)
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, lambda asked, _frame: os.kill(inner, asked))
    code = os.waitstatus_to_exitcode(os.waitpid(inner, 0)[1])
    clean_up(scratch)
    return code if code >= 0 else 128 - code


def main(words):
    limit = 600.0
    if words[:1] == ["--limit"] and len(words) > 1:
        limit, words = float(words[1]), words[2:]
    if not words:
        sys.exit(__doc__)
    if missing():
        print(f"skipped: {missing()}")
        return SKIPPED
    return supervise(words, limit)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
