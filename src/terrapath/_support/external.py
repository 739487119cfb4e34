"""What a file reaches that was not named by the user: other folders, other machines.

A scenario, or a virtual raster, may come from a stranger. What it names is used only inside its own
folder, unless the user allows more.
"""

from __future__ import annotations

import os
import re
import zipfile
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as Xml

from ..errors import MapError
from ..validation import is_there

ALLOW = "allow_external=True in Python, --allow-external on the command line"

# Drivers of GDAL whose names have a file after the colon, and archives that are read like folders.
_OF_FILES = ("netcdf", "hdf5", "hdf5image", "gpkg", "gtiff_dir", "bag", "zarr")
_ARCHIVES = re.compile(r"(?:/vsi(?:zip|tar|gzip|7z|rar)/)+", re.IGNORECASE)
_DRIVER = re.compile(r"([A-Za-z0-9_+]{2,}):(.*)", re.DOTALL)

MOST_XML = 64 * 2**20  # bytes of a description
DEEPEST = 8  # descriptions in descriptions
# Elements of virtual rasters and virtual vectors that name another file.
_NAMING = {"sourcefilename", "sourcedataset", "srcdatasource", "indexdataset", "source"}

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
    if "://" in name:
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
    if depth > DEEPEST:
        raise MapError(f"{path}: descriptions of data that name one another; name the data")
    if re.search(rb"<(GDAL_W|WCS_GDAL|GDALTileIndex|ST_|NITF)", beginning):
        raise MapError(f"{path} describes a service elsewhere; allow that by {ALLOW}")
    if re.search(rb"<(VRT|OGRVRT)", beginning):
        _require_sources_inside(path, depth)


def _require_sources_inside(path: Path, depth: int) -> None:
    for name, is_relative in _sources(path):
        file = str(path.parent / name) if is_relative and not Path(name).is_absolute() else name
        if reaches_out(name, path.parent):
            raise MapError(
                f"{path} takes its data from {name!r:.200}, which is elsewhere; allow "
                f"that by {ALLOW}"
            )
        try:
            with Path(file).open("rb") as source:
                beginning = source.read(1024) if Path(file).is_file() else b""
        except (OSError, ValueError):
            continue
        require_no_reach(Path(file), beginning, depth=depth + 1)


def _sources(path: Path) -> Iterator[tuple[str, bool]]:
    """The names in a description, and whether they are relative to its folder."""
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
        tag = element.tag.rpartition("}")[2].lower()
        if tag in _NAMING and element.text and element.text.strip():
            given = {key.lower(): value for key, value in element.attrib.items()}
            relative = given.get("relativetovrt", "0").strip().lower() in {"1", "yes", "true", "on"}
            yield element.text.strip(), relative
        elif tag == "openoptions":
            continue


# Archives


def require_moderate_archive(path: Path) -> None:
    """Raise MapError for a zip archive that is far larger unpacked than a map would be."""
    try:
        if not (path.is_file() and zipfile.is_zipfile(path)):
            return
        with zipfile.ZipFile(path) as archive:
            entries = archive.infolist()
        packed = path.stat().st_size
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError) as error:
        raise MapError(f"{path} cannot be read: {error}") from None
    size = sum(entry.file_size for entry in entries)
    if size > MOST_UNPACKED or size > max(SMALL, MOST_PACKED * packed):
        raise MapError(
            f"{path} holds {size / 2**30:,.3g} GiB in {packed / 2**20:,.3g} MiB, more than a map "
            "does; unpack it yourself, and cut out the part around the map"
        )


def archive_of(name: str) -> Path | None:
    """The archive in a name such as /vsizip/maps.zip/dem.tif or zip://maps.zip!dem.tif."""
    if "zip" not in name.lower():
        return None
    text = re.sub(r"^(?:/vsizip/|zip\+?[a-z0-9]*://)", "", name, flags=re.IGNORECASE).strip("{}")
    for end in [m.end() for m in re.finditer(r"\.[A-Za-z0-9]+(?=[/!\\}]|$)", text)]:
        if is_there(path := Path(text[:end])) and path.is_file():
            return path
    return None
