"""Features of GDAL's vector formats: geometries with columns of values, written by pyogrio."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ...errors import silence
from ...surface.georeference import Georeference

Values = npt.NDArray[Any]


class Features(NamedTuple):
    """Geometries, and columns of values, one for each geometry."""

    kind: str  # of the geometries
    geometries: Values
    columns: dict[str, Values]  # masked where there is no value


def crs_text(reference: Georeference | None) -> str | None:
    """The plane's CRS as GDAL writes it: as its EPSG code where it has one."""
    if reference is None:
        return None
    code = reference.crs.to_epsg()
    return f"EPSG:{code}" if code else reference.crs.to_wkt("WKT1_GDAL")


def write_features(
    target: Path | BytesIO,
    features: Features,
    *,
    layer: str,
    driver: str,
    crs: str | None,
    **options: Any,
) -> None:
    """Write one layer. options : of the layer, as GDAL names them. Raises OSError."""
    import pyogrio.raw
    import shapely
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

    columns = features.columns.values()
    silence(UserWarning, __name__)  # it warns where the plane has no CRS; that is allowed
    try:
        pyogrio.raw.write(
            target,
            shapely.to_wkb(features.geometries, output_dimension=3),
            [np.ma.getdata(values) for values in columns],
            list(features.columns),
            [np.ma.getmaskarray(v) if np.ma.isMaskedArray(v) else None for v in columns],
            layer=layer,
            driver=driver,
            geometry_type=features.kind,
            crs=crs,
            layer_options=options,
        )
    except (DataLayerError, DataSourceError, FeatureError) as error:
        raise OSError(str(error).split("\n")[0]) from error
