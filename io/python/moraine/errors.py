"""What can go wrong, as exceptions; each says what the program would say."""

from typing import NamedTuple, Optional


class Problem(NamedTuple):
    """One thing that is wrong with a scene."""

    key: str  # "particles[0].diameter"; empty for errors of the text as a whole
    value: str  # as written, shortened; empty where it is missing
    message: str  # what is wrong, what was expected, the cure
    line: Optional[int]  # of the text, from 1; None where the scene is made of Python values


class Error(Exception):
    """Base of all errors of Moraine."""


class SceneError(Error, ValueError):
    """The scene cannot be run. `problems` holds every one of them; the text has one a line."""

    def __init__(self, text, problems=()):
        super().__init__(text)
        self.problems = [Problem(*problem) for problem in problems]


class RunError(Error, RuntimeError):
    """The run cannot go on: what happened to which grain, and the likely cure."""


class StorageError(Error, OSError):
    """A file cannot be read or written."""
