"""Obstacles and areas from vector files, against geopandas and pyproj."""

from __future__ import annotations

import json
import warnings
import zipfile

import geopandas
import numpy as np
import pytest
import shapely
from pyproj import CRS, Transformer

import terrapath as tp
from terrapath.surface.georeference import Georeference, local_projection

UTM = "EPSG:32633"
WEST, SOUTH, SIDE = 490_000.0, 5_500_000.0, 20_000.0
PLACE = Georeference.from_projected(UTM)
AXES = WEST + np.linspace(0, SIDE, 21), SOUTH + np.linspace(0, SIDE, 21)
SURFACE = tp.Surface.from_grid(np.zeros((21, 21)), *AXES, georeference=PLACE)
BARE = tp.Surface.from_grid(np.zeros((21, 21)), *AXES)
SHAPES = [
    shapely.box(495_000, 5_505_000, 496_000, 5_506_000)
    - shapely.box(495_200, 5_505_200, 495_500, 5_505_500),
    shapely.LineString([(491_000, 5_501_000), (498_000, 5_519_000)]),
    shapely.MultiPoint([(500_000, 5_510_000), (501_000, 5_511_000)]),
    shapely.MultiPolygon([shapely.box(505_000, k, 506_000, k + 900) for k in (5.502e6, 5.504e6)]),
]
TOLERANCE = 0.011  # metres


def frame(shapes, crs=UTM, to=None):
    series = geopandas.GeoDataFrame({"name": ["a"] * len(shapes)}, geometry=list(shapes), crs=crs)
    return series if to is None else series.to_crs(to)


def write_geojson(path, geometries, **top):
    features = [{"type": "Feature", "properties": {}, "geometry": g} for g in geometries]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features, **top}))
    return path


def polygon(*corners):
    return {"type": "Polygon", "coordinates": [[*corners, corners[0]]]}


def read_quietly(reader, *arguments):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", tp.VectorWarning)
        return reader(*arguments)


def refused(reader, *arguments):
    """The one line that a call is refused with."""
    with pytest.raises(tp.TerrapathError) as caught:
        read_quietly(reader, *arguments)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def densely(shape, crs):
    """A shape whose edges are straight in a CRS, brought onto the plane in a thousand pieces."""
    move = Transformer.from_crs(crs, UTM, always_xy=True)
    cut = shapely.segmentize(shape, max(np.ptp(shapely.get_coordinates(shape), axis=0)) / 1000)
    return shapely.transform(cut, lambda xy: np.column_stack(move.transform(*xy.T)))


def nearest_of(found):
    """Which of the geometries found is each of those given."""
    return [int(np.argmin([shapely.hausdorff_distance(f, s) for f in found])) for s in SHAPES]


# What is read


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3857", "EPSG:3035", UTM, "EPSG:4258"])
@pytest.mark.parametrize("ending", ["gpkg", "geojson", "fgb"])
def test_any_format_in_any_crs_lies_where_pyproj_says(tmp_path, crs, ending):
    path = tmp_path / f"obstacles.{ending}"
    given = frame(SHAPES, to=crs)
    given.to_file(path)
    found = tp.read_obstacles(path, SURFACE)
    order = range(len(SHAPES)) if ending != "fgb" else nearest_of(found)  # sorted by place
    for k, original in zip(order, given.geometry, strict=True):
        shape = found[k]
        assert shapely.hausdorff_distance(shape, densely(original, crs)) < TOLERANCE
        assert shape.is_valid


def test_shapefiles_zipped_ones_and_kml(tmp_path):
    frame(SHAPES[:1]).to_file(tmp_path / "a.shp")
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        for part in tmp_path.glob("a.[a-y]*"):
            archive.write(part, part.name)
    frame(SHAPES[:1], to=4326).to_file(tmp_path / "a.kml", driver="KML")
    for name in ("a.shp", "a.zip", "a.kml"):
        (found,) = tp.read_obstacles(tmp_path / name, SURFACE)
        assert shapely.hausdorff_distance(found, SHAPES[0]) < 0.1


def test_long_edges_are_bent_as_the_projection_bends_them(tmp_path):
    corners = [(14.87, 49.66), (15.13, 49.66), (15.13, 49.82), (14.87, 49.70)]
    path = write_geojson(tmp_path / "a.geojson", [polygon(*corners)])
    (found,) = tp.read_obstacles(path, SURFACE)
    exact = densely(shapely.Polygon(corners), "EPSG:4326")
    assert shapely.hausdorff_distance(exact, found) < TOLERANCE
    assert shapely.hausdorff_distance(exact, shapely.Polygon(found.exterior.coords[::9])) > 0.1


def test_layers_of_a_geopackage_all_or_one(tmp_path):
    path = tmp_path / "a.gpkg"
    frame(SHAPES[:1]).to_file(path, layer="lakes")
    frame(SHAPES[1:3], to=4326).to_file(path, layer="walls", mode="a")
    assert len(tp.read_obstacles(path, SURFACE)) == 3
    assert len(tp.read_obstacles(f"{path}:walls", SURFACE)) == 2
    assert tp.read_obstacles(f"{path}:lakes", SURFACE)[0].equals(SHAPES[0])
    assert "its layers are: lakes, walls" in refused(tp.read_obstacles, f"{path}:roads", SURFACE)


def test_third_coordinates_are_dropped(tmp_path):
    high = shapely.force_3d(SHAPES[0], 7.0)
    frame([high]).to_file(tmp_path / "a.gpkg")
    (found,) = tp.read_obstacles(tmp_path / "a.gpkg", SURFACE)
    assert not found.has_z
    assert found.equals(SHAPES[0])


def test_what_is_read_is_what_a_problem_takes(tmp_path):
    frame(SHAPES, to=4326).to_file(tmp_path / "a.gpkg")
    obstacles = tp.read_obstacles(tmp_path / "a.gpkg", SURFACE)
    start, goal = (WEST + 500, SOUTH + 500), (WEST + 19_500, SOUTH + 19_500)
    problem = tp.Problem(SURFACE, start, goal, obstacles=obstacles, radius=50.0)
    path = tp.plan(problem, "fast-marching", refine=True).path
    assert all(shapely.distance(path.line, shape) >= 50.0 for shape in obstacles)


def test_a_georeference_alone_will_do_and_a_map_in_degrees_is_planned_on_its_own_plane(tmp_path):
    frame(SHAPES).to_file(tmp_path / "a.gpkg")
    assert tp.read_obstacles(tmp_path / "a.gpkg", PLACE)[0].equals(SHAPES[0])
    degrees = CRS.from_epsg(4326)
    local = Georeference(local_projection(degrees, 15.0, 49.7), degrees)
    found = tp.read_obstacles(tmp_path / "a.gpkg", local)[2]
    move = Transformer.from_crs(UTM, local.crs, always_xy=True)
    expected = np.column_stack(move.transform(*shapely.get_coordinates(SHAPES[2]).T))
    assert shapely.get_coordinates(found) == pytest.approx(expected, abs=1e-6)


def test_an_obstacle_as_large_as_the_world_is_cut_to_the_map(tmp_path):
    frame([shapely.box(-180, -90, 180, 90)], 4326).to_file(tmp_path / "a.gpkg")
    (found,) = tp.read_obstacles(tmp_path / "a.gpkg", SURFACE)
    assert found.contains(shapely.box(*SURFACE.bounds))
    assert shapely.area(found) < 20 * SIDE**2


# What is told


def told(reader, *arguments):
    with pytest.warns(tp.VectorWarning) as caught:
        found = reader(*arguments)
    assert all("\n" not in str(w.message) for w in caught)
    return found, " | ".join(str(w.message) for w in caught)


BOWTIE = polygon((15.0, 49.70), (15.1, 49.75), (15.1, 49.70), (15.0, 49.75))


def test_polygons_that_cross_themselves_are_repaired_and_said_so(tmp_path):
    good = polygon((15.0, 49.7), (15.01, 49.7), (15.01, 49.71))
    path = write_geojson(tmp_path / "a.geojson", [good, BOWTIE])
    with pytest.warns(tp.RepairedWarning, match="repaired: 1 of 2 geometries.*feature 1: Self"):
        found = tp.read_obstacles(path, SURFACE)
    assert len(found) == 2
    assert all(shape.is_valid for shape in found)
    assert len(found[1].geoms) == 2


def test_ground_that_a_ring_goes_round_twice_stays_an_obstacle(tmp_path):
    overlapping = {
        "type": "MultiPolygon",
        "coordinates": [
            polygon((15.0, 49.7), (15.02, 49.7), (15.02, 49.72), (15.0, 49.72))["coordinates"],
            polygon((15.01, 49.71), (15.03, 49.71), (15.03, 49.73), (15.01, 49.73))["coordinates"],
        ],
    }
    path = write_geojson(tmp_path / "a.geojson", [overlapping])
    with pytest.warns(tp.RepairedWarning):
        (found,) = tp.read_obstacles(path, SURFACE)
    twice = densely(shapely.Point(15.015, 49.715).buffer(1e-4), "EPSG:4326")
    assert found.contains(twice)


def test_features_without_geometry_are_left_out_and_said_so(tmp_path):
    good = polygon((15.0, 49.7), (15.01, 49.7), (15.01, 49.71))
    empty = {"type": "Polygon", "coordinates": []}
    path = write_geojson(tmp_path / "a.geojson", [None, good, empty])
    found, text = told(tp.read_obstacles, path, SURFACE)
    assert len(found) == 1
    assert "left out: 2 of 3 features" in text
    path = write_geojson(tmp_path / "b.geojson", [None, empty])
    assert "holds no features with a geometry" in refused(tp.read_obstacles, path, SURFACE)


def test_a_file_without_crs_is_in_the_maps_own_coordinates_and_said_so(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        frame(SHAPES, None).to_file(tmp_path / "a.gpkg")
    found, text = told(tp.read_obstacles, tmp_path / "a.gpkg", SURFACE)
    assert found[0].equals(SHAPES[0])
    assert "WGS 84 / UTM zone 33N" in text
    assert tp.read_obstacles(tmp_path / "a.gpkg", BARE)[0].equals(SHAPES[0])


def test_obstacles_outside_the_map_are_told_of(tmp_path):
    frame([shapely.box(100, 10, 101, 11)], 4326).to_file(tmp_path / "a.gpkg")
    found, text = told(tp.read_obstacles, tmp_path / "a.gpkg", SURFACE)
    assert found == []
    assert "all obstacles lie outside the map" in text
    frame([*SHAPES, shapely.box(520_000, 5_505_000, 521_000, 5_506_000)]).to_file(
        tmp_path / "b.gpkg"
    )
    found, text = told(tp.read_obstacles, tmp_path / "b.gpkg", SURFACE)
    assert "1 of 5 obstacles lie outside the map" in text
    assert len(found) == 5  # with a large radius it may still be felt


def test_lunar_coordinates_in_a_format_that_knows_only_earth(tmp_path):
    moon = Georeference.from_projected("ESRI:103878")
    path = write_geojson(tmp_path / "a.geojson", [polygon((0, -89), (1, -89), (1, -88.9))])
    found, text = told(tp.read_obstacles, path, moon)
    assert "longitude and latitude of" in text
    move = Transformer.from_crs(moon.crs.geodetic_crs, moon.crs, always_xy=True)
    corner = np.array(move.transform(1, -88.9))
    assert shapely.distance(found[0], shapely.Point(corner)) < 0.01


# What is refused


@pytest.mark.parametrize(
    ("name", "content", "shown"),
    [
        ("a.geojson", b"", "cannot be read as vectors"),
        ("a.shp", b"not a shapefile at all", "cannot be read as vectors"),
        ("a.gpkg", b"SQLite format 3\x00" + b"\x01" * 200, "cannot be read as vectors"),
        ("a.txt", b"hello", "cannot be read as vectors"),
        ("a.zip", b"PK\x03\x04 truncated", "cannot be read as vectors"),
        ("a.geojson", b'{"type": "FeatureCollection", "features": [', "cannot be read as vectors"),
        ("a.csv", b"x,y\n1,2\n", "holds no layer with geometries"),
    ],
)
def test_what_is_no_vector_file_is_refused(tmp_path, name, content, shown):
    path = tmp_path / name
    path.write_bytes(content)
    for reader in (tp.read_obstacles, tp.read_area):
        text = refused(reader, path, SURFACE)
        assert shown in text
        assert str(path) in text


def test_files_that_are_not_there_rasters_and_absurd_sizes_are_refused(tmp_path, monkeypatch):
    assert "does not exist" in refused(tp.read_obstacles, tmp_path / "none.shp", SURFACE)
    assert "does not exist" in refused(tp.read_obstacles, "http://127.0.0.1/none.shp", SURFACE)
    assert "cannot be read as vectors" in refused(tp.read_obstacles, tmp_path, SURFACE)
    import rasterio

    raster = tmp_path / "a.tif"
    profile = {"driver": "GTiff", "width": 4, "height": 4, "count": 1, "dtype": "uint8"}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with rasterio.open(raster, "w", **profile) as dataset:
            dataset.write(np.zeros((1, 4, 4), np.uint8))
    assert "cannot be read as vectors" in refused(tp.read_obstacles, raster, SURFACE)
    monkeypatch.setattr("terrapath._support.external.MOST_UNPACKED", 1000)
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.geojson", b" " * 100_000)
    assert (tmp_path / "bomb.zip").stat().st_size < 1000
    assert "GiB" in refused(tp.read_obstacles, tmp_path / "bomb.zip", SURFACE)


def test_a_file_with_a_crs_on_a_map_without_one_is_refused(tmp_path):
    frame(SHAPES).to_file(tmp_path / "a.gpkg")
    for where in (BARE, None):
        text = refused(tp.read_obstacles, tmp_path / "a.gpkg", where)
        assert "WGS 84 / UTM zone 33N, but the map has no CRS" in text
    assert "neither a Surface" in refused(tp.read_obstacles, tmp_path / "a.gpkg", "dem.tif")


def test_coordinates_that_are_nowhere_are_refused(tmp_path):
    path = write_geojson(tmp_path / "a.geojson", [polygon((0, 0), (1, 0), (1e400, 1))])
    assert "not finite" in refused(tp.read_obstacles, path, PLACE)
    path = write_geojson(tmp_path / "b.geojson", [polygon((15, 49), (16, 49), (16, 950))])
    assert "does not reach" in refused(tp.read_obstacles, path, PLACE)


# Areas


def test_an_area_is_the_union_of_its_polygons(tmp_path):
    boxes = [
        shapely.box(490_000, 5.5e6, 500_000, 5.51e6),
        shapely.box(495_000, 5.505e6, 5.1e5, 5.52e6),
    ]
    frame(boxes, to=4326).to_file(tmp_path / "a.geojson")
    area = tp.read_area(tmp_path / "a.geojson", SURFACE)
    exact = shapely.union_all(boxes)
    assert area.geom_type == "Polygon"
    assert shapely.area(shapely.symmetric_difference(area, exact)) < 1e-3 * exact.area
    problem = tp.Problem(SURFACE, (492_000, 5_502_000), (505_000, 5_515_000), keep_in=area)
    assert problem.free_space.blocker((493_000, 5_515_000)) is not None


def test_an_area_of_lines_or_elsewhere_is_refused(tmp_path):
    frame(SHAPES[:2]).to_file(tmp_path / "a.gpkg")
    assert "is a LineString, which bounds no area" in refused(
        tp.read_area, tmp_path / "a.gpkg", SURFACE
    )
    frame([shapely.box(100, 10, 101, 11)], 4326).to_file(tmp_path / "b.gpkg")
    assert "the area lies outside the map" in refused(tp.read_area, tmp_path / "b.gpkg", SURFACE)
