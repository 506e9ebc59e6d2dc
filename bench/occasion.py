"""What the scripts of bench share: the program that they run, and what their pages say of where and how they were made."""
import datetime, os, re, shlex, subprocess, sys

root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))


def output_of(*command):
    """Standard output of a command in the project's folder; empty where it cannot be run."""
    try:
        return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=root).stdout.strip()
    except OSError:
        return ""


def moraine_program():
    return os.path.join(os.environ.get("MORAINE_BUILD_DIR", os.path.join(root, "build")), "bin", "moraine")


def machine():
    model = re.search(r"model name\s*:\s*(.*)", open("/proc/cpuinfo").read()) if os.path.exists("/proc/cpuinfo") else None
    return f"{model[1] if model else 'unknown'}, {os.cpu_count()} cores, {os.uname().release}, load {os.getloadavg()[0]:.1f}"


def commit():
    name = output_of("git", "rev-parse", "--short=12", "HEAD") or "not committed"
    return name + (" with changes" if output_of("git", "status", "--porcelain", "--untracked-files=no") else "")


def command():
    """As it was typed, from the project's folder."""
    return shlex.join([os.path.relpath(os.path.abspath(sys.argv[0]), root), *sys.argv[1:]])


def moment():
    return f"{datetime.datetime.now():%Y-%m-%d %H:%M}"


def append(page, title, text):
    """To a page of bench/results, which begins with the title and the script that writes it."""
    path = os.path.join(root, "bench", "results", page)
    is_new = not os.path.exists(path)
    with open(path, "a") as out:
        if is_new:
            out.write(f"# {title}\n\nWritten by `{os.path.relpath(os.path.abspath(sys.argv[0]), root)}`, newest last.\n")
        out.write("\n" + text)


def facts():
    """Lines of a list: machine, date, commit, command."""
    return [f"- machine: {machine()}", f"- commit: {commit()}, {moment()}", f"- command: `{command()}`"]
