"""What inputs reach: pipes, archives that swell, and files that take their data from elsewhere."""

import json
import os
import subprocess
import sys
import zipfile

import geopandas
import numpy as np
import pytest
import shapely

import terrapath as tp
from common import one_line
from rasters import HEIGHTS, write
from terrapath._support import external
from terrapath._support.external import MOST_PACKED, reaches_out, require_moderate_archive
from terrapath.cli.main import run
from terrapath.surface.georeference import Georeference

PLACE = Georeference.from_projected("EPSG:32633")
ROUTE = "[route]\nstart = [500015, 4000015]\ngoal = [500085, 4000105]\n"
PLANNER = '[planner]\nname = "dijkstra"\nbound = false\nrefine = false\n'


# Pipes

AS = {
    "a map": lambda pipe, dem: ["plan", pipe],
    "a map in a name of GDAL": lambda pipe, dem: ["plan", f'NETCDF:"{pipe}":height'],
    "a layer": lambda pipe, dem: ["plan", dem, "--layer", f"rocks={pipe}"],
    "a cost": lambda pipe, dem: ["plan", dem, "--cost", f"going={pipe}:1*2"],
    "obstacles": lambda pipe, dem: ["plan", dem, "--obstacles", pipe],
    "an area": lambda pipe, dem: ["plan", dem, "--keep-in", pipe],
    "a scenario": lambda pipe, dem: ["plan", pipe.rename(pipe.with_suffix(".toml"))],
    "a certificate": lambda pipe, dem: ["check", dem, pipe],
    "a map to begin with": lambda pipe, dem: ["init", pipe, "--output", dem.with_suffix(".toml")],
}  # fmt: skip


RUN = """
import json, sys
from terrapath.cli.main import run
for arguments in json.loads(sys.argv[1]):
    print(int(run(arguments)), flush=True)
"""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes with names")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    calls = []
    for k, make in enumerate(AS.values()):
        (folder := tmp_path / str(k)).mkdir()
        os.mkfifo(pipe := folder / ("pipe" + (".tif", ".nc", ".geojson")[k % 3]))
        calls.append([*map(str, make(pipe, tmp_path / "dem.tif"))])
    write(tmp_path / "dem.tif", HEIGHTS)
    ends = ["--start", "500015,4000015", "--goal", "500085,4000105"]
    calls = [[*call, *(ends if call[0] == "plan" else [])] for call in calls]
    done = subprocess.run(
        [sys.executable, "-c", RUN, json.dumps(calls)],
        capture_output=True,
        text=True,
        timeout=180,
        check=False,
    )
    assert done.stdout.split() == ["2"] * len(calls), done.stdout + done.stderr
    lines = done.stderr.splitlines()
    assert len(lines) == len(calls)
    assert all("pipe" in line for line in lines)


# Archives


def test_an_archive_that_swells_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(external, "SMALL", 2**20)
    bomb = tmp_path / "bomb.zip"
    with (
        zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive,
        archive.open("a.xyz", "w") as out,
    ):
        for _ in range(30):
            out.write(bytes(2**20))
    assert MOST_PACKED * bomb.stat().st_size < 30 * 2**20
    for call in (
        lambda: tp.read_obstacles(bomb, None),
        lambda: tp.read_surface(f"/vsizip/{bomb}/a.xyz"),
        lambda: tp.read_surface(f"zip://{bomb}!a.xyz"),
        lambda: tp.read_surface(f"/vsizip/{{{bomb}}}/a.xyz"),
    ):
        with pytest.raises(tp.MapError, match="GiB in") as caught:
            call()
        assert "unpack it yourself" in one_line(caught)


def test_an_ordinary_archive_is_read(tmp_path):
    dem = write(tmp_path / "dem.tif", HEIGHTS)
    with zipfile.ZipFile(tmp_path / "maps.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(dem, "dem.tif")
    require_moderate_archive(tmp_path / "maps.zip", allow_external=False)
    surface = tp.read_surface(f"/vsizip/{tmp_path}/maps.zip/dem.tif")
    assert surface.bounds == tp.read_surface(dem).bounds


# Virtual files


def virtual(path, source, relative=0):
    path.write_text(
        "<VRTDataset rasterXSize='10' rasterYSize='12'><SRS>EPSG:32633</SRS>"
        "<GeoTransform>500000,10,0,4000120,0,-10</GeoTransform>"
        "<VRTRasterBand dataType='Float64' band='1'><SimpleSource>"
        f"<SourceFilename relativeToVRT='{relative}'>{source}</SourceFilename>"
        "<SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"
    )
    return path


@pytest.fixture
def folders(tmp_path):
    """(folder, elsewhere), with a map in each."""
    for name in ("here", "elsewhere"):
        (tmp_path / name).mkdir()
        write(tmp_path / name / "dem.tif", HEIGHTS)
    return tmp_path / "here", tmp_path / "elsewhere"


@pytest.mark.parametrize("name", ["map.vrt", "map.tif", "map"])
def test_a_virtual_raster_reads_beside_it_and_elsewhere_only_with_leave(folders, name):
    here, elsewhere = folders
    for source, relative in (("dem.tif", 1), (here / "dem.tif", 0), ("../elsewhere/dem.tif", 1)):
        assert tp.read_surface(virtual(here / name, source, relative)).nodata is None
    path = virtual(here / name, elsewhere / "dem.tif")
    with pytest.raises(tp.MapError, match="is elsewhere") as caught:
        tp.read_surface(path)
    assert "--allow-external" in one_line(caught)
    assert tp.read_surface(path, allow_external=True).nodata is None
    with pytest.raises(tp.MapError, match="is elsewhere"):
        tp.read_surface(here / "dem.tif", layers={"rocks": path})
    outer = virtual(here / "outer.vrt", name, 1)
    with pytest.raises(tp.MapError, match="is elsewhere"):
        tp.read_surface(outer)


NETWORK = [
    "https://example.org/dem.tif", "/vsicurl/https://example.org/dem.tif", "/vsis3/bucket/dem.tif",
    "/vsizip//vsicurl/https://example.org/a.zip/dem.tif", "/vsizip//etc/maps.zip/dem.tif",
    "WMS:https://example.org", "PG:dbname=maps", "vrt:///etc/passwd", "/etc/passwd",
    'NETCDF:"/etc/maps.nc":height', "/vsistdin/",
]  # fmt: skip


@pytest.mark.parametrize("source", NETWORK)
def test_no_virtual_raster_reaches_the_network_without_leave(tmp_path, source):
    with pytest.raises(tp.MapError, match="is elsewhere"):
        tp.read_surface(virtual(tmp_path / "map.vrt", source.replace('"', "&quot;")))
    assert reaches_out(source, tmp_path)


@pytest.mark.parametrize(
    "source", ["a.tif", "../a.tif", 'NETCDF:"a.nc":b', "/vsizip/a.zip/b.tif", "a.gpkg:lakes"]
)
def test_names_in_the_folder_and_near_it_need_no_leave(tmp_path, source):
    assert not reaches_out(source, tmp_path)


def test_services_and_virtual_vectors_need_leave(tmp_path):
    service = tmp_path / "tiles.tif"
    service.write_text(
        "<GDAL_WMS><Service name='TMS'><ServerUrl>https://e.org/</ServerUrl></Service></GDAL_WMS>"
    )
    with pytest.raises(tp.MapError, match="service elsewhere"):
        tp.read_surface(service)
    frame = geopandas.GeoDataFrame(geometry=[shapely.box(0, 0, 1, 1)], crs="EPSG:32633")
    (tmp_path / "far").mkdir()
    (tmp_path / "near").mkdir()
    frame.to_file(tmp_path / "far" / "walls.gpkg")
    walls = tmp_path / "near" / "walls.vrt"
    walls.write_text(
        f"<OGRVRTDataSource><OGRVRTLayer name='walls'><SrcDataSource>{tmp_path}/far/walls.gpkg"
        "</SrcDataSource></OGRVRTLayer></OGRVRTDataSource>"
    )
    with pytest.raises(tp.MapError, match="is elsewhere"):
        tp.read_obstacles(walls, PLACE)
    assert len(tp.read_obstacles(walls, PLACE, allow_external=True)) == 1


@pytest.mark.parametrize(
    ("content", "shown"),
    [
        ('<!DOCTYPE a [<!ENTITY b "bb">]><VRTDataset>&b;</VRTDataset>', "entities"),
        ("<VRTDataset", "XML"),
        ("<VRTDataset>" + "<a>" * 100_000, "XML"),
    ],
)
def test_descriptions_that_would_swell_or_are_broken_are_refused(tmp_path, content, shown):
    (tmp_path / "map.vrt").write_text(content)
    with pytest.raises(tp.MapError, match=shown) as caught:
        tp.read_surface(tmp_path / "map.vrt")
    one_line(caught)


def inline(target):
    """XML of a virtual raster as a name: no file, and yet GDAL reads what it names."""
    return (
        "<VRTDataset rasterXSize='10' rasterYSize='12'><VRTRasterBand dataType='Float64' band='1'>"
        f"<SimpleSource><SourceFilename>{target}</SourceFilename></SimpleSource></VRTRasterBand>"
        "</VRTDataset>"
    )


def escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;")


@pytest.mark.parametrize("before", ["", " \n", "x"])
@pytest.mark.parametrize("depth", [1, 2])
def test_a_description_in_a_name_reaches_out(folders, before, depth):
    here, elsewhere = folders
    source = elsewhere / "dem.tif"
    for _ in range(depth):
        source = escaped(before + inline(source))
    path = virtual(here / "map.vrt", source)
    with pytest.raises(tp.MapError, match="is elsewhere") as caught:
        tp.read_surface(path)
    assert "--allow-external" in one_line(caught)
    if not before.strip():
        assert tp.read_surface(path, allow_external=True).nodata is None
    assert reaches_out('{"type": "gdal_streamed_alg"}', here)


def test_a_name_in_an_attribute_is_a_name_too(folders):
    here, elsewhere = folders
    path = virtual(here / "map.vrt", "dem.tif", 1)
    text = path.read_text().replace(
        "<SourceFilename relativeToVRT='1'>dem.tif</SourceFilename>", ""
    )
    path.write_text(
        text.replace("<SimpleSource>", f"<SimpleSource SourceFilename='{elsewhere}/dem.tif'>")
    )
    assert tp.read_surface(path, allow_external=True).nodata is None  # GDAL reads it
    with pytest.raises(tp.MapError, match="is elsewhere"):
        tp.read_surface(path)


def test_other_elements_of_virtual_rasters_name_files_too(folders):
    here, elsewhere = folders
    path = virtual(here / "map.vrt", "dem.tif", 1)
    plain = path.read_text()
    for element, shown in (
        (f"<OpenOptions><OOI key='GFS_TEMPLATE'>{elsewhere}/a.gfs</OOI></OpenOptions>", "opens"),
        (f"<Metadata><MDI key='X_DATASET'>{elsewhere}/x.tif</MDI></Metadata>", "is elsewhere"),
        (f"<Argument name='gain_dataset_filename_1'>{elsewhere}/x.tif</Argument>", "is elsewhere"),
        (f"<RPCTransformer><DEMPath>{elsewhere}/x.tif</DEMPath></RPCTransformer>", "is elsewhere"),
    ):
        path.write_text(plain.replace("</VRTDataset>", f"{element}</VRTDataset>"))
        with pytest.raises(tp.MapError, match=shown) as caught:
            tp.read_surface(path)
        assert "--allow-external" in one_line(caught)
    harmless = "<OpenOptions><OOI key='NUM_THREADS'>2</OOI></OpenOptions>"
    path.write_text(plain.replace("</SimpleSource>", f"{harmless}</SimpleSource>"))
    assert tp.read_surface(path).nodata is None


@pytest.mark.parametrize("name", ["missing.tif", "folder", "/vsizip/maps.zip/map.vrt", "@dummy@"])
def test_a_source_that_cannot_be_looked_into_is_refused(folders, name):
    here, elsewhere = folders
    (here / "folder").mkdir()
    with zipfile.ZipFile(here / "maps.zip", "w") as archive:
        archive.write(virtual(here / "map.vrt", elsewhere / "dem.tif"), "map.vrt")
    with pytest.raises(tp.MapError, match="no file that can be looked into") as caught:
        tp.read_surface(virtual(here / "outer.vrt", name, 1))
    assert "--allow-external" in one_line(caught)


def test_a_driver_and_a_file_in_a_name_are_looked_into(folders):
    here, elsewhere = folders
    virtual(here / "a.nc", elsewhere / "dem.tif")
    with pytest.raises(tp.MapError, match=r"dem\.tif.*is elsewhere"):
        tp.read_surface(virtual(here / "map.vrt", "NETCDF:a.nc:band1", 1))


def test_an_archive_holds_no_description_without_leave(folders):
    here, elsewhere = folders
    for maps in (here / "maps.zip", here / "maps.kmz"):
        with zipfile.ZipFile(maps, "w") as archive:
            archive.write(virtual(here / "map.vrt", elsewhere / "dem.tif"), "map.vrt")
    name = f"/vsizip/{here}/maps.zip/map.vrt"
    assert tp.read_surface(name, allow_external=True).nodata is None
    for call in (
        lambda: tp.read_surface(name),
        lambda: tp.read_obstacles(here / "maps.zip", PLACE),
        lambda: tp.read_obstacles(here / "maps.kmz", PLACE),
    ):
        with pytest.raises(tp.MapError, match="only says where the data are") as caught:
            call()
        assert "--allow-external" in one_line(caught)


def test_virtual_vectors_name_no_description_and_no_query(folders):
    here, elsewhere = folders
    frame = geopandas.GeoDataFrame(geometry=[shapely.box(0, 0, 1, 1)], crs="EPSG:32633")
    for folder in folders:
        frame.to_file(folder / "walls.gpkg")
    walls = here / "walls.vrt"

    def layer(source, more=""):
        return (
            "<OGRVRTDataSource><OGRVRTLayer name='walls'><SrcDataSource relativeToVRT='1'>"
            f"{source}</SrcDataSource>{more}</OGRVRTLayer></OGRVRTDataSource>"
        )

    walls.write_text(layer("walls.gpkg"))
    assert len(tp.read_obstacles(walls, PLACE)) == 1
    query = f"<SrcSQL>SELECT * FROM '{elsewhere}/walls.gpkg'.walls</SrcSQL>"
    for text, shown in (
        (layer(escaped(layer(f"{elsewhere}/walls.gpkg"))), "is elsewhere"),
        (layer("missing.gpkg"), "no file that can be looked into"),
        (layer("walls.gpkg", query), "query"),
    ):
        walls.write_text(text)
        with pytest.raises(tp.MapError, match=shown):
            tp.read_obstacles(walls, PLACE)


@pytest.mark.parametrize("name", ["ST_A", "NITFMap", "GDAL_WMS", "GDALTileIndexDataset"])
def test_maps_and_vectors_go_through_one_door(tmp_path, name):
    path = tmp_path / "map.tif"
    path.write_text(f"<{name}></{name}>")
    for read in (tp.read_surface, lambda path: tp.read_obstacles(path, PLACE)):
        with pytest.raises(tp.MapError, match="service elsewhere"):
            read(path)


def test_the_picture_of_a_nav2_map_reaches_out_only_with_leave(folders):
    here, elsewhere = folders
    write(elsewhere / "shades.tif", np.full((12, 10), 254, np.uint8))
    virtual(here / "map.pgm", elsewhere / "shades.tif")
    text = (here / "map.pgm").read_text().replace("Float64", "Byte")
    (here / "map.pgm").write_text(text)
    (here / "map.yaml").write_text("image: map.pgm\nresolution: 0.5\norigin: [0, 0, 0]\n")
    with pytest.raises(tp.MapError, match="is elsewhere") as caught:
        tp.read_surface(here / "map.yaml")
    assert "--allow-external" in one_line(caught)
    tp.read_surface(here / "map.yaml", allow_external=True)


def test_virtual_rasters_that_name_each_other_are_refused(tmp_path):
    virtual(tmp_path / "a.vrt", "b.vrt", 1)
    virtual(tmp_path / "b.vrt", "a.vrt", 1)
    with pytest.raises(tp.MapError, match="name one another"):
        tp.read_surface(tmp_path / "a.vrt")


# Scenarios


def scenario(folder, text):
    path = folder / "scenario.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("name", [*NETWORK, "{elsewhere}/dem.tif"])
def test_a_scenario_reads_elsewhere_only_with_leave(folders, capsys, name):
    here, elsewhere = folders
    name = name.format(elsewhere=elsewhere)
    for text in (
        f"[map]\npath = '{name}'\n{ROUTE}",
        f"[map]\npath = 'dem.tif'\nlayers.rocks = {{ file = '{name}' }}\n{ROUTE}",
        f"[map]\npath = 'dem.tif'\n{ROUTE}[constraints]\nobstacles = ['{name}']\n",
        f"[map]\npath = 'dem.tif'\n{ROUTE}[constraints]\nkeep_in = '{name}'\n",
    ):
        assert run(["plan", str(scenario(here, text + PLANNER))]) == 2
        assert "which is elsewhere" in capsys.readouterr().err


def test_leave_is_the_users_to_give(folders, capsys):
    here, elsewhere = folders
    text = f"[map]\npath = '{elsewhere}/dem.tif'\n{ROUTE}{PLANNER}"
    file = str(scenario(here, text))
    assert run(["plan", file, "--allow-external"]) == 0
    assert tp.scenario.load(file, allow_external=True).map.path == f"{elsewhere}/dem.tif"
    scenario(here, text.replace("[map]\n", "[map]\nallow_external = true\n"))
    assert run(["plan", file]) == 2
    assert run(["plan", file, "--allow-external"]) == 2
    assert "not for a file" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["{elsewhere}/r.csv", "../elsewhere/r.csv", "link/r.csv"])
def test_a_scenario_writes_elsewhere_only_with_leave(folders, capsys, name):
    here, elsewhere = folders
    (here / "link").symlink_to(elsewhere)
    name = name.format(elsewhere=elsewhere)
    text = f"[map]\npath = 'dem.tif'\n{ROUTE}{PLANNER}[output]\n"
    for key in ("plot", "profile", "page", "certificate"):
        assert run(["plan", str(scenario(here, f"{text}{key} = '{name}'\n"))]) == 2
    file = str(scenario(here, f"{text}files = ['{name}']\n"))
    assert run(["plan", file]) == 2
    assert "outside its folder" in capsys.readouterr().err
    assert not (elsewhere / "r.csv").exists()
    assert run(["plan", file, "--output", str(here / "own.csv")]) == 0  # the user's own
    assert run(["plan", file, "--allow-external"]) == 0
    assert (elsewhere / "r.csv").exists()


@pytest.mark.parametrize(("answer", "code"), [("y\n", 0), ("n\n", 2)])
def test_on_a_terminal_leave_is_asked(folders, monkeypatch, answer, code):
    here, elsewhere = folders
    text = f"[map]\npath = 'dem.tif'\n{ROUTE}{PLANNER}[output]\nfiles = ['{elsewhere}/r.csv']\n"
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    monkeypatch.setattr("typer.confirm", lambda text, err: answer == "y\n" and "outside" in text)
    assert run(["plan", str(scenario(here, text)), "--quiet"]) == code
    assert (elsewhere / "r.csv").exists() == (code == 0)


# What is left beside a file


def test_nothing_is_left_beside_gml(tmp_path):
    frame = geopandas.GeoDataFrame(geometry=[shapely.box(0, 0, 1, 1)], crs="EPSG:32633")
    frame.to_file(tmp_path / "walls.gml", driver="GML")
    for path in tmp_path.glob("*.xsd"):
        path.unlink()
    before = sorted(tmp_path.iterdir())
    assert len(tp.read_obstacles(tmp_path / "walls.gml", PLACE)) == 1
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("ending", [".geojson", ".gpkg", ".shp"])
def test_a_file_without_obstacles_is_told_and_blocks_nothing(tmp_path, ending):
    path = tmp_path / f"walls{ending}"
    geopandas.GeoDataFrame({"a": []}, geometry=[], crs="EPSG:32633").to_file(
        path, geometry_type="Polygon"
    )
    with pytest.warns(tp.VectorWarning, match="is empty"):
        assert tp.read_obstacles(path, PLACE) == []
    with pytest.raises(tp.MapError, match="is empty"):
        tp.read_area(path, PLACE)


# Headings that a spreadsheet would run


def test_headings_of_csv_are_text(tmp_path):
    values = np.stack([HEIGHTS, HEIGHTS, HEIGHTS, HEIGHTS])
    names = ["height", "=cmd|' /C calc'!A0", "@SUM(A1)", "-1+1"]
    x, y = np.arange(10.0), np.arange(12.0)
    surface = tp.Surface.from_grid(values, x, y, names=names)
    solution = tp.plan(tp.Problem(surface, (1, 1), (8, 9)), "dijkstra")
    tp.write_route(solution, tmp_path / "route.csv")
    heading = (tmp_path / "route.csv").read_text().splitlines()[0].split(",")
    assert not [cell for cell in heading if cell.strip('"').startswith(("=", "+", "-", "@"))]
