"""``python -m benchmarks.real_maps FOLDER``: what is measured on real maps, as tables in Markdown.

FOLDER holds the maps of ``MAPS``; those that are not there are left out. GDAL's and GRASS's own
programs (on Debian: apt-get install gdal-bin grass-core) say what people know of slopes and of
r.walk; without them their columns are empty. ``--pictures DIR`` keeps a picture of each plan.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import rasterio
from pyproj import Transformer

import terrapath as tp
from terrapath.io.points import is_number
from terrapath.space.slope_limit import SlopeLimit

Floats = npt.NDArray[np.float64]

LIMITS = (20.0, 30.0, 40.0)  # degrees
TIME_LIMIT = 20.0  # seconds for each plan
HEAVY = 10.0  # the weight of height, where it has one
# Of the map's width and height, the first that are on free ground, and on the same part of it.
ENDS = (((0.15, 0.2), (0.85, 0.8)), ((0.3, 0.3), (0.7, 0.7)), ((0.2, 0.8), (0.8, 0.2)))
UTM = {"srtm_oetztal.tif": "EPSG:32632"}  # what a map in degrees is warped to for GDAL
MOST_SLOPE = 35.0  # degrees: the limit of the plans with one


@dataclass(frozen=True)
class RealMap:
    """A map, the name by which GDAL's programs find its heights, and how it is read here."""

    name: str
    subdataset: str = ""
    band: int = 1
    declared: tuple[str, ...] = ()  # what GDAL has to be told, and is found out here
    options: dict[str, Any] = field(default_factory=dict)

    def source(self, folder: Path) -> str:
        """What GDAL's programs are given."""
        path = folder / self.name
        return f'NETCDF:"{path}":{self.subdataset}' if self.subdataset else str(path)


MAPS = (
    RealMap("SainteHelens.dem"),
    RealMap("srtm_oetztal.tif"),
    RealMap("lakes_topo.nc", subdataset="dem"),
    RealMap("hugo.asc", declared=("-a_nodata", "-9999")),
    RealMap("bigtujunga_crop.asc"),
    RealMap("bigtujunga_smooth.asc"),
    RealMap("uma_rescue_crop.asc"),
    RealMap("uma_smooth.asc"),
    RealMap("herodotus_mons.tif", band=2, options={"height_band": 2}),
    RealMap("aristarchus_plateau.tif", band=3, options={"height_band": 3}),
)


def run(*command: object) -> None:
    """A program of GDAL or GRASS; what it prints is of no interest."""
    subprocess.run([str(part) for part in command], check=True, capture_output=True)


def row(cells: Sequence[str]) -> str:
    """A line of a table."""
    return f"| {' | '.join(cells)} |"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; the first column is text, the others are numbers."""
    rule = ["---", *["---:"] * (len(head) - 1)]
    return "\n".join([row(head), "|" + "|".join(rule) + "|", *map(row, rows)])


# Heights


def as_geotiff(made: RealMap, folder: Path, scratch: Path) -> Path:
    """The heights by GDAL alone; in metres of a plane, where the map is in degrees."""
    plain, target = scratch / "plain.tif", scratch / "heights.tif"
    given = ("-b", made.band, "-ot", "Float64", *made.declared)
    run("gdal_translate", "-q", *given, made.source(folder), plain)
    if made.name not in UTM:
        return plain
    warp = ("-q", "-overwrite", "-t_srs", UTM[made.name], "-r", "cubic", "-ot", "Float32")
    run("gdalwarp", *warp, "-dstnodata", "-9999", plain, target)
    return target


def samples(path: Path) -> tuple[Floats, Floats, str]:
    """(m, 2) centres of cells in the file's own coordinates, (m,) values, and the CRS."""
    with rasterio.open(path) as file:
        values = file.read(1, masked=True).astype(float).filled(np.nan)
        rows, columns = np.nonzero(np.isfinite(values))
        centres = np.stack(file.transform * (columns + 0.5, rows + 0.5), axis=-1)
        return centres, values[rows, columns], file.crs.to_wkt() if file.crs else ""


def on_plane(surface: tp.Surface, points: Floats, crs: str) -> Floats:
    """Coordinates of a file, as those of the surface's plane."""
    if not crs or surface.georeference is None:
        return points
    there = Transformer.from_crs(crs, surface.georeference.crs, always_xy=True)
    return np.stack(there.transform(*points.T), axis=-1)


def known(surface: tp.Surface, places: Floats) -> npt.NDArray[np.bool_]:
    """Which places are on ground that has data."""
    assert surface.bounds is not None
    inside = np.asarray(surface.bounds.contains(places), np.bool_)
    return inside & ~is_blocked(surface.nodata, places)


def is_blocked(mask: tp.Mask | None, places: Floats) -> npt.NDArray[np.bool_]:
    """Which places lie in blocked cells."""
    if mask is None:
        return np.zeros(len(places), np.bool_)
    steps = [(axis[1] - axis[0], axis) for axis in (mask.x, mask.y)]
    i, j = (np.rint((places[:, k] - a[0]) / d).astype(int) for k, (d, a) in enumerate(steps))
    inside = (i >= 0) & (j >= 0) & (i < len(mask.x)) & (j < len(mask.y))
    inside &= mask.blocked[np.where(inside, j, 0), np.where(inside, i, 0)]
    return np.asarray(inside)


def heights_row(made: RealMap, folder: Path, scratch: Path) -> list[str]:
    """Size, unit, seconds to read, and the heights' error against the file."""
    started = time.perf_counter()
    surface = tp.read_surface(folder / made.name, **made.options)
    seconds = time.perf_counter() - started
    plain = scratch / "plain.tif"
    as_geotiff(made, folder, scratch)
    points, values, crs = samples(plain)
    places = on_plane(surface, points, crs)
    there = known(surface, places)
    off = surface.values(places[there])[:, 0] - values[there]
    with rasterio.open(plain) as file:
        size, cell = f"{file.width} x {file.height}", f"{file.res[0]:.4g}"
    place = "no CRS" if surface.georeference is None else surface.georeference.name
    errors = [f"{np.sqrt(np.mean(off**2)):.2g}", f"{np.abs(off).max():.2g}"]
    unit = surface.layers[0].unit or "not said"
    return [made.name, size, cell, place.replace("_", " ")[:40], unit, *errors, f"{seconds:.2f}"]


# Slopes


def slopes_row(made: RealMap, folder: Path, scratch: Path) -> list[str]:
    """Share of the known cells steeper than each limit, here and by gdaldem; how many agree."""
    surface, slope = tp.read_surface(folder / made.name, **made.options), scratch / "slope.tif"
    run("gdaldem", "slope", "-q", "-compute_edges", as_geotiff(made, folder, scratch), slope)
    points, theirs, crs = samples(slope)
    places = on_plane(surface, points, crs)
    there = known(surface, places)
    places, theirs = places[there], theirs[there]
    cells = [made.name]
    assert surface.bounds is not None
    for limit in LIMITS:
        ours = is_blocked(SlopeLimit(surface, limit, surface.bounds).mask, places)
        agree = (ours == (theirs > limit)).mean()
        cells += [f"{ours.mean():.2%} / {(theirs > limit).mean():.2%} ({agree:.2%})"]
    return cells


# Plans


def asked(surface: tp.Surface, **limits: Any) -> tp.Problem | None:
    """A plan across the map; None where no two of the places are on one part of free ground."""
    assert surface.bounds is not None
    low = np.array(surface.bounds[:2])
    sides = np.array([surface.bounds.width, surface.bounds.height])
    for start, goal in ENDS:
        ends = (tuple(low + share * sides) for share in (start, goal))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", tp.SnapWarning)
            problem = tp.Problem(surface, *ends, snap=0.5 * float(sides.min()), **limits)
        if not problem.is_unreachable:
            return problem
    return None


def plan_row(name: str, how: str, problem: tp.Problem | None, picture: Path | None) -> list[str]:
    """What the best planner finds within its time."""
    if problem is None:
        return [name, how, "unreachable", "", "", "", ""]
    solution = tp.plan(problem, "optimal", time_limit=TIME_LIMIT)
    if picture is not None:
        tp.plot_route(solution, picture)
    if solution.path is None or solution.value is None:
        return [name, how, str(solution.status), "", "", "", f"{solution.seconds:.1f}"]
    path, gap = solution.path, solution.gap
    return [
        name,
        how,
        f"{path.ground_length:,.1f} {path.ground_unit}".rstrip(),
        f"{path.climb:,.1f} / {path.descent:,.1f}",
        f"{solution.value:,.1f} {solution.unit}".rstrip(),
        "" if gap is None else f"{gap:.2%}",
        f"{solution.seconds:.1f}",
    ]


def plans(made: RealMap, folder: Path, pictures: Path | None) -> Iterator[list[str]]:
    """Rows of the plans on a map: by its length, with weighted heights, under a slope limit."""
    surface = tp.read_surface(folder / made.name, **made.options)
    heavy = surface.with_weights({"height": HEAVY})
    for how, ground, limits in (
        ("shortest on the ground", surface, {}),
        (f"height x {HEAVY:g}", heavy, {}),
        (f"slope at most {MOST_SLOPE:g} degrees", surface, {"max_slope": MOST_SLOPE}),
    ):
        picture = None
        if pictures is not None:
            picture = pictures / f"{Path(made.name).stem}-{how.split()[0]}-{len(limits)}.png"
        yield plan_row(made.name, how, asked(ground, **limits), picture)


# r.walk


def walked(heights: Path, start: Floats, goal: Floats, scratch: Path) -> Floats:
    """The route of GRASS's r.walk, knight's moves included, in the map's coordinates (m, 2)."""
    out, placed = scratch / "walk.csv", scratch / "placed.tif"
    from_, to = ",".join(map(str, start)), ",".join(map(str, goal))
    # GRASS wants some CRS in metres; the coordinates stay as they are.
    run("gdal_translate", "-q", "-a_srs", "EPSG:32631", heights, placed)
    lines = [
        f"r.in.gdal -o --q input={placed} output=dem",
        "g.region raster=dem",
        "r.mapcalc --q expression='flat = if(isnull(dem), null(), 0)'",
        f"r.walk -k --q elevation=dem friction=flat output=cost outdir=back "
        f"start_coordinates={from_}",
        f"r.path --q input=back format=degree vector_path=route start_coordinates={to}",
        f"v.out.ascii --q input=route format=standard output={out}",
    ]
    script = scratch / "walk.sh"
    script.write_text("set -e\n" + "\n".join(lines) + "\n", encoding="utf-8")
    run("grass", "-c", placed, scratch / "grass", "-e")
    run("grass", scratch / "grass" / "PERMANENT", "--exec", "bash", script)
    words = [line.split() for line in out.read_text(encoding="utf-8").splitlines()]
    points = [(float(w[0]), float(w[1])) for w in words if len(w) == 2 and is_number(w[0])]
    return np.array(points)[::-1]


def walk_row(made: RealMap, folder: Path, scratch: Path) -> list[str]:
    """Walking times, both by r.walk's own formula (Langmuir) along the routes as they lie."""
    surface = tp.read_surface(folder / made.name, **made.options)
    problem = asked(surface)
    assert problem is not None
    with_time = tp.Problem(surface, problem.start, problem.goal, travel=tp.travel.langmuir())
    ours = tp.plan(with_time, "a-star", neighbours=32, refine=True)
    heights = as_geotiff(made, folder, scratch)
    _, _, crs = samples(heights)
    ends = np.array([problem.start, problem.goal])
    if crs and surface.georeference is not None:
        back = Transformer.from_crs(surface.georeference.crs, crs, always_xy=True)
        ends = np.stack(back.transform(*ends.T), axis=-1)
    found = on_plane(surface, walked(heights, ends[0], ends[1], scratch), crs)
    theirs = with_time.path(np.vstack([problem.start, found[1:-1], problem.goal]))
    assert ours.path is not None
    times = [f"{path.value / 60.0:,.2f} min" for path in (ours.path, theirs)]
    lengths = [f"{path.ground_length:,.0f} m" for path in (ours.path, theirs)]
    return [made.name, *times, f"{theirs.value / ours.path.value - 1.0:.1%}", *lengths]


def tables(folder: Path, pictures: Path | None) -> Iterator[str]:
    """All tables, one after another."""
    maps = [made for made in MAPS if (folder / made.name).exists()]
    with tempfile.TemporaryDirectory() as scratch_name:
        scratch = Path(scratch_name)
        head = ["map", "cells", "cell", "place", "heights in", "rms error", "largest", "seconds"]
        if shutil.which("gdaldem") is not None:
            yield "Heights\n\n" + table(head, [heights_row(m, folder, scratch) for m in maps])
            head = ["map", *(f"above {limit:g} degrees" for limit in LIMITS)]
            yield "Slopes\n\n" + table(head, [slopes_row(m, folder, scratch) for m in maps])
        head = ["map", "plan", "ground length", "climb / descent", "value", "gap", "seconds"]
        yield "Plans\n\n" + table(head, [r for m in maps for r in plans(m, folder, pictures)])
        if shutil.which("grass") is not None:
            head = ["map", "here", "r.walk", "more", "length here", "r.walk's"]
            rows = []
            for number, made in enumerate(maps):
                own = scratch / str(number)
                own.mkdir()
                rows.append(walk_row(made, folder, own))
            yield "Walking\n\n" + table(head, rows)


def main(arguments: Sequence[str]) -> int:
    """Print the tables."""
    warnings.simplefilter("ignore", tp.MapWarning)  # the documentation says what they say
    parser = argparse.ArgumentParser(prog="python -m benchmarks.real_maps", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--pictures", type=Path)
    given = parser.parse_args(arguments)
    if given.pictures is not None:
        given.pictures.mkdir(parents=True, exist_ok=True)
    for text in tables(given.folder, given.pictures):
        print(text, end="\n\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
