"""What is not needed for planning on an array or a raster: done without, or asked for in a line."""

import ast
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin
from scipy.io import netcdf_file

import terrapath as tp
from common import ROOT
from processes import in_another_process
from terrapath._support.extras import EXTRA_OF, require_packages
from terrapath.cli.main import run

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]


def names_of(requirements):
    """The packages of requirements, without versions."""
    return {text.split(">")[0] for text in requirements}


def test_each_package_of_an_extra_has_its_extra():
    asked = {package: extra for extra in set(EXTRA_OF.values()) for package in EXTRAS[extra]}
    assert {package.split(">")[0]: extra for package, extra in asked.items()} == EXTRA_OF
    (everything,) = EXTRAS["all"]
    assert set(everything.removeprefix("terrapath[").removesuffix("]").split(",")) == set(
        EXTRA_OF.values()
    )


def imported_packages(file):
    """Packages outside this one that a module imports, and outside the standard library."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.split(".")[0]


def test_what_is_imported_is_declared():
    declared = names_of(PROJECT["dependencies"]) | EXTRA_OF.keys() | names_of(EXTRAS["bench"])
    found = {
        name for file in ROOT.glob("src/**/*.py") for name in imported_packages(file)
    } - sys.stdlib_module_names
    installed_by = packages_distributions()  # none for a peer of the benchmarks that is missing
    strangers = {name for name in found if not declared.issuperset(installed_by.get(name, ()))}
    # The first is a part of Numba; only type checkers read the second, and bring it.
    assert strangers <= {"llvmlite", "typing_extensions"}


@pytest.fixture
def hide(monkeypatch):
    """Makes packages look as if they were not installed."""
    return lambda *names: [monkeypatch.setitem(sys.modules, name, None) for name in names]


@pytest.fixture
def maps(tmp_path, monkeypatch):
    """A GeoTIFF in degrees, a netCDF file of the classic format, and a file of obstacles."""
    monkeypatch.chdir(tmp_path)
    x, y = np.meshgrid(np.linspace(0.0, 3.0, 40), np.linspace(0.0, 3.0, 30))
    heights = 100.0 * np.sin(x) * np.cos(y)
    profile = {"width": 40, "height": 30, "count": 1, "dtype": "float64", "crs": "EPSG:4326"}
    place = from_origin(10.0, 47.0, 0.0003, 0.0003)
    with rasterio.open("dem.tif", "w", driver="GTiff", transform=place, **profile) as dataset:
        dataset.write(heights, 1)
    with netcdf_file("dem.nc", "w") as file:
        for name, count in (("y", 30), ("x", 40)):
            file.createDimension(name, count)
            file.createVariable(name, "d", (name,))[:] = np.arange(count)
        file.createVariable("height", "d", ("y", "x"))[:] = heights
    Path("fence.geojson").write_text(
        '{"type": "Point", "coordinates": [10.006, 46.996]}', encoding="utf-8"
    )


ENDS = ("--start", "10.001,46.999", "--goal", "10.011,46.992", "--samples", "300", "--no-bound")
IN_DEGREES = ("dem.tif", *ENDS)


@pytest.mark.parametrize(
    ("package", "named", "arguments"),
    [
        ("pyogrio", "route.gpkg", (*IN_DEGREES, "--output", "route.gpkg")),
        ("gpxpy", "route.gpx", (*IN_DEGREES, "--output", "route.gpx")),
        ("rosbags", "route.bag2", (*IN_DEGREES, "--output", "route.bag2")),
        ("plotly", "route.html", (*IN_DEGREES, "--page", "route.html")),
        ("pyogrio", "fence.geojson", (*IN_DEGREES, "--obstacles", "fence.geojson")),
        ("pyogrio", "fence.geojson", (*IN_DEGREES, "--keep-in", "fence.geojson")),
        ("xarray", "dem.nc", ("dem.nc", "--start", "1,1", "--goal", "30,20")),
    ],
)
def test_a_missing_package_is_one_line_with_its_remedy(
    package, named, arguments, hide, maps, capsys
):
    hide(package)
    before = sorted(Path().iterdir())
    assert run(["plan", *arguments]) == 2
    said = capsys.readouterr()
    (line,) = said.err.splitlines()
    assert named in line
    assert f"the package {package}," in line
    assert line.endswith(f"pip install 'terrapath[{EXTRA_OF[package]}]'")
    assert said.out == ""
    assert sorted(Path().iterdir()) == before


def test_in_python_it_is_an_import_error_of_terrapath(hide, tmp_path):
    hide("sympy", "plotly", "gpxpy")
    with pytest.raises(tp.MissingExtraError, match=r"from_expression.*terrapath\[expressions\]"):
        tp.Surface.from_expression("x1", (0, 0, 1, 1))
    solution = tp.RRTStar(samples=200).solve(tp.scenes.load("one-peak"))
    with pytest.raises(ImportError, match=r"terrapath\[page\]"):
        tp.plot_page(solution, tmp_path / "route.html")
    with pytest.raises(tp.TerrapathError, match=r"terrapath\[gpx\]"):
        tp.write_route(solution, tmp_path / "route.gpx")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("package", EXTRA_OF)
def test_what_is_installed_is_not_asked_for(package, hide):
    require_packages("this", package)
    hide(package)
    with pytest.raises(tp.MissingExtraError, match=f"this needs the package {package}"):
        require_packages("this", package)


WITHOUT = (
    "import json, os, sys; sys.modules.update(dict.fromkeys({}))\n"
    "os.chdir({!r}); sys.stdout = sys.stderr\n"
    "from terrapath.cli.main import run\n"
    "print(json.dumps([run(arguments) for arguments in {}]), file=sys.__stdout__)"
)


def test_maps_are_planned_on_and_drawn_without_any_extra(maps, tmp_path):
    outputs = [f"route.{ending}" for ending in ("geojson", "csv", "json")]
    wanted = [part for name in outputs for part in ("--output", name)]
    commands = [
        ["plan", *IN_DEGREES, *wanted, "--plot", "route.png", "--profile", "profile.png"],
        ["field", "dem.tif", "--start", "10.001,46.999", "--output", "f.tif", "--plot", "f.png"],
        ["init", "dem.tif"],
        ["plan", "jacksboro", *ENDS[-3:], "--output", "there.geojson", "--plot", "there.png"],
    ]
    codes = in_another_process(WITHOUT.format(list(EXTRA_OF), str(tmp_path), commands))
    assert codes == [0, 0, 0, 0]
    made = {*outputs, "route.png", "profile.png", "f.tif", "f.png", "there.geojson", "there.png"}
    assert all((tmp_path / name).stat().st_size > 1000 for name in made)
