"""What tests of the command share."""

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin


@pytest.fixture
def dem(tmp_path):
    """A small raster in metres, a hill, with a block without data."""
    y, x = np.mgrid[0:40, 0:50] * 10.0
    height = 30.0 * np.exp(-((x - 250) ** 2 + (y - 200) ** 2) / 8000.0)
    height[5:9, 5:9] = -9999.0
    rocks = np.where(x > 250, 1.0, 0.0)
    path = tmp_path / "dem.tif"
    profile = {
        "driver": "GTiff",
        "width": 50,
        "height": 40,
        "count": 2,
        "dtype": "float64",
        "crs": "EPSG:32617",
        "transform": from_origin(500_000.0, 4_000_400.0, 10.0, 10.0),
        "nodata": -9999.0,
    }
    with rasterio.open(path, "w", **profile) as dataset:
        dataset.write(height, 1)
        dataset.write(rocks, 2)
    return path
