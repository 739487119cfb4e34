"""A smooth terrain that is known exactly, sampled in any CRS, as any kind of source."""

import numpy as np
import xarray
from pyproj import CRS, Transformer
from rasterio import Affine

from rasters import centres

CENTRE = (15.3, 46.4)  # longitude, latitude
TRUTH = CRS.from_proj4(f"+proj=laea +lon_0={CENTRE[0]} +lat_0={CENTRE[1]} +datum=WGS84")
WGS84 = CRS.from_epsg(4326)


def height_at(x, y):
    """A smooth terrain in metres of the true projection."""
    hills = 300.0 * np.exp(-(((x - 800.0) / 1500.0) ** 2 + ((y + 300.0) / 1200.0) ** 2))
    return 500.0 + hills + 120.0 * np.sin(x / 900.0) * np.cos(y / 1100.0) + 0.02 * x


def terrain(crs, cell, *, half=5000.0, turned=0.0):
    """(heights, transform): the terrain sampled exactly at the cell centres in a CRS."""
    to_map = Transformer.from_crs(TRUTH, crs, always_xy=True)
    edge = np.linspace(-half, half, 21)
    corners = np.stack(np.meshgrid(edge, edge), axis=-1).reshape(-1, 2)
    x, y = to_map.transform(*corners.T)
    middle = 0.5 * (x.min() + x.max()), 0.5 * (y.min() + y.max())
    columns, rows = (int(np.ceil(1.1 * np.ptp(c) / s)) for c, s in zip((x, y), cell, strict=True))
    transform = (
        Affine.translation(*middle)
        @ Affine.rotation(turned)
        @ Affine.scale(cell[0], -cell[1])
        @ Affine.translation(-0.5 * columns, -0.5 * rows)
    )
    places = centres(transform, (rows, columns))
    true_x, true_y = to_map.transform(places[..., 0], places[..., 1], direction="INVERSE")
    return height_at(true_x, true_y), transform


def as_dataarray(heights, transform, crs, **attributes):
    places = centres(transform, heights.shape)
    array = xarray.DataArray(
        heights,
        dims=("y", "x"),
        coords={"y": places[:, 0, 1], "x": places[0, :, 0]},
        name="elevation",
        attrs=attributes,
    )
    return array.assign_coords(spatial_ref=((), 0, {"crs_wkt": CRS(crs).to_wkt()}))


def netcdf(path, array):
    """Described as CF requires: the CRS by its name, the axes by their standard names."""
    for axis in ("x", "y"):
        array[axis].attrs.update(standard_name=f"projection_{axis}_coordinate", units="m")
    dataset = array if isinstance(array, xarray.Dataset) else array.to_dataset(name="elevation")
    for name in dataset.data_vars:
        dataset[name].attrs["grid_mapping"] = "spatial_ref"
    dataset.to_netcdf(path)
    return path
