"""Types of the module moraine; io/python/README.md is the manual."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from types import TracebackType
from typing import Any, Optional, TypeVar, Union

import numpy as np
import numpy.typing as npt

from .errors import Error as Error
from .errors import Problem as Problem
from .errors import RunError as RunError
from .errors import SceneError as SceneError
from .errors import StorageError as StorageError

Path = Union[str, os.PathLike[str]]
Changes = Union[Mapping[str, Any], Iterable[str], None]
Reals = npt.NDArray[np.float64]
Callback = TypeVar("Callback", bound=Callable[["Simulation"], Any])

__version__: str

def rank() -> int: ...
def size() -> int: ...
def read(path: Path) -> Snapshot: ...
def snapshots(run: Path) -> list[os.PathLike[str]]: ...

class Scene:
    text: str
    warnings: list[str]
    title: str
    end: float
    def __init__(self, source: Union[str, Mapping[str, Any], None] = None, *, changes: Changes = None, base: Path = ".",
                 **sections: Any) -> None: ...
    @classmethod
    def from_file(cls, path: Path, changes: Changes = None) -> Scene: ...

class Snapshot:
    step: int
    time: float
    time_step: float
    domain: tuple[tuple[float, float, float], tuple[float, float, float]]
    periodic: tuple[bool, bool, bool]
    state_hash: str
    fields: dict[str, npt.NDArray[Any]]
    gas: dict[str, Reals]
    units: dict[str, str]
    def __getitem__(self, name: str) -> npt.NDArray[Any]: ...
    def __len__(self) -> int: ...

class Edit:
    position: Reals
    velocity: Reals
    angular_velocity: Reals
    def __enter__(self) -> Edit: ...
    def __exit__(self, kind: Optional[type[BaseException]], error: Optional[BaseException],
                 trace: Optional[TracebackType]) -> None: ...

class Simulation:
    time: float
    time_step: float
    step_number: int
    n_steps: int
    n_grains: int
    n_born: int
    n_left: int
    n_rebuilds: int
    threads: int
    warnings: list[str]
    probes: list[str]
    fields: dict[str, tuple[str, tuple[int, ...]]]
    position: Reals
    radius: Reals
    velocity: Reals
    inverse_mass: Reals
    angular_velocity: Reals
    inverse_inertia: Reals
    gid: npt.NDArray[np.uint64]
    material: npt.NDArray[np.uint16]
    dissipated: Reals
    force: Reals
    torque: Reals
    gas_acceleration: Reals
    def __init__(self, scene: Scene, *, threads: Optional[int] = None, out: Optional[Path] = None,
                 restart: Optional[Path] = None) -> None: ...
    @classmethod
    def from_checkpoint(cls, path: Path, *, threads: Optional[int] = None, out: Optional[Path] = None) -> Simulation: ...
    def step(self, n: int = 1) -> None: ...
    def run(self, until: Optional[float] = None) -> None: ...
    def stop(self) -> None: ...
    def every(self, n: int, function: Optional[Callback] = None) -> Any: ...
    def forget(self, function: Callable[[Simulation], Any]) -> None: ...
    def set_body_force(self, function: Optional[Callable[[Simulation], npt.ArrayLike]]) -> None: ...
    def set_wall_motion(self, wall: str, function: Callable[[float], npt.ArrayLike], every: int = 1) -> None: ...
    def array(self, name: str) -> npt.NDArray[Any]: ...
    def edit(self) -> Edit: ...
    def gather(self, name: str) -> Optional[npt.NDArray[Any]]: ...
    def snapshot(self, fields: Sequence[str] = ()) -> Snapshot: ...
    def probe(self, name: str) -> dict[str, float]: ...
    def energy(self) -> dict[str, float]: ...
    def state_hash(self) -> str: ...
    def write_snapshot(self, path: Path) -> None: ...
    def write_checkpoint(self, path: Path) -> None: ...
