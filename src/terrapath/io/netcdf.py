"""NetCDF files, which are read through xarray."""

from __future__ import annotations

import re
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from .._support.extras import require_packages
from ..errors import silence
from .rasters import reading
from .sources import NETCDF_ENDINGS

CLASSIC = b"CDF"
HDF5 = b"\x89HDF\r\n\x1a\n"


def netcdf(path: str | Path) -> tuple[Path, str | None] | None:
    """(file, variable or None) if a name is of a netCDF file on this machine, else None.

    GDAL takes the last two dimensions of a variable for its rows and columns, so that it reads one
    with the dimensions (lon, lat) mirrored, and minds the units of coordinates only now and
    then. Its library is slow to load, and crashes on damaged files of the classic format.
    """
    match = re.fullmatch(r'(?i:netcdf):"?(.+?)"?(?::([^:"]+))?', str(path))
    name, variable = (match[1], match[2]) if match else (str(path), None)
    file = Path(name)
    is_named_so = match is not None or file.suffix.lower() in NETCDF_ENDINGS
    if _begins_with(file, CLASSIC) or (is_named_so and _begins_with(file, HDF5)):
        return file, variable
    return None


def _begins_with(path: Path, mark: bytes) -> bool:
    try:
        with path.open("rb") as file:
            return file.read(len(mark)) == mark
    except (OSError, ValueError):
        return False


def open_netcdf(path: Path, files: ExitStack) -> Any:
    """The file as an xarray Dataset, read by SciPy or h5netcdf; closed with the stack."""
    engine = "h5netcdf" if _begins_with(path, HDF5) else "scipy"
    needed = ("xarray", "h5netcdf", "h5py") if engine == "h5netcdf" else ("xarray",)
    require_packages(f"{path}, a netCDF file,", *needed)
    import xarray

    # It warns of attributes that contradict one another. Where this matters, values are missing.
    silence(xarray.SerializationWarning, "xarray.conventions")
    with reading(path):
        if engine == "h5netcdf":
            import h5py

            h5py.File(path).close()  # h5netcdf prints a traceback of its own where this fails
        return files.enter_context(
            xarray.open_dataset(path, engine=engine, decode_times=False, cache=False)
        )
