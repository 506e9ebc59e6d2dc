"""What the scripts have in common that run the real program: a scene of few grains, the environment of a run that nobody else has
started, what a run says, and patience.

A script finds it beside the other folders of tests:

    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "support"))
"""

import os
import re
import time


def grains_in_a_box(end, *, title="a few grains bounce in a box", step=5e-5, high=(0.1, 0.1, 0.2), stiffness=1000.0,
                    diameter="[0.01, 0.012]", fill="{ count = 120 }", more=""):
    """Text of a scene: grains of glass with friction, thrown into a box; `more` sections follow."""
    return f"""
title = "{title}"
[domain]
low = [0, 0, 0]
high = {list(high)}
[time]
end = {end!r}
{f"step = {step!r}" if step else ""}
gravity = [0.3, 0, -9.81]
[[material]]
name = "glass"
density = 2500.0
[contact]
normal = "linear"
tangential = "spring"
[[contact.pair]]
normal_stiffness = {stiffness!r}
restitution = 0.9
friction = 0.4
[[particles]]
diameter = {diameter}
velocity = [0.2, 0.1, -1.0]
fill = {fill}
[[wall]]
name = "box"
box = {{}}
{more}"""


# Sections for grains_in_a_box() by which grains come and go, and are written.
PASSAGE = """[[inlet]]
name = "top"
number_rate = 200.0
diameter = [0.01, 0.012]
velocity = [0, 0, -0.5]
region = { box = { low = [0.01, 0.01, 0.16], high = [0.09, 0.09, 0.19] } }
[[outlet]]
name = "corner"
box = { low = [0, 0, 0], high = [0.1, 0.05, 0.05] }
[output]
snapshots = 1.0
checkpoints = 0.25
[[probe]]
kind = "mass"
interval = 0.01
"""


def environment_without(*prefixes):
    """This process's, without variables of those names."""
    return {key: value for key, value in os.environ.items() if not key.startswith(prefixes)}


def state_hash(text):
    """The one that a run says at its end; None where it says none."""
    found = re.search(r"^state hash: ([0-9a-f]{32})$", text, re.MULTILINE)
    return found.group(1) if found else None


def wait_until(is_so, what, patience, interval=0.05):
    """Fails where it is not so after `patience` seconds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if is_so():
            return
        time.sleep(interval)
    raise AssertionError(f"waited in vain for {what}")
