"""`terrapath field`: fields written, drawn and refused."""

import numpy as np
import pytest
import rasterio

import terrapath as tp
from commands import refused
from terrapath.cli.main import run


def test_a_field_is_written_and_drawn(tmp_path, capsys):
    files = [tmp_path / name for name in ("f.tif", "f.npz", "f.png")]
    asked = ["six-peaks", "--start", "1,2", "--spacing", "0.2", "--plot", str(files[2])]
    assert run(["field", *asked, "--output", str(files[0]), "--output", str(files[1])]) == 0
    table = capsys.readouterr().out
    for word in ("61 x 61, 100 % reached", "spacing", "farthest", "seconds"):
        assert word in table
    problem = tp.scenes.load("six-peaks")
    field = tp.distance_field(problem.surface, (1, 2), bounds=problem.bounds, spacing=0.2)
    with np.load(files[1]) as archive:
        np.testing.assert_array_equal(archive["distance"], field.values)
    assert files[2].read_bytes().startswith(b"\x89PNG")
    assert sorted(tmp_path.iterdir()) == sorted(files)


def test_the_field_of_a_map_starts_where_it_is_told(dem, tmp_path, capsys):
    output = tmp_path / "f.tif"
    asked = [str(dem), "--start", "500100,4000100", "--output", str(output)]
    assert run(["field", *asked, "--layer", f"rocks={dem}:2*50"]) == 0
    capsys.readouterr()
    with rasterio.open(output) as dataset:
        column_row = np.array(~dataset.transform * (500_100.0, 4_000_100.0))
        values = dataset.read(1)
    nearest = np.unravel_index(np.nanargmin(values), values.shape)
    assert np.abs(column_row - 0.5 - nearest[::-1]).max() <= 0.5 + 1e-6
    assert np.isnan(values).sum() > 0  # the block without data


BAD_FIELDS = {
    "no output": (["six-peaks"], "--output", "--plot"),
    "unknown format": (["six-peaks", "--output", "f.csv"], "f.csv", ".tif"),
    "unknown picture": (["six-peaks", "--plot", "f.tif"], "f.tif", ".png"),
    "no directory": (["six-peaks", "--output", "no/f.tif"], "no/f.tif", "directory"),
    "same file twice": (["six-peaks", "--output", "f.tif", "--output", "f.tif"], "twice"),
    "start off the map": (["six-peaks", "--start", "20,3", "--output", "f.tif"], "start=(20, 3)"),
    "no spacing": (["six-peaks", "--spacing", "0", "--output", "f.tif"], "spacing=0"),
    "NaN spacing": (["six-peaks", "--spacing", "nan", "--output", "f.tif"], "spacing=nan"),
    "too many nodes": (["six-peaks", "--spacing", "1e-9", "--output", "f.tif"], "wider"),
    "a goal": (["six-peaks", "--goal", "1,1", "--output", "f.tif"], "--goal"),
}


@pytest.mark.parametrize("name", BAD_FIELDS)
def test_bad_questions_about_a_field_give_one_clear_line(name, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments, *words = BAD_FIELDS[name]
    refused(capsys, "field", arguments, *words)
    assert list(tmp_path.iterdir()) == []
