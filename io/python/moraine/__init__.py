"""Moraine from Python: scenes, runs, and the state of the grains as numpy arrays.

    import moraine

    run = moraine.Simulation(moraine.Scene.from_file("examples/hopper/scene.toml"))
    while run.time < 2.0:
        run.step(1000)
        print(run.time, run.position[:, 2].mean())

io/python/README.md is the manual. Started by mpirun or srun, every rank runs the script, has its own grains, and makes the same calls.
"""

import atexit as _atexit
import os as _os
import sys as _sys

# Threads that wait spin briefly and then sleep, as in the program; the OpenMP runtime reads this when it is loaded.
if "GOMP_SPINCOUNT" not in _os.environ and "OMP_WAIT_POLICY" not in _os.environ:
    _os.environ["GOMP_SPINCOUNT"] = "10000"

from . import _engine
from . import scene as _text
from ._engine import rank, size, snapshots, version as _version
from .errors import Error, Problem, RunError, SceneError, StorageError

__version__ = _version()
__all__ = ["Error", "Problem", "RunError", "Scene", "SceneError", "Simulation", "Snapshot", "StorageError", "rank", "read", "size",
           "snapshots"]


class Scene(_engine.Scene):
    """A scene, checked: Scene(TEXT), Scene({...}) or Scene(domain={...}, time={...}, ...), with the keys of scene files.

    `changes` are settings as of --set: {"time.end": 2.0}. Relative file names start at `base` (default: the working directory).
    Raises SceneError with every problem. All ranks.
    """

    def __init__(self, source=None, *, changes=None, base=".", **sections):
        if isinstance(source, str):
            if sections:
                raise TypeError("a scene is a text or made of sections, not both")
            super().__init__(source, "scene", _text.overrides(changes), str(base), True)
        else:
            values = {**(source or {}), **sections}
            super().__init__(_text.document(values), "scene", _text.overrides(changes), str(base), False)

    @classmethod
    def from_file(cls, path, changes=None):
        """The scene in a file; file names in it start at its folder."""
        scene = cls.__new__(cls)
        _engine.Scene.__init__(scene, _os.fspath(path), _text.overrides(changes))
        return scene


class Snapshot:
    """Grains, and gas where there is some, at one moment: snapshot["position"] is an array in order of gid.

    `gas` has the quantities of the gas as arrays (z, y, x), `units` the units of both.
    """

    def __init__(self, image):
        self.step, self.time, self.time_step = image["step"], image["time"], image["time_step"]
        self.domain, self.periodic, self.state_hash = image["domain"], image["periodic"], image["hash"]
        self.fields, self.gas, self.units = image["fields"], image["gas"], image["units"]

    def __getitem__(self, name):
        try:
            return self.fields[name]
        except KeyError:
            raise KeyError(f"the snapshot has no field {name!r}; it has {', '.join(self.fields)}") from None

    def __len__(self):
        return len(self.fields["gid"])


def read(path):
    """The Snapshot in a file (a snapshot or a checkpoint)."""
    return Snapshot(_engine.read_image(_os.fspath(path)))


class _Edit:
    """The fields that may be changed, while they may be: see Simulation.edit()."""

    def __init__(self, run):
        self._run, self._arrays = run, {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for array in self._arrays.values():
            array.flags.writeable = False
        self._arrays, run, self._run = {}, self._run, None
        run._grains_changed()

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        if self._run is None:
            raise RuntimeError("fields can be changed inside of `with run.edit() as state:` only")
        if name not in self._arrays:
            self._arrays[name] = self._run._writable(name)
        return self._arrays[name]


class Simulation(_engine.Simulation):
    """A run of a scene: Simulation(scene). Fields of the grains are its attributes (`position`, `velocity`, ...; see `fields`).

    threads   of this rank; default: what the scene says, or all cores that it may use
    out       a directory that gets what the scene's [output] and [[probe]] ask for, as with `moraine run --out`
    restart   a checkpoint to go on from
    """

    def __init__(self, scene, *, threads=None, out=None, restart=None):
        as_text = lambda path: None if path is None else _os.fspath(path)
        super().__init__(scene, threads, as_text(out), as_text(restart))

    @classmethod
    def from_checkpoint(cls, path, *, threads=None, out=None):
        """Goes on from a checkpoint with the scene that it holds."""
        scene = Scene(_engine.scene_of_checkpoint(_os.fspath(path)))
        return cls(scene, threads=threads, out=out, restart=path)

    def every(self, n, function=None):
        """Calls function(run) after each step whose number is a multiple of n. Also as a decorator: @run.every(100)."""
        if function is None:
            return lambda decorated: self.every(n, decorated)
        self._add_callback(n, function)
        return function

    def edit(self):
        """`with run.edit() as state: state.velocity[:, 2] += 0.1` changes position, velocity or angular_velocity in place. All ranks."""
        return _Edit(self)

    def snapshot(self, fields=()):
        """A Snapshot of now, with the given fields only (default: all). Each of several ranks has consecutive rows. All ranks."""
        return Snapshot(self._snapshot(list(fields)))


def _end_all_ranks(kind, error, trace):
    """An error on one rank ends the job: the others wait for it somewhere."""
    print(f"rank {rank()}:", file=_sys.stderr)
    _sys.__excepthook__(kind, error, trace)
    _sys.stdout.flush()
    _sys.stderr.flush()
    _engine.abort(1)


_atexit.register(_engine.close)
if size() > 1:
    _sys.excepthook = _end_all_ranks
