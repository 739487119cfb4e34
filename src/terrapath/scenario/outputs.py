"""Files that will be written: whether they can be is found out before anything is planned."""

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
    """Raise MapError where a file cannot be written, is named twice, or holds an input."""
    from .._support.files import require_writable

    for path in paths:
        require_writable(path)
    places = {_place(path): path for path in paths}
    if len(places) < len(paths):
        raise MapError("the same file is named twice among the outputs; name each once")
    for name in inputs:
        lost = places.keys() & set(_places_of(name))
        if lost:
            raise MapError(
                f"output={str(places[min(lost)])!r} would replace the input {name!r}; name "
                "another file"
            )


def _place(path: Path) -> Path:
    """Where a path leads. Path.resolve would raise where links go in circles."""
    return Path(os.path.realpath(path))


def _places_of(name: str) -> Iterator[Path]:
    """Where an input may lie, and the folders around it: an output may be a folder."""
    for file in _files_in(name):
        place = _place(file)
        yield from (place, *place.parents)


def _files_in(name: str) -> Iterator[Path]:
    """What may be the file in an input's name: FILE, FILE:LAYER, DRIVER:"FILE":PART, ..."""
    for text in (name, name.partition(":")[2]):
        before, _, after = text.rpartition(":")
        yield from (Path(part.strip('"')) for part in (text, before, after) if part)


def require_ending(path: Path, option: str, ending: str) -> None:
    """Raise MapError for another ending than the one there is."""
    if path.suffix.lower() != ending:
        raise MapError(f"{option}={str(path)!r} has no known format; end it in {ending}")


def _path(text: str | None) -> Path | None:
    return None if text is None else Path(text)


def numbered(path: Path, count: int) -> list[Path]:
    """The path itself, or one for each of several legs: proof-1.npz, proof-2.npz."""
    if count == 1:
        return [path]
    return [path.with_name(f"{path.stem}-{k}{path.suffix}") for k in range(1, count + 1)]


@dataclass(frozen=True)
class RouteOutputs:
    """Where the route goes. legs : of the tour that is planned."""

    asked: OutputSection
    legs: int = 1

    @property
    def files(self) -> list[Path]:
        """Of the route, in its formats."""
        return [Path(file) for file in self.asked.files]

    @property
    def certificates(self) -> list[Path]:
        """One for each leg."""
        path = _path(self.asked.certificate)
        return [] if path is None else numbered(path, self.legs)

    def check(self, inputs: Iterable[str]) -> None:
        """Find out before the planning whether all can be written, and replaces no input."""
        from ..io.routes import require_known_format

        asked = self.asked
        for path in self.files:
            require_known_format(path)
        pictures = [Path(picture) for picture in (asked.plot, asked.profile) if picture is not None]
        if pictures:
            from ..plotting.figure import require_known_picture

            for picture in pictures:
                require_known_picture(picture)
        pages = [] if asked.page is None else [Path(asked.page)]
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
        """Write every file that there is something to write into."""
        from ..io import write_route

        asked = self.asked
        for path in self.files:
            write_route(solution, path)
        for path, leg in zip(self.certificates, solution.legs or [solution], strict=False):
            if leg.certificate is None:
                tell(UnfinishedWarning(f"{path} was not written: no bound was proven"))
            else:
                leg.certificate.save(path)
        if asked.plot is not None:
            from ..plotting import plot_route

            plot_route(solution, asked.plot)
        if asked.profile is not None:
            from ..plotting import plot_profile

            plot_profile(solution, asked.profile)
        if asked.page is not None:
            from ..plotting import plot_page

            plot_page(solution, asked.page)


@dataclass(frozen=True)
class FieldOutputs:
    """Where the field goes."""

    files: Sequence[Path]
    plot: Path | None

    def check(self, inputs: Iterable[str]) -> None:
        """Find out beforehand whether all can be written, and replaces no input."""
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
