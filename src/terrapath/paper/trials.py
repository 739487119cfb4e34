"""Trials: runs whose result depends on their settings alone, and the files of results."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path
from types import UnionType
from typing import Any, ClassVar, Generic, TypeVar, get_args, get_origin, get_type_hints

from .._support.files import written_whole
from ..problem import Problem, scenes

Result = TypeVar("Result")


def canonical(record: object) -> str:
    """The record as JSON; the same content always gives the same text."""
    return json.dumps(record, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest(record: object) -> str:
    """A hash of a record's content, 64 hexadecimal digits; the same in every process."""
    return hashlib.sha256(canonical(record).encode()).hexdigest()


def rebuilt(kind: Any, record: Any) -> Any:
    """The object again, from the JSON of its ``dataclasses.asdict``.

    kind : the object's class, a dataclass. Its fields are numbers, texts, dataclasses, tuples of
    one of these types, or one of these or None.
    """
    if record is None:
        return None
    if get_origin(kind) is UnionType:
        kind = next(choice for choice in get_args(kind) if choice is not type(None))
    if get_origin(kind) is tuple:
        return tuple(rebuilt(get_args(kind)[0], item) for item in record)
    if not dataclasses.is_dataclass(kind):
        return record
    hints = get_type_hints(kind)
    fields = {field.name: record[field.name] for field in dataclasses.fields(kind)}
    made: Any = kind
    return made(**{name: rebuilt(hints[name], value) for name, value in fields.items()})


@cache
def _scene_settings(name: str) -> dict[str, object]:
    """All numbers that define a scene, so that results of a changed scene are not used."""
    problem = scenes.load(name)
    data = {field: array.tolist() for field, array in problem.surface.data._asdict().items()}
    return {
        "name": name,
        "surface": data,
        "start": list(problem.start),
        "goal": list(problem.goal),
        "bounds": list(problem.bounds),
    }


@dataclass(frozen=True)
class Trial(ABC, Generic[Result]):
    """One planner on one scene: everything that the result depends on.

    scene : the scene's name. planner : a dataclass with a ``name``. The result is a dataclass; a
    subclass gives its type in ``Trial[...]``.
    """

    scene: str
    planner: Any
    _kind: ClassVar[Any]  # of results

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        (cls._kind,) = get_args(cls.__orig_bases__[0])  # type: ignore[attr-defined]

    @cached_property
    def settings(self) -> dict[str, Any]:
        """The scene and all options of the planner, defaults and seed included."""
        return {
            "scene": _scene_settings(self.scene),
            "planner": self.planner.name,
            "options": dataclasses.asdict(self.planner),
        }

    @property
    def problem(self) -> Problem:
        """The scene's problem."""
        return scenes.load(self.scene)

    @property
    def key(self) -> str:
        """The name of the trial's file: readable, and different for different settings."""
        return f"{self.scene}-{self.planner.name}-{digest(self.settings)[:32]}"

    @abstractmethod
    def measure(self) -> Result:
        """Run the trial."""

    def decode(self, record: dict[str, Any]) -> Result:
        """The result from its stored fields."""
        found: Result = rebuilt(self._kind, record)
        return found


class Store:
    """The finished trials in a directory, one small file for each."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def path(self, trial: Trial[Any]) -> Path:
        """The file of a trial's result."""
        return self.directory / f"{trial.key}.json"

    def load(self, trial: Trial[Result]) -> Result | None:
        """A trial's stored result; None where there is none, or its file is damaged."""
        try:
            record = json.loads(self.path(trial).read_text(encoding="utf-8"))
            sealed = record.pop("digest")
            if sealed != digest(record) or record["settings"] != _plain(trial.settings):
                return None
            return trial.decode(record["result"])
        except (FileNotFoundError, ValueError, KeyError, TypeError, AttributeError):
            return None

    def save(self, trial: Trial[Result], result: Result) -> None:
        """Store a trial's result, completely or not at all."""
        record = {"settings": trial.settings, "result": dataclasses.asdict(result)}  # type: ignore[call-overload]
        sealed = canonical({**record, "digest": digest(record)})
        with written_whole(self.path(trial)) as temporary:
            temporary.write_text(sealed + "\n", encoding="utf-8")


def _plain(record: object) -> object:
    """The record as it would be read from its file."""
    return json.loads(canonical(record))
