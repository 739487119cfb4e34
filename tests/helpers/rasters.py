"""A small GeoTIFF to write, and where its cells lie."""

import numpy as np
import rasterio
from rasterio import Affine

UTM = "EPSG:32633"
NORTH_UP = Affine(10.0, 0.0, 500_000.0, 0.0, -10.0, 4_000_120.0)

# Twelve rows from north to south, ten columns.
HEIGHTS = np.random.default_rng(0).normal(scale=5.0, size=(12, 10))


def write(path, bands, transform=NORTH_UP, crs=UTM, units=(), **profile):
    """A GeoTIFF of bands (rows, columns) or (bands, rows, columns)."""
    bands = np.asarray(bands)
    bands = bands[None] if bands.ndim == 2 else bands
    with rasterio.open(
        path,
        "w",
        driver=profile.pop("driver", "GTiff"),
        count=len(bands),
        height=bands.shape[1],
        width=bands.shape[2],
        dtype=profile.pop("dtype", bands.dtype),
        transform=transform,
        crs=crs,
        **profile,
    ) as dataset:
        dataset.write(bands)
        for band, unit in enumerate(units, start=1):
            dataset.set_band_unit(band, unit)
    return path


def centres(transform=NORTH_UP, shape=(12, 10)):
    """(rows, columns, 2): map coordinates of the cell centres."""
    columns, rows = np.meshgrid(np.arange(shape[1]) + 0.5, np.arange(shape[0]) + 0.5)
    t = transform
    return np.stack([t.a * columns + t.b * rows + t.c, t.d * columns + t.e * rows + t.f], axis=-1)


def centres_on_plane(surface, transform, shape):
    """(rows, columns, 2): the centres of a raster's cells on the plane of its surface."""
    return surface.georeference.from_map(centres(transform, shape))


def blocked_at(mask, points):
    """Which points of the plane lie in blocked cells of a mask."""
    i, j = (
        np.rint((points[..., k] - axis[0]) / (axis[1] - axis[0])).astype(int)
        for k, axis in enumerate((mask.x, mask.y))
    )
    inside = (i >= 0) & (j >= 0) & (i < len(mask.x)) & (j < len(mask.y))
    return inside & mask.blocked[np.where(inside, j, 0), np.where(inside, i, 0)]
