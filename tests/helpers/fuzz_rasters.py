"""Reads thousands of damaged rasters, and prints the outcomes as JSON."""

import json
import random
import re
import sys
import tempfile
import time
import warnings
from pathlib import Path

import laspy
import numpy as np
import rasterio
import xarray
from plyfile import PlyData, PlyElement
from rasterio import Affine

import terrapath as tp
from terrapath.cli.console import without_broken_messages

UTM = "EPSG:32633"
TRANSFORM = Affine(10.0, 0.0, 500_000.0, 0.0, -10.0, 4_000_120.0)
HEIGHTS = np.random.default_rng(0).normal(scale=5.0, size=(14, 12)).astype(np.float32)


def geotiff(path, **options):
    rows, columns = HEIGHTS.shape
    with rasterio.open(
        path, "w", driver=options.pop("driver", "GTiff"), width=columns, height=rows, count=1,
        dtype="float32", crs=options.pop("crs", UTM), transform=TRANSFORM, **options,
    ) as dataset:  # fmt: skip
        dataset.write(HEIGHTS[None])
    return path.read_bytes()


def text_grid(path):
    head = "ncols 12\nnrows 14\nxllcorner 500000\nyllcorner 4000000\ncellsize 10\n"
    path.write_text(head + "\n".join(" ".join(f"{v:.2f}" for v in row) for row in HEIGHTS))
    return path.read_bytes()


def virtual(path):
    source = path.with_suffix(".source.tif")
    geotiff(source)
    path.write_text(
        f"<VRTDataset rasterXSize='12' rasterYSize='14'><SRS>{UTM}</SRS>"
        "<GeoTransform>500000,10,0,4000120,0,-10</GeoTransform>"
        "<VRTRasterBand dataType='Float32' band='1'><NoDataValue>-9</NoDataValue>"
        f"<SimpleSource><SourceFilename relativeToVRT='0'>{source}</SourceFilename>"
        "<SourceBand>1</SourceBand><SrcRect xOff='0' yOff='0' xSize='12' ySize='14'/>"
        "<DstRect xOff='0' yOff='0' xSize='12' ySize='14'/></SimpleSource>"
        "</VRTRasterBand></VRTDataset>"
    )
    return path.read_bytes()


def netcdf(path, **options):
    attributes = {a: {"standard_name": f"projection_{a}_coordinate", "units": "m"} for a in "xy"}
    axes = {"y": 4_000_000.0 + 10.0 * np.arange(14), "x": 500_000.0 + 10.0 * np.arange(12)}
    coords = {name: (name, axis, attributes[name]) for name, axis in axes.items()}
    array = xarray.DataArray(HEIGHTS, dims=("y", "x"), coords=coords, name="height")
    array.to_netcdf(path, **options)
    return path.read_bytes()


def picture(path, **options):
    with rasterio.open(path, "w", width=12, height=14, count=1, dtype="uint8", **options) as file:
        file.write(np.clip(100.0 + HEIGHTS, 0, 255).astype(np.uint8)[None])
    return path.read_bytes()


def robot(path):
    picture(path.with_suffix(".pgm"), driver="PNM")
    path.write_text(
        f"image: {path.stem}.pgm\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.9\nfree_thresh: 0.5\nmode: scale\n"
    )
    return path.read_bytes()


def letters(path):
    rows = "\n".join("".join(".@"[int(v > 4.0)] for v in row) for row in HEIGHTS)
    path.write_text(f"type octile\nheight 14\nwidth 12\nmap\n{rows}\n")
    return path.read_bytes()


def points():
    x, y = 50.0 * np.random.default_rng(1).uniform(size=(2, 400))
    return np.column_stack([x, y, np.sin(x / 9.0) + 0.1 * y])


def text_points(path):
    np.savetxt(path, points(), delimiter=",", header="x,y,z", comments="", fmt="%.3f")
    return path.read_bytes()


def laser(path):
    header = laspy.LasHeader(point_format=1, version="1.2")
    header.scales = [1e-3] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points().T
    cloud.write(path)
    return path.read_bytes()


def polygons(path, text):
    kinds = [(name, "f4") for name in "xyz"]
    vertices = np.array([tuple(point) for point in points()], dtype=kinds)
    PlyData([PlyElement.describe(vertices, "vertex")], text=text).write(path)
    return path.read_bytes()


FILES = {
    "plain.tif": geotiff,
    "packed.tif": lambda path: geotiff(path, compress="deflate", predictor=3, nodata=-9.0),
    "tiled.tif": lambda path: geotiff(path, tiled=True, blockxsize=16, blockysize=16),
    "grid.asc": text_grid,
    "map.vrt": virtual,
    "classic.nc": lambda path: netcdf(path, format="NETCDF3_CLASSIC"),
    "four.nc": lambda path: netcdf(path, format="NETCDF4"),
    "erdas.img": lambda path: geotiff(path, driver="HFA"),
    "map.yaml": robot,
    "grid.map": letters,
    "cloud.csv": text_points,
    "cloud.las": laser,
    "cloud.laz": laser,
    "cloud.ply": lambda path: polygons(path, text=False),
    "text.ply": lambda path: polygons(path, text=True),
}


def mutated(content, dice):
    """The damaged file: bytes flipped, cut off, repeated or dropped; numbers in text absurd."""
    data = bytearray(content)
    kind = dice.randrange(6)
    if kind == 0:
        return bytes(data[: dice.randrange(len(data))])
    if kind == 1:
        start = dice.randrange(len(data))
        del data[start : start + dice.choice([1, 2, 4, 16, 64])]
        return bytes(data)
    if kind == 2:
        start = dice.randrange(len(data))
        piece = data[start : start + dice.choice([1, 4, 16])]
        return bytes(data[:start] + piece * dice.choice([2, 5]) + data[start:])
    if kind == 3 and (numbers := list(re.finditer(rb"-?\d+(\.\d+)?", content))):
        number = dice.choice(numbers[:60])
        other = dice.choice([b"0", b"-1", b"1e308", b"nan", b"inf", b"99999999999", b"x", b""])
        return content[: number.start()] + other + content[number.end() :]
    # The header is where the structure is.
    reach = min(len(data), dice.choice([16, 64, 512, len(data)]))
    for _ in range(dice.choice([1, 1, 2, 8])):
        data[dice.randrange(reach)] = dice.choice([0, 255, 127, 128, dice.randrange(256)])
    return bytes(data)


def outcome(path):
    """ "read", "refused", or what is wrong."""
    try:
        surface = tp.read_surface(path, most_cells=200_000)
    except tp.TerrapathError as error:
        text = str(error)
        return "refused" if text and "\n" not in text and len(text) < 1000 else f"says {text!r}"
    except BaseException as error:
        return f"raises {type(error).__name__}: {error}"
    values = surface.data.coefficients
    return "read" if np.isfinite(values).all() else "has values that are not finite"


def main(seed, count):
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", "Use `@` matmul")
    warnings.filterwarnings("ignore", "Dataset has no geotransform")  # while pictures are made
    warnings.simplefilter("ignore", tp.MapWarning)  # damaged heights are often absurd
    dice = random.Random(seed)
    found = {"count": 0, "wrong": [], "by_file": {}, "slowest": 0.0}
    # As the command does: what rasterio prints of messages that are no text is not ours.
    with tempfile.TemporaryDirectory() as folder, without_broken_messages():
        for name, make in FILES.items():
            path = Path(folder) / name
            content = make(path)
            assert outcome(path) == "read", (name, outcome(path))
            seen, beside = {"read": 0, "refused": 0}, set(path.parent.iterdir())
            for number in range(count):
                path.write_bytes(mutated(content, dice))
                started = time.perf_counter()
                result = outcome(path)
                found["slowest"] = max(found["slowest"], time.perf_counter() - started)
                found["count"] += 1
                seen[result] = seen.get(result, 0) + 1
                if left := set(path.parent.iterdir()) - beside:
                    result = f"leaves {left}"
                if result not in {"read", "refused"}:
                    found["wrong"].append(f"{name} {number}: {result}")
            found["by_file"][name] = (seen["read"], seen["refused"])
    print(json.dumps(found))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
