"""The simplest plan enters only the modules that it uses: a function or class body of theirs."""

from collections import Counter

import numpy as np
import rasterio
from rasterio.transform import from_origin

from processes import in_another_process

# Of the planners' modules six plan, and one may compile kernels beside them.
MOST = {"planners": 7, "certificates": 3, "geodesics": 5, "distance": 2, "problem": 3, "space": 3}

PLAN = """
import contextlib, io, json, sys
from pathlib import Path

entered = set()

def note(frame, event, _):
    code = frame.f_code
    if event == "call" and code.co_name != "<module>":
        entered.add(code.co_filename)

sys.setprofile(note)
import terrapath
from terrapath.cli.main import run

with contextlib.redirect_stdout(io.StringIO()):
    code = run(["plan", {map!r}, "--start", "5,5", "--goal", "35,35", "--json"])
sys.setprofile(None)
root = Path(terrapath.__file__).parent
files = [Path(name) for name in entered]
inside = sorted(str(file.relative_to(root)) for file in files if file.is_relative_to(root))
print(json.dumps([code, inside]))
"""


def test_the_simplest_plan_enters_few_modules(tmp_path):
    heights = np.hypot(*np.mgrid[-20.0:20.0, -20.0:20.0]).astype("float32")
    place = {"crs": "EPSG:32632", "transform": from_origin(0.0, 40.0, 1.0, 1.0)}
    size = {"width": 40, "height": 40, "count": 1, "dtype": "float32"}
    with rasterio.open(tmp_path / "map.tif", "w", driver="GTiff", **size, **place) as file:
        file.write(heights, 1)
    code, entered = in_another_process(PLAN.format(map=str(tmp_path / "map.tif")))
    assert code == 0
    counts = Counter(name.split("/")[0] for name in entered)
    assert all(0 < counts[package] <= most for package, most in MOST.items()), entered
    assert "problem/scenes.py" not in entered
    assert "planners/rrt.py" not in entered
