"""Maps of robots and games, heightmaps, and scattered points."""

import json
import warnings

import laspy
import numpy as np
import pytest
import rasterio
from PIL import Image
from plyfile import PlyData, PlyElement

import terrapath as tp
from common import REAL_MAPS, one_line
from terrapath.cli.main import run

# nav2

FREE, UNKNOWN, WALL = 254, 205, 0


def nav2(folder, shades, *, name="map.pgm", **about):
    """A map.yaml and its picture, rows from north to south."""
    Image.fromarray(np.asarray(shades, np.uint8)).save(folder / name)
    given = {"image": name, "resolution": 0.5, "origin": [-2.0, 3.0, 0.0], "free_thresh": 0.196}
    given |= about
    (folder / "map.yaml").write_text("".join(f"{k}: {v}\n" for k, v in given.items()))
    return folder / "map.yaml"


def yard():
    """Free ground of 20 x 30 cells with a wall across, a door in it, and unknown ground."""
    shades = np.full((20, 30), FREE)
    shades[:, 14] = WALL
    shades[3, 14] = FREE
    shades[17:, 25:] = UNKNOWN
    return shades


@pytest.mark.parametrize("name", ["map.pgm", "map.png", "map.bmp"])
def test_a_map_of_nav2_is_flat_ground_with_its_walls_blocked(tmp_path, name):
    surface = tp.read_surface(nav2(tmp_path, yard(), name=name))
    # The ground reaches to the very edge: half a cell of the ring around is inside the bounds.
    assert surface.bounds == (-2.25, 2.75, 13.25, 13.25)
    problem = tp.Problem(surface, (-1.9, 3.1), (12.9, 12.9))
    path = tp.plan(problem, "optimal").path
    door = np.array([-2.0 + 0.5 * 14.5, 3.0 + 0.5 * 16.5])  # the fourth row from the north
    assert np.hypot(*(path.points - door).T).min() < 0.5
    assert path.length == pytest.approx(np.hypot(*(path.points[1:] - path.points[:-1]).T).sum())
    assert (surface.unit, problem.unit, path.ground_unit) == ("m", "m", "m")
    for blocked in ([5.25, 4.0], [11.9, 3.4]):  # the wall, and what is unknown
        with pytest.raises(tp.BlockedError):
            tp.Problem(surface, (-1.9, 3.1), blocked)


CELLS = [0, 40, 90, 100, 101, 150, 165, 205, 215, 254, 255]


@pytest.mark.parametrize("negate", [0, 1])
@pytest.mark.parametrize("mode", ["trinary", "scale", "raw"])
def test_modes_thresholds_and_negation_mean_what_map_server_means(tmp_path, mode, negate):
    row = np.resize(CELLS, 40)
    path = nav2(
        tmp_path, np.tile(row, (8, 1)), mode=mode, negate=negate, occupied_thresh=0.6,
        free_thresh=0.2, name="map.png",
    )  # fmt: skip
    surface = tp.read_surface(path, costs={"going": tp.LayerSource(path, 2)})
    for column, shade in enumerate(row):
        occupied = shade / 255 if negate else 1 - shade / 255
        if mode == "raw":
            value = shade if shade <= 100 else None
        elif occupied >= 0.6:
            value = 100
        elif occupied <= 0.2:
            value = 0
        else:
            value = None if mode == "trinary" else min(99, round((occupied - 0.2) / 0.4 * 100))
        is_blocked = surface.nodata.blocked[4, column + 1]
        assert is_blocked == (value is None or value == 100), (shade, value)
        if not is_blocked:
            place = (-2.0 + 0.5 * (column + 0.5), 3.0 + 0.5 * 3.5)
            assert surface.cost(place) == 1.0 + value, (shade, value)


def test_a_turned_map_of_nav2_lies_where_its_origin_says(tmp_path):
    surface = tp.read_surface(nav2(tmp_path, yard(), origin=[10.0, 20.0, 0.5]))
    turn = np.array([[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])
    places = [10.0, 20.0] + np.array([[7.25, 4.0], [4.0, 4.0]]) @ turn.T
    with pytest.raises(tp.BlockedError):
        tp.Problem(surface, places[1], places[0])
    tp.Problem(surface, places[1], places[1] + 0.5)


@pytest.mark.parametrize(
    ("about", "shown"),
    [
        ({"image": "none.pgm"}, "does not exist"),
        ({"image": "/etc/hostname"}, "elsewhere"),
        ({"resolution": 0}, "resolution"),
        ({"resolution": "wide"}, "resolution"),
        ({"origin": "[1, 2]"}, "origin"),
        ({"origin": "[1, 2, 1e308]"}, "origin"),
        ({"mode": "odd"}, "mode"),
        ({"free_thresh": 0.9}, "free_thresh"),
        ({"negate": "[]"}, "negate"),
    ],
)
def test_what_is_wrong_in_a_map_of_nav2_is_named(tmp_path, about, shown):
    with pytest.raises(tp.MapError, match=shown) as caught:
        tp.read_surface(nav2(tmp_path, yard()).parent / nav2(tmp_path, yard(), **about).name)
    one_line(caught)


@pytest.mark.parametrize("text", ["", "[", "a: 1", "image: 3", "!!python/object:os.system {}"])
def test_other_yaml_is_refused(tmp_path, text):
    (tmp_path / "map.yaml").write_text(text)
    with pytest.raises(tp.MapError):
        tp.read_surface(tmp_path / "map.yaml")


# MovingAI


def test_a_grid_of_movingai_has_its_exact_lengths():
    path = REAL_MAPS / "random-100-33.map"
    if not path.exists():
        pytest.skip("the map is not here")
    surface = tp.read_surface(path)
    cases = json.loads((REAL_MAPS / "random-100-33.exact.json").read_text())
    for case in cases[::4]:
        problem = tp.Problem(surface, case["s"], case["t"])
        length = tp.plan(problem, "optimal").length
        assert length == pytest.approx(case["exact"], rel=1e-6)


def movingai(folder, rows):
    (folder / "a.map").write_text(
        f"type octile\nheight {len(rows)}\nwidth {len(rows[0])}\nmap\n" + "\n".join(rows) + "\n"
    )
    return folder / "a.map"


def test_a_scene_of_movingai_names_the_map_and_the_ends(tmp_path, capsys):
    movingai(tmp_path, ["......", ".@@@@.", "......", "......", "SG...T"])
    (tmp_path / "a.map.scen").write_text("version 1\n0\ta.map\t6\t5\t0\t0\t4\t0\t4\n"
                                         "1\ta.map\t6\t5\t0\t0\t0\t4\t4\n")  # fmt: skip
    for number, length in ((1, 4.0), (2, 4.0)):
        assert (
            run(["plan", f"{tmp_path}/a.map.scen:{number}", "--planner", "optimal", "--json"]) == 0
        )
        assert json.loads(capsys.readouterr().out)["length"] == pytest.approx(length, rel=1e-6)
    assert run(["plan", f"{tmp_path}/a.map.scen:3"]) == 2
    assert "holds 2 problems" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text",
    [
        "type octile\n",
        "type octile\nheight 2\nwidth 3\nmap\n...\n",
        "type octile\nheight x\nwidth 3\nmap\n",
    ],
)
def test_damaged_grids_are_refused(tmp_path, text):
    (tmp_path / "a.map").write_text(text)
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(tmp_path / "a.map")
    one_line(caught)


# Heightmaps


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
@pytest.mark.parametrize(("dtype", "most"), [(np.uint8, 255), (np.uint16, 65535)])
@pytest.mark.parametrize("ending", ["png", "pgm"])
def test_a_heightmap_is_as_large_and_high_as_is_said(tmp_path, dtype, most, ending):
    rows, columns = np.mgrid[0:20, 0:30]
    picture = np.round(most * (rows + columns) / 48.0).astype(dtype)
    path = tmp_path / f"hills.{ending}"
    driver = {"png": "PNG", "pgm": "PNM"}[ending]
    with rasterio.open(path, "w", driver=driver, width=30, height=20, count=1, dtype=dtype) as file:
        file.write(picture[None])
    surface = tp.read_surface(path, cell_size=0.5, height_range=(-5.0, 7.0), smoothing=None)
    assert surface.bounds == (0.25, 0.25, 14.75, 9.75)
    found = surface.values(np.array([[0.25, 9.75], [14.75, 0.25]]))[:, 0]
    assert found == pytest.approx([-5.0, 7.0], abs=1e-6)


def test_a_heightmap_is_checked(tmp_path):
    path = tmp_path / "a.png"
    Image.fromarray(np.zeros((9, 9), np.uint8)).save(path)
    for wrong in ((1.0, 1.0), (2.0, 1.0), (0.0, np.inf), (1.0,)):
        with pytest.raises(tp.InputError, match="height_range"):
            tp.read_surface(path, height_range=wrong)
    with pytest.raises(tp.InputError, match="cell_size"):
        tp.read_surface(path, cell_size=0.0, height_range=(0, 1))
    with pytest.warns(tp.MapWarning, match=r"1 by 1; give their side by --cell-size"):
        assert tp.read_surface(path, height_range=(0, 1)).bounds.width == 8.0


def test_a_map_may_be_a_plane_of_its_own():
    x, y = np.linspace(10.0, 10.1, 30), np.linspace(45.0, 45.1, 20)
    steep = 900.0 * np.sin(900.0 * x) * np.cos(900.0 * y[:, None])
    with pytest.raises(tp.MapError, match="look like degrees"):
        tp.read_surface((steep, x, y), smoothing=None)
    surface = tp.read_surface((steep, x, y), crs="none", smoothing=None)
    assert surface.georeference is None
    assert surface.bounds.x1_max == pytest.approx(10.1)


# Points


def cloud(count=4000, seed=0):
    """(count, 3): scattered points on a smooth hill, with a gap."""
    random = np.random.default_rng(seed)
    x, y = 500_000.0 + 40.0 * random.uniform(size=(2, count)) * [[1.0], [0.7]]
    points = np.column_stack([x, y, 10.0 + 3.0 * np.sin(x / 9.0) + 0.1 * y / 40.0])
    return points[np.hypot(x - 500_020.0, y - 500_014.0) > 3.0]


def write_cloud(path, points):
    match path.suffix:
        case ".las" | ".laz":
            header = laspy.LasHeader(point_format=3, version="1.4")
            header.offsets, header.scales = points.min(axis=0), [1e-3] * 3
            las = laspy.LasData(header)
            las.x, las.y, las.z = points.T
            las.write(path)
        case ".ply":
            kinds = [(name, "f8") for name in "xyz"]
            vertices = np.array([tuple(point) for point in points], dtype=kinds)
            PlyData([PlyElement.describe(vertices, "vertex")]).write(path)
        case ".csv":
            np.savetxt(path, points[:, [2, 0, 1]], delimiter=",", header="z,x,y", comments="")
        case _:
            np.savetxt(path, points)
    return path


@pytest.mark.parametrize("ending", ["las", "laz", "ply", "csv", "xyz", "txt"])
def test_scattered_points_are_averaged_in_cells_and_it_is_told(tmp_path, ending):
    points = cloud()
    path = write_cloud(tmp_path / f"cloud.{ending}", points)
    with pytest.warns(tp.MapWarning, match="points are averaged on 40 x 28 cells of side 1;"):
        surface = tp.read_surface(path, cell_size=1.0, crs="EPSG:32633", smoothing=None)
    low = points[:, :2].min(axis=0)
    cell = np.floor(points[:, :2] - low).astype(int)
    means = [points[(cell == [i, j]).all(axis=1), 2].mean() for i, j in ((3, 4), (30, 20))]
    places = low + np.array([[3.5, 4.5], [30.5, 20.5]])
    np.testing.assert_allclose(surface.values(places)[:, 0], means, atol=2e-3)
    with pytest.raises(tp.BlockedError):
        tp.Problem(surface, (500_020.0, 500_014.0), places[0])


def test_points_on_a_grid_are_its_cells(tmp_path):
    x, y = np.meshgrid(np.arange(20) * 2.0, np.arange(15) * 2.0)
    points = np.column_stack([x.ravel(), y.ravel(), (x + y).ravel()])
    with pytest.warns(tp.MapWarning, match="20 x 15 cells of side 2; 0 %"):
        surface = tp.read_surface(write_cloud(tmp_path / "grid.csv", points), smoothing=None)
    assert surface.bounds == (0.0, 0.0, 38.0, 28.0)
    np.testing.assert_allclose(surface.values(points[:, :2])[:, 0], points[:, 2], atol=1e-9)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.csv", "x,y\n1,2\n"), ("a.csv", "a,b,c\n1,2,3\n"), ("a.csv", "x,y,z\n" + "1,1,1\n" * 20),
        ("a.csv", "x,y,z\n1,2,q\n"), ("a.las", "LASF"), ("a.laz", "LASF" + "\0" * 400),
        ("a.ply", "ply\nformat ascii 1.0\n"), ("a.xyz", "1 2\n"), ("a.txt", "\u00e9"),
    ],
)  # fmt: skip
def test_what_is_no_cloud_is_refused_in_one_line(tmp_path, name, content):
    (tmp_path / name).write_text(content)
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(tmp_path / name)
    assert name in one_line(caught)


def test_a_damaged_laz_file_does_not_abort_the_process(tmp_path):
    path = write_cloud(tmp_path / "cloud.laz", cloud(400))
    content = bytearray(path.read_bytes())
    start = int.from_bytes(content[96:100], "little")
    table = int.from_bytes(content[start : start + 8], "little", signed=True)
    content[table + 4 : table + 8] = b"\xff\xff\xff\xf0"
    path.write_bytes(content)
    with pytest.raises(tp.MapError, match="chunks"):
        tp.read_surface(path)


@pytest.mark.parametrize("span", [1e-200, 1e-300, 1e-12])
def test_points_that_all_but_meet_are_refused_in_one_line(tmp_path, span):
    x, y = span * np.random.default_rng(0).uniform(size=(2, 50))
    points = np.column_stack([x, y * 1e300 * span, 0.0 * x])
    with pytest.raises(tp.MapError) as caught:
        tp.read_surface(write_cloud(tmp_path / "cloud.csv", points))
    one_line(caught)


@pytest.mark.parametrize("ending", ["las", "laz"])
@pytest.mark.parametrize("at", [96, 100, 247])  # where points begin, how many records and points
def test_a_header_that_claims_too_much_is_refused_before_memory_is_asked_for(tmp_path, ending, at):
    path = write_cloud(tmp_path / f"cloud.{ending}", cloud(400))
    content = bytearray(path.read_bytes())
    content[at : at + 4] = b"\xff\xff\xff\xff"
    path.write_bytes(content)
    with pytest.raises(tp.MapError, match="claims more than its") as caught:
        tp.read_surface(path)
    one_line(caught)


# How many cells


def test_maps_that_are_read_as_a_whole_have_as_many_cells_as_the_caller_allows(
    tmp_path, monkeypatch
):
    write_cloud(tmp_path / "cloud.csv", cloud(400))
    maps = [nav2(tmp_path, yard()), movingai(tmp_path, ["....."] * 5), tmp_path / "cloud.csv"]
    for module in ("occupancy", "points"):
        # Refused before any cell is made.
        monkeypatch.setattr(f"terrapath.io.{module}.ArrayBand", None)
    for path in maps:
        with pytest.raises(tp.MapError, match="cells, more than 24;") as caught:
            tp.read_surface(path, most_cells=24)
        assert "most_cells" in one_line(caught)
    monkeypatch.undo()
    monkeypatch.setattr("terrapath.io.maps.MOST_CELLS", 24)
    for path in maps:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", tp.MapWarning)
            assert tp.read_surface(path, most_cells=10_000).bounds is not None
