"""The files to write. Whether they can be written is checked before anything is planned."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError, MapError, UnfinishedWarning, tell
from .sections import OutputSection

if TYPE_CHECKING:
    from ..distance.field import DistanceField
    from ..problem import Problem, Solution


def require_outputs(paths: Sequence[Path], inputs: Iterable[str]) -> None:
    """Raise MapError where a file cannot be written, is named twice, or is an input."""
    from .._support.files import parts_of, require_writable

    parts = [(part, path) for path in paths for part in parts_of(path)]
    for path in paths:
        require_writable(path)
    places = {_place(part): path for part, path in parts}
    if len(places) < len(parts):
        raise MapError("the same file is named twice among the outputs; name each once")
    for name in inputs:
        lost = places.keys() & set(_places_of(name))
        if lost:
            raise MapError(
                f"output={str(places[min(lost)])!r} would replace the input {name!r}; name "
                "another file"
            )


def _place(path: Path) -> Path:
    """The real path. Path.resolve would raise where links form a circle."""
    return Path(os.path.realpath(path))


def _places_of(name: str) -> Iterator[Path]:
    """The real paths that an input may have, and their folders: an output may be a folder."""
    for file in _files_in(name):
        place = _place(file)
        yield from (place, *place.parents)


def _files_in(name: str) -> Iterator[Path]:
    """The parts of an input's name that may be its file: FILE:LAYER, DRIVER:"FILE":PART, ..."""
    for text in (name, name.partition(":")[2]):
        before, _, after = text.rpartition(":")
        yield from (Path(part.strip('"')) for part in (text, before, after) if part)


def require_ending(path: Path, option: str, ending: str) -> None:
    """Raise MapError where the path does not have this ending."""
    if path.suffix.lower() != ending:
        raise MapError(f"{option}={str(path)!r} has no known format; the name must end in {ending}")


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def numbered(path: Path, count: int) -> list[Path]:
    """The path itself, or one for each of several legs: proof-1.npz, proof-2.npz."""
    if count == 1:
        return [path]
    return [path.with_name(f"{path.stem}-{k}{path.suffix}") for k in range(1, count + 1)]


@dataclass(frozen=True)
class RouteOutputs:
    """The files of a route. legs : their number in the tour that is planned."""

    section: OutputSection
    legs: int = 1

    @property
    def files(self) -> list[Path]:
        """The files of the route itself."""
        return [Path(file) for file in self.section.files]

    @property
    def tolerance(self) -> float | None:
        """How far the route may be from what is written, map units; None for the default."""
        given = self.section.simplify
        return {"auto": None, "none": 0.0}[given] if isinstance(given, str) else given

    @property
    def certificates(self) -> list[Path]:
        """The files of certificates, one for each leg."""
        path = _path(self.section.certificate)
        return [] if path is None else numbered(path, self.legs)

    def check(self, inputs: Iterable[str]) -> None:
        """Raise MapError beforehand where a file cannot be written or would replace an input."""
        from ..io.routes import require_known_format

        section = self.section
        if self.tolerance is not None:
            from ..validation import require_not_negative

            require_not_negative(simplify=self.tolerance)
        for path in self.files:
            require_known_format(path)
        pictures = [Path(name) for name in (section.plot, section.profile) if name is not None]
        if pictures:
            from ..plotting.figure import require_known_picture

            for picture in pictures:
                require_known_picture(picture)
        pages = [] if section.page is None else [Path(section.page)]
        for page in pages:
            from ..plotting.page import require_known_page

            require_known_page(page)
        for certificate in self.certificates:
            require_ending(certificate, "certificate", ".npz")
        require_outputs([*self.files, *pictures, *pages, *self.certificates], inputs)

    def require_fit(self, problem: Problem) -> None:
        """Raise MapError where a format cannot hold a route on this plane."""
        from ..io.routes import require_fitting_format

        for path in self.files:
            require_fitting_format(path, problem.surface.georeference)

    def write(self, solution: Solution) -> None:
        """Write every file, except certificates where no lower bound was proven."""
        from ..io import write_route

        section = self.section
        for path in self.files:
            write_route(solution, path, simplify=self.tolerance)
        for path, leg in zip(self.certificates, solution.legs or [solution], strict=False):
            if leg.certificate is None:
                tell(UnfinishedWarning(f"{path} was not written: no lower bound was proven"))
            else:
                leg.certificate.save(path)
        if section.profile is not None:
            from ..plotting import plot_profile

            plot_profile(solution, section.profile)
        self.draw(solution)

    def draw(self, solution: Solution) -> None:
        """Draw the map and the page, also of a solution without a path."""
        section = self.section
        if section.plot is not None:
            from ..plotting import plot_route

            plot_route(solution, section.plot)
        if section.page is not None:
            from ..plotting import plot_page

            plot_page(solution, section.page)


@dataclass(frozen=True)
class FieldOutputs:
    """The files of a distance field."""

    files: Sequence[Path]
    plot: Path | None

    def check(self, inputs: Iterable[str]) -> None:
        """Raise MapError beforehand where a file cannot be written or would replace an input."""
        from ..io.fields import require_known_format

        if not self.files and self.plot is None:
            raise InputError("no output is named; give --output FILE.tif, or --plot FILE.png")
        for path in self.files:
            require_known_format(path)
        if self.plot is not None:
            from ..plotting.figure import require_known_picture

            require_known_picture(self.plot)
        require_outputs([*self.files, *([] if self.plot is None else [self.plot])], inputs)

    def write(self, field: DistanceField) -> None:
        """Write every file."""
        from ..io import write_field

        for path in self.files:
            write_field(field, path)
        if self.plot is not None:
            from ..plotting import plot_field

            plot_field(field, self.plot)
