"""Several threads at once: the same answers, to the bit, and nothing of the process is touched."""

import os
import random
import stat
import sys
import threading
import warnings
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import rasterio
import xarray
from affine import Affine

import terrapath as tp
from terrapath.errors import collecting
from terrapath.surface.georeference import Georeference

pytestmark = pytest.mark.filterwarnings("ignore:Use `@` matmul:PendingDeprecationWarning")

THREADS = 8
ROUNDS = 6  # of all maps, in each thread
UTM = "EPSG:32633"
SIDE = 40


@contextmanager
def watched():
    """Another thread looks, again and again, whether what is the process's stays as it is."""
    changes, done = [], threading.Event()

    def state():
        return list(warnings.filters), warnings.showwarning, sys.excepthook, sys.unraisablehook

    def watch(before):
        while not done.wait(1e-4):
            if state() != before:
                changes.append("the hooks or the filters")

    def note(name):
        return lambda *_: changes.append(f"{name} by {sys._getframe(1).f_code.co_filename}")

    watcher = threading.Thread(target=watch, args=(state(),))
    watcher.start()
    try:
        with pytest.MonkeyPatch.context() as patch:
            # What may be too short to be seen, and what cannot be looked at without being set.
            patch.setattr(warnings.catch_warnings, "__enter__", note("filters"))
            patch.setattr(os, "umask", note("the umask"))
            patch.setattr(os, "chdir", note("the folder"))
            yield
    finally:
        done.set()
        watcher.join()
    assert set(changes) == set()


def in_threads(work, items):
    """work(item) of every item, several times over, in threads that start together."""
    start = threading.Barrier(THREADS)

    def run(number):
        order = random.Random(number)
        start.wait()
        names = [name for _ in range(ROUNDS) for name in order.sample(list(items), len(items))]
        return [(name, work(items[name])) for name in names]

    with ThreadPoolExecutor(THREADS) as pool:
        runs = list(pool.map(run, range(THREADS)))
    return [entry for found in runs for entry in found]


# Maps in


def heights(holes=False):
    y, x = np.mgrid[:SIDE, :SIDE]
    values = 100 + 20 * np.sin(x / 5) + 10 * np.cos(y / 7)
    if holes:
        values[10:14, 20:25] = -9999.0
    return values


def write_tiff(path, values, **profile):
    given = {"driver": "GTiff", "count": 1, "dtype": "float64", "nodata": -9999.0, **profile}
    height, width = values.shape
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(path, "w", height=height, width=width, **given) as file:
            file.write(values.astype(given["dtype"]), 1)
    return path


def write_asc(path, values, cell=30):
    rows = "\n".join(" ".join(f"{value:.3f}" for value in row) for row in values)
    head = f"ncols {SIDE}\nnrows {SIDE}\nxllcorner 500000\nyllcorner 4000000\ncellsize {cell}\n"
    path.write_text(f"{head}NODATA_value -9999\n{rows}\n")
    return path


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """Options of read_surface by name."""
    folder = tmp_path_factory.mktemp("maps")
    place = {"crs": UTM, "transform": Affine(30.0, 0.0, 500_000.0, 0.0, -30.0, 4_001_200.0)}
    degrees = {"crs": "EPSG:4326", "transform": Affine(1e-3, 0.0, 10.0, 0.0, -1e-3, 46.0)}
    plain = write_tiff(folder / "plain.tif", heights(), **place)
    holes = write_tiff(folder / "holes.tif", heights(holes=True), **place, compress="deflate")
    metres = write_tiff(folder / "whole.tif", heights(), **{**place, "dtype": "int16"})
    damaged = folder / "damaged.tif"
    damaged.write_bytes(holes.read_bytes()[:900])
    broken = folder / "broken.asc"
    broken.write_bytes(write_asc(broken, heights()).read_bytes()[:300] + b" \xff\xfe\x80 9e999 x\n")
    axes = {"y": 30.0 * np.arange(SIDE)[::-1], "x": 30.0 * np.arange(SIDE)}
    array = xarray.DataArray(heights(), coords=axes, dims=("y", "x"), name="height")
    array.to_dataset().to_netcdf(folder / "classic.nc", engine="scipy", format="NETCDF3_64BIT")
    array.to_dataset().to_netcdf(folder / "four.nc", engine="h5netcdf")
    return {
        "plain": {"source": plain},
        "coarser": {"source": plain, "decimate": 3},
        "part": {"source": plain, "within": (500_300, 4_000_300, 500_900, 4_000_900)},
        "holes": {"source": holes, "fill_holes": 1000.0},
        "holes that stay": {"source": holes},
        "holes, coarser": {"source": holes, "decimate": 2},
        "whole metres": {"source": metres},
        "degrees": {"source": write_tiff(folder / "degrees.tif", heights(), **degrees)},
        "layers": {
            "source": plain,
            "layers": {"other": f"{holes}*0.5"},
            "costs": {"more": folder / "plain.tif"},
        },
        "no georeference": {"source": write_tiff(folder / "nowhere.tif", heights() / 1000)},
        "ascii": {"source": write_asc(folder / "grid.asc", heights(holes=True)), "crs": UTM},
        "classic netcdf": {"source": folder / "classic.nc"},
        "netcdf": {"source": xarray.open_dataset(folder / "four.nc").load()},
        "damaged": {"source": damaged},
        "broken": {"source": broken},
        "missing": {"source": folder / "missing.tif"},
    }


def bits(surface):
    """All that a surface is made of."""
    data = surface.data
    arrays = [data.coefficients, data.weights, data.log_cost]
    if surface.nodata is not None:
        arrays += [surface.nodata.blocked, surface.nodata.x, surface.nodata.y]
    place = surface.georeference and surface.georeference.crs.to_wkt()
    return [array.tobytes() for array in arrays], data[2:6], str(surface), place


def read(options):
    """The bits of a surface, or what is wrong with its map."""
    try:
        return bits(tp.read_surface(**options))
    except tp.TerrapathError as error:
        return str(error)


# What rasterio prints of a message that is no text goes by the interpreter's hook.
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_maps_are_read_in_threads_as_in_one(maps):
    alone = {name: read(options) for name, options in maps.items()}
    assert {name for name, found in alone.items() if isinstance(found, str)} == {
        "damaged",
        "broken",
        "missing",
    }
    with watched():
        for name, found in in_threads(read, maps):
            assert found == alone[name], name


def test_an_open_map_reads_what_maps_opened_anew_read(maps):
    from terrapath.io import open_map

    for options in (maps["layers"], maps["degrees"], maps["netcdf"], maps["classic netcdf"]):
        given = {key: value for key, value in options.items() if key != "source"}
        west, south, east, north = (0.0, 0.0, 600.0, 600.0)
        if options is maps["layers"]:
            west, south, east, north = 500_300, 4_000_300, 500_900, 4_000_900
        if options is maps["degrees"]:
            west, south, east, north = 10.01, 45.97, 10.03, 45.99
        window = (west, south, east, north)
        with open_map(options["source"], **given) as opened:
            assert opened.cells() == SIDE * SIDE
            assert opened.cells(window) < SIDE * SIDE
            for asked in ({}, {"decimate": 2}, {"within": window, "margin": 50.0}, {}):
                expected = bits(tp.read_surface(**options, **asked))
                assert bits(opened.surface(**asked)) == expected


def test_an_open_map_opens_each_file_once(maps, monkeypatch):
    from terrapath.io import open_map, rasters

    opened, make = [], rasters._dataset

    def note(path):
        opened.append(Path(path).name)
        return make(path)

    monkeypatch.setattr(rasters, "_dataset", note)
    options = maps["layers"]
    with open_map(options["source"], layers=options["layers"], costs=options["costs"]) as found:
        found.cells()
        assert opened == ["plain.tif"]
        found.surface()
        found.surface(decimate=2)
        found.cells()
    assert opened == ["plain.tif", "holes.tif", "plain.tif"]


def test_the_files_of_an_open_map_are_closed_with_it(maps):
    from terrapath.io import open_map

    with pytest.raises(ValueError, match="mine"), open_map(maps["plain"]["source"]) as opened:
        raise ValueError("mine")
    with pytest.raises(tp.InputError, match=r"plain\.tif is closed; use the map inside open_map"):
        opened.surface()


# Routes and fields out


def solution():
    """A route by RRT*-R over a map's ground."""
    axis = np.linspace(0.0, 1000.0, 33)
    x, y = np.meshgrid(axis, axis)
    place = Georeference.from_projected(UTM)
    surface = tp.Surface.from_grid(
        50 * np.sin(x / 200) * np.cos(y / 150),
        axis + 500_000,
        axis + 4_000_000,
        georeference=place,
        units=["m"],
    )
    ends = (500_100, 4_000_100), (500_900, 4_000_900)
    return tp.RRTStar(samples=300, step=100.0, seed=0).solve(tp.Problem(surface, *ends))


def contents(path):
    """Bytes by name, and who may read them. Bags have numbers of their own inside."""
    if path.is_dir():
        files = {file.name: file.read_bytes() for file in path.iterdir()}
        return files, stat.S_IMODE(path.stat().st_mode)
    return path.read_bytes(), stat.S_IMODE(path.stat().st_mode)


def test_routes_and_fields_are_written_in_threads_as_in_one(tmp_path):
    route = solution()
    field = tp.distance_field(route.problem.surface, route.problem.start)
    endings = (".geojson", ".gpkg", ".gpx", ".csv", ".json", ".bag2", ".tif", ".npz")
    numbers, one_at_a_time = iter(range(10_000)), threading.Lock()

    def write(ending):
        with one_at_a_time:
            path = tmp_path / str(next(numbers)) / f"route{ending}"
        path.parent.mkdir()
        if ending in {".tif", ".npz"}:
            tp.io.write_field(field, path)
        else:
            tp.write_route(route, path)
        assert [file.name for file in path.parent.iterdir()] == [path.name]
        return contents(path)

    alone = {ending: write(ending) for ending in endings}
    with watched():
        for ending, found in in_threads(write, {ending: ending for ending in endings}):
            assert found == alone[ending], ending


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_files_get_the_mode_that_the_process_gives(mask, tmp_path):
    before = os.umask(mask)
    try:
        route = solution()
        for ending in (".csv", ".gpkg", ".bag2"):
            tp.write_route(route, tmp_path / f"route{ending}")
        modes = {path.suffix: stat.S_IMODE(path.stat().st_mode) for path in tmp_path.iterdir()}
    finally:
        os.umask(before)
    assert modes == {".csv": 0o666 & ~mask, ".gpkg": 0o666 & ~mask, ".bag2": 0o777 & ~mask}


# Plans


PLANNERS = {
    "rrt-star-r": {"samples": 300, "step": 120.0, "seed": 1},
    "rrt": {"samples": 300, "step": 120.0, "seed": 2},
    "a-star": {"spacing": 20.0},
    "fast-marching": {"spacing": 20.0},
    "optimal": {"spacing": 20.0, "target_gap": 0.05},
}


def planned(problem, name):
    found = tp.plan(problem, name, **PLANNERS[name])
    return found.path.points.tobytes(), found.cost, found.lower_bound


def test_plans_on_one_problem_are_those_of_one_thread():
    def problem():
        surface, ends = solution().problem.surface, ((500_100, 4_000_100), (500_900, 4_000_900))
        block = tp.Circle(500_500, 4_000_500, 120.0)
        return tp.Problem(surface, *ends, obstacles=[block], max_slope=20.0, radius=5.0)

    alone = {name: planned(problem(), name) for name in PLANNERS}
    shared, start = problem(), threading.Barrier(2 * len(PLANNERS))

    def plan(name):
        start.wait()
        with collecting() as told:
            return name, planned(shared, name), told

    with watched(), ThreadPoolExecutor(2 * len(PLANNERS)) as pool:
        for name, found, told in pool.map(plan, 2 * list(PLANNERS)):
            assert found == alone[name], name
            assert told == []
