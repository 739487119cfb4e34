"""Programs in C++ to compare with: compiled once, or named as missing."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from terrapath._support.files import written_whole
from terrapath.errors import TerrapathError

SOURCES = Path(__file__).parent / "cpp"
FLAGS = ("-std=c++17", "-O3", "-march=native", "-DNDEBUG")
INCLUDES = (Path("/usr/include"), Path("/usr/local/include"))


@dataclass(frozen=True)
class Library:
    """A C++ library that a program needs."""

    name: str
    headers: tuple[str, ...]  # where to find one: patterns below an include directory
    version: str  # the beginning of the names of the version's parts in that header
    flags: tuple[str, ...]
    others: tuple[str, ...] = ()  # more directories of headers

    @cached_property
    def _header(self) -> Path | None:
        patterns = ((place, pattern) for place in INCLUDES for pattern in self.headers)
        paths = (path for place, pattern in patterns for path in sorted(place.glob(pattern)))
        return next(paths, None)

    @property
    def found_version(self) -> str | None:
        """The version that is installed; None where none is."""
        if self._header is None:
            return None
        text = self._header.read_text(encoding="utf-8", errors="replace")
        parts = re.findall(rf"{self.version}_(?:MAJOR|MINOR|PATCH)_VERSION\s+(\d+)", text)
        return ".".join(parts) or "unknown"

    @property
    def compiler_flags(self) -> list[str]:
        """The compiler's flags for its headers and for linking."""
        assert self._header is not None
        places = [self._header.parents[1], *(i / o for i in INCLUDES for o in self.others)]
        places = [place for place in places if place.is_dir() and place not in INCLUDES]
        return [*(f"-isystem{place}" for place in places), *self.flags]


OMPL = Library(
    "OMPL",
    ("ompl-*/ompl/config.h", "ompl/config.h"),
    "OMPL",
    ("-lompl",),
    ("eigen3",),
)


@dataclass(frozen=True)
class Program:
    """A program that is compiled here."""

    name: str  # in reports
    source: str
    library: Library | None = None
    install: str = "a C++ compiler (on Debian: apt-get install g++)"

    @cached_property
    def _compiler(self) -> str | None:
        return shutil.which(os.environ.get("CXX", "c++")) or shutil.which("g++")

    @cached_property
    def problem(self) -> str | None:
        """Why it cannot be run; None where it can."""
        if not (SOURCES / self.source).is_file():
            return "its source comes with terrapath's repository alone, not with the package"
        library = self.library
        if self._compiler is None or (library is not None and library.found_version is None):
            return f"it needs {self.install}"
        try:
            self._compile()
        except TerrapathError as error:
            return str(error)
        return None

    @property
    def version(self) -> str | None:
        """The versions of compiler and library; None where it cannot be run."""
        if self.problem is not None:
            return None
        library = self.library
        with_library = "" if library is None else f"{library.name} {library.found_version}, "
        return f"{with_library}{self._compiler_version}, {' '.join(FLAGS)}"

    @property
    def missing(self) -> str:
        """A sentence for the report where it cannot be run."""
        return f"{self.name} was left out: {self.problem}."

    def run(self, arguments: Sequence[str | Path], **environment: str) -> Any:
        """Run it; returns what it prints, from JSON. Raises TerrapathError where it fails."""
        command = [str(self._compile()), *map(str, arguments)]
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, **environment},
        )
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or ["no message"]
            raise TerrapathError(f"{self.name} ended with code {done.returncode}: {lines[-1]}")
        return json.loads(done.stdout)

    @cached_property
    def _compiler_version(self) -> str:
        command = [str(self._compiler), "--version"]
        printed = subprocess.run(command, capture_output=True, text=True, check=False).stdout
        return next(iter(printed.splitlines()), "unknown compiler")

    def _compile(self) -> Path:
        """The program's file; it is used again while sources, compiler and library are the same."""
        library = self.library
        flags = [] if library is None else library.compiler_flags
        known = [self._compiler_version, *FLAGS, *flags]
        known.append("" if library is None else str(library.found_version))
        known += [(SOURCES / name).read_text("utf-8") for name in (self.source, "surface.hpp")]
        stamp = hashlib.sha256("\0".join(known).encode()).hexdigest()[:16]
        path = _cache() / f"{Path(self.source).stem}-{stamp}"
        if os.access(path, os.X_OK):
            return path
        path.parent.mkdir(parents=True, exist_ok=True)
        with written_whole(path) as temporary:
            command = [str(self._compiler), *FLAGS, str(SOURCES / self.source), "-o"]
            command += [str(temporary), *flags]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                errors = [line for line in done.stderr.splitlines() if "error" in line]
                reason = (errors or ["no message"])[0]
                raise TerrapathError(f"{self.source} does not compile here: {reason}")
        path.chmod(0o755)
        return path


def _cache() -> Path:
    """Where compiled programs are kept."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "terrapath" / "benchmarks"


OMPL_PLANNERS = Program(
    "OMPL in C++",
    "planners.cpp",
    OMPL,
    "OMPL and a C++ compiler (on Debian: apt-get install g++ libompl-dev)",
)
EDGES_LOOP = Program("The loop in C++", "edges.cpp")
