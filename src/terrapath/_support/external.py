"""What a file reaches that was not named by the user: other folders, other machines.

A scenario, or a virtual raster, may come from a stranger. What it names is used only inside its own
folder, unless the user allows more.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import MapError
from ..validation import is_there

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

ALLOW = "allow_external=True in Python, --allow-external on the command line"

# Drivers of GDAL whose names have a file after the colon, and archives that are read like folders.
_OF_FILES = ("netcdf", "hdf5", "hdf5image", "gpkg", "gtiff_dir", "bag", "zarr")
# Only zip archives are looked into for descriptions, see ``require_moderate_archive``.
_ARCHIVES = re.compile(r"(?:/vsizip/)+", re.IGNORECASE)
_DRIVER = re.compile(r"([A-Za-z0-9_+]{2,}):(.*)", re.DOTALL)

MOST_XML = 64 * 2**20  # bytes of a description
BEGINNING = 1024  # bytes in which a description says what it is
DEEPEST = 8  # descriptions in descriptions

# How text begins that says where the data are, instead of holding them: of services, or virtual.
DESCRIBES = re.compile(
    rb"<(?P<service>GDAL_W|WCS_GDAL|GDALTileIndex|OGRW|OGRC|MRF_META|ST_|NITF)"
    rb"|(?P<command>gdal_streamed_alg)|<(?P<virtual>VRT|OGRVRT)"
)
_INLINE = re.compile(r"\s*[<{]|<(VRT|OGRVRT|GDAL)", re.IGNORECASE)
# Elements, and attributes, of virtual rasters and virtual vectors that name another file.
_NAMING = {"sourcefilename", "sourcedataset", "srcdatasource", "indexdataset", "source", "dempath"}
# Entries by their keys: places of cells, and arguments of processing steps.
_ENTRIES = re.compile(r"[xy]_dataset|.*filename.*", re.IGNORECASE)

# An archive holds no more than this, and little that is packed more than so many times.
MOST_UNPACKED = 4 * 2**30
MOST_PACKED, SMALL = 200, 2**28


def is_inside(name: str, folder: Path) -> bool:
    """Is what a name stands for a file in a folder? Links are followed."""
    root = os.path.realpath(folder)
    try:
        return os.path.commonpath([root, os.path.realpath(name)]) == root
    except ValueError:  # on another drive, or no name of a file
        return False


def reaches_out(name: str, folder: Path) -> bool:
    """Is a name in a file of this folder of the network, or of an absolute path elsewhere?

    Paths from the folder may lead out of it, as ``../maps/dem.tif``: a project has several.
    """
    return any(
        path is None or (Path(path).is_absolute() and not is_inside(path, folder))
        for path in _paths_in(name)
    )


def _paths_in(name: str) -> Iterator[str | None]:
    """The paths that a name may mean; None for what is no file of this machine."""
    if "://" in name or _INLINE.search(name):
        yield None
    elif name.lower().startswith("/vsi"):
        rest = _ARCHIVES.sub("", name)
        yield rest.strip("{}") if rest != name and not rest.lower().startswith("/vsi") else None
    elif (named := _DRIVER.fullmatch(name)) is not None:
        if named[1].lower() in _OF_FILES:
            yield named[2].replace('"', "")
        else:
            yield None
    else:
        yield name


# Descriptions: text files that say where the data are


def require_no_reach(path: Path, beginning: bytes, *, depth: int = 0) -> None:
    """Raise MapError where a file only describes data, and these are outside its folder.

    beginning : its first bytes. Virtual rasters and vectors, and descriptions of services.
    """
    found = DESCRIBES.search(beginning)
    if found is None:
        return
    if depth > DEEPEST:
        raise MapError(f"{path}: descriptions of data that name one another; name the data")
    if found["virtual"] is None:
        raise MapError(f"{path} describes a service elsewhere; allow that by {ALLOW}")
    for name, is_relative in _sources(path):
        if reaches_out(name, path.parent):
            raise MapError(
                f"{path} takes its data from {name!r:.200}, which is elsewhere; allow "
                f"that by {ALLOW}"
            )
        file = _file_of(name, path.parent if is_relative else Path())
        try:
            with file.open("rb") as source:
                beginning = source.read(BEGINNING)
        except (OSError, ValueError):
            raise MapError(
                f"{path} takes its data from {name!r:.200}, which is no file that can be looked "
                f"into; check the name, or allow it by {ALLOW}"
            ) from None
        require_no_reach(file, beginning, depth=depth + 1)


def _file_of(name: str, folder: Path) -> Path:
    """The file that a name means, as seen from a folder; of a driver's name, the file in it."""
    if _DRIVER.fullmatch(name):
        for part in re.split(r'[:"]', name)[1:]:
            if part and (folder / part).is_file():
                return folder / part
    return folder / name


def _sources(path: Path) -> Iterator[tuple[str, bool]]:
    """The names in a description, and whether they are relative to its folder."""
    from xml.etree import ElementTree as Xml

    try:
        if path.stat().st_size > MOST_XML:
            raise MapError(f"{path} is a description of over {MOST_XML:,} bytes; name the data")
        content = path.read_bytes()
        if b"<!ENTITY" in content:
            raise MapError(f"{path} defines entities of XML, which no virtual raster needs")
        root = Xml.fromstring(content.strip(b" \t\r\n\0"))
    except (Xml.ParseError, OSError, ValueError) as error:
        raise MapError(f"{path} cannot be read as XML: {error}; check the file") from None
    for element in root.iter():
        yield from _names_in(path, element)


def _names_in(path: Path, element: Element) -> Iterator[tuple[str, bool]]:
    """The names that one element gives: in its text, and in attributes, which GDAL reads alike."""
    tag = element.tag.rpartition("}")[2].lower()
    text = (element.text or "").strip()
    given = {key.lower(): value.strip() for key, value in element.attrib.items()}
    key = given.get("key", given.get("name", ""))
    if tag == "srcsql" or "srcsql" in given:
        raise MapError(
            f"{path} takes its data from a query, which may name other files; name the file, or "
            f"allow it by {ALLOW}"
        )
    if tag == "ooi" and re.search(r"[/\\<{]", text):
        raise MapError(f"{path} opens a file with {key}={text!r:.200}; allow that by {ALLOW}")
    is_entry = tag in {"mdi", "argument", "option"} and _ENTRIES.fullmatch(key)
    relative = given.get("relativetovrt", "0").lower() in {"1", "yes", "true", "on"}
    if text and (tag in _NAMING or is_entry):
        yield text, relative
    for name in _NAMING & given.keys():
        yield given[name], relative


# Archives


def require_moderate_archive(path: Path, *, allow_external: bool) -> None:
    """Raise MapError for a zip archive that is far larger unpacked than a map would be.

    And for one that holds descriptions of data, which may be elsewhere, without leave.
    """
    import zipfile
    import zlib

    try:
        if not (path.is_file() and zipfile.is_zipfile(path)):
            return
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
            _require_moderate(path, sum(entry.file_size for entry in entries))
            for entry in [] if allow_external else entries:
                with archive.open(entry) as file:
                    _require_no_description(path, entry.filename, file.read(BEGINNING))
    except (
        OSError, EOFError, RuntimeError, zipfile.BadZipFile, ValueError, zlib.error
    ) as error:  # fmt: skip
        raise MapError(f"{path} cannot be read: {error}") from None


def _require_moderate(path: Path, size: int) -> None:
    """Raise MapError where an archive is too large unpacked. size : bytes."""
    packed = path.stat().st_size
    if size > MOST_UNPACKED or size > max(SMALL, MOST_PACKED * packed):
        raise MapError(
            f"{path} holds {size / 2**30:,.3g} GiB in {packed / 2**20:,.3g} MiB, more than a map "
            "does; unpack it yourself, and cut out the part around the map"
        )


def _require_no_description(path: Path, name: str, beginning: bytes) -> None:
    if DESCRIBES.search(beginning):
        raise MapError(
            f"{path} holds {name!r:.100}, which only says where the data are; unpack it, or allow "
            f"it by {ALLOW}"
        )


def archive_of(name: str) -> Path | None:
    """The archive in a name such as /vsizip/maps.zip/dem.tif or zip://maps.zip!dem.tif."""
    text = re.sub(r"^(?:/vsizip/|zip\+?[a-z0-9]*://)", "", name, flags=re.IGNORECASE).strip("{}")
    for end in [m.end() for m in re.finditer(r"\.[A-Za-z0-9]+(?=[/!\\}]|$)", text)]:
        if is_there(path := Path(text[:end])) and path.is_file():
            return path
    return None
