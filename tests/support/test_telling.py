"""Warnings as data: who listens is told, and where nobody does Python warns."""

import contextvars
import subprocess
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest
import shapely

import terrapath as tp
from terrapath.errors import TerrapathWarning, UnfinishedWarning, collecting, silence, tell, told_to

BOW_TIE = {"type": "Polygon", "coordinates": [[[1, 1], [5, 5], [5, 1], [1, 5], [1, 1]]]}


def said(what):
    return TerrapathWarning(what)


def texts(warned):
    return [str(warning) for warning in warned]


@pytest.fixture
def obstacles(tmp_path):
    """A file of a polygon that crosses itself, and of one far off the map."""
    far = {"type": "Polygon", "coordinates": [[[90, 1], [95, 1], [95, 5], [90, 1]]]}
    features = [{"type": "Feature", "properties": {}, "geometry": g} for g in (BOW_TIE, far)]
    path = tmp_path / "obstacles.gpkg"
    shapes = [shapely.geometry.shape(feature["geometry"]) for feature in features]
    geopandas = pytest.importorskip("geopandas")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        geopandas.GeoDataFrame(geometry=shapes).to_file(path)
    return path


SURFACE = tp.Surface.from_grid(np.zeros((9, 9)), np.arange(9.0), np.arange(9.0))


def test_a_listener_gets_the_warnings_and_python_does_not(obstacles):
    with warnings.catch_warnings(record=True) as shown, collecting() as collected:
        warnings.simplefilter("always")
        tp.read_obstacles(obstacles, SURFACE)
    assert [type(warning) for warning in collected] == [tp.RepairedWarning, tp.VectorWarning]
    assert "repaired: 1 of 2 geometries" in str(collected[0])
    assert "1 of 2 obstacles lie outside the map" in str(collected[1])
    assert shown == []


def test_without_a_listener_python_warns_at_the_line_that_called(obstacles):
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        line = sys._getframe().f_lineno + 1
        tp.read_obstacles(obstacles, SURFACE)
    assert [entry.category for entry in shown] == [tp.RepairedWarning, tp.VectorWarning]
    assert {(entry.filename, entry.lineno) for entry in shown} == {(__file__, line)}


def test_a_warning_may_be_made_an_error(obstacles):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(tp.RepairedWarning):
            tp.read_obstacles(obstacles, SURFACE)


def test_the_innermost_listener_is_told():
    outer, inner = [], []
    with told_to(outer.append):
        tell(said("one"))
        with told_to(inner.append):
            tell(said("two"))
        tell(said("three"))
    assert (texts(outer), texts(inner)) == (["one", "three"], ["two"])


def test_what_is_collected_is_heard_outside_as_well_as_it_comes():
    heard = []
    with told_to(heard.append):
        with collecting() as collected:
            tell(said("one"))
            assert texts(heard) == ["one"]
        tell(said("two"))
    assert (texts(heard), texts(collected)) == (["one", "two"], ["one"])


def test_an_error_ends_the_listening():
    with collecting() as collected:
        with pytest.raises(ValueError, match="inside"), told_to(print):
            raise ValueError("inside")
        tell(said("after"))
    assert texts(collected) == ["after"]
    with pytest.warns(TerrapathWarning, match="nobody"):
        tell(said("nobody"))


def test_a_listener_may_raise():
    def refuse(warning):
        raise RuntimeError(str(warning))

    with pytest.raises(RuntimeError, match="no more"), told_to(refuse):
        tell(said("no more"))


def test_each_thread_has_its_own_listener():
    both = threading.Barrier(2)
    found = {}

    def work(name):
        with collecting() as collected:
            for k in range(50):
                both.wait()
                tell(said(f"{name} {k}"))
        found[name] = texts(collected)

    threads = [threading.Thread(target=work, args=(name,)) for name in "ab"]
    with collecting() as here:
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert here == []
    assert found == {name: [f"{name} {k}" for k in range(50)] for name in "ab"}


def test_a_copied_context_takes_the_listener_along():
    with collecting() as collected:
        context = contextvars.copy_context()
        thread = threading.Thread(target=context.run, args=(tell, said("from afar")))
        thread.start()
        thread.join()
    assert texts(collected) == ["from afar"]


def test_what_could_not_be_finished_is_told(monkeypatch):
    problem = tp.Problem(SURFACE, (0, 0), (8, 8))
    raw = tp.RRTStar(samples=200, step=1.0, seed=0).solve(problem)
    from terrapath.planners import finished

    def fail(*_, **__):
        raise ArithmeticError("by zero")

    monkeypatch.setattr(finished, "refine", fail)
    with collecting() as collected:
        finished.refined(raw)
    assert [type(warning) for warning in collected] == [UnfinishedWarning]
    assert "ArithmeticError: by zero" in str(collected[0])


def test_silence_is_of_one_module_and_category_and_is_set_once():
    def warn_from(module, category):
        warnings.warn_explicit("words", category, "file.py", 1, module=module)

    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        silence(FutureWarning, "library.part")
        once = list(warnings.filters)
        silence(FutureWarning, "library.part")
        assert list(warnings.filters) == once
        warn_from("library.part", FutureWarning)
        assert shown == []
        for module, category in (
            ("library.part.more", FutureWarning),
            ("library", FutureWarning),
            ("library.part", UserWarning),
        ):
            warn_from(module, category)
    assert len(shown) == 3


def test_a_foreign_open_still_warns_of_a_missing_georeference(tmp_path):
    script = """
import sys, warnings, numpy, rasterio, terrapath
path = sys.argv[1]
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    size = {"width": 9, "height": 9, "count": 1, "dtype": "float32"}
    with rasterio.open(path, "w", driver="GTiff", **size) as file:
        file.write(numpy.ones((1, 9, 9), "float32"))
with warnings.catch_warnings(record=True) as shown:
    warnings.simplefilter("always")
    terrapath.read_surface(path)
    print(len([w for w in shown if "georef" in w.category.__name__.lower()]))
    rasterio.open(path).close()
    print(len([w for w in shown if "georef" in w.category.__name__.lower()]))
"""
    done = subprocess.run(
        [sys.executable, "-c", script, str(Path(tmp_path) / "plain.tif")],
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["0", "1"], done.stderr
