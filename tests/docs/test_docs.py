"""Every example in the documentation runs and prints what it says; every link leads somewhere.

Commands that take long are left out (LONG), and those of other programs.
"""

import re
import shlex
import sys
import textwrap
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

import terrapath as tp
from terrapath.cli.main import run

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
REFERENCE = sorted((ROOT / "docs" / "reference").glob("*.md"))
OTHERS = [ROOT / name for name in ("CHANGELOG.md", "CONTRIBUTING.md", "benchmarks/README.md")]
LINKING = [*PAGES, *REFERENCE, *OTHERS]

FENCED = re.compile(r"^```(\w*)\n(.*?)^```$", re.DOTALL | re.MULTILINE)
INDENTED = re.compile(r"(?:^    .+\n)+", re.MULTILINE)
# Up to a semicolon a comment beside a print tells what it shows.
PRINTING = re.compile(r"^\s*print\(.*\)\s+# ([^;]*)")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")

# They have tests of their own: test_reproduce.py and test_startup.py.
LONG = {"reproduce", "warmup"}

# The reader's own maps, made here: the CRS, west and north, columns and rows of 100 m, bands.
MAPS = {
    "dem.tif": ("EPSG:32633", 511_000, 4_046_000, 110, 160, 1),
    "herodotus_mons.tif": (
        "+proj=ortho +lat_0=27 +lon_0=-53 +R=1737400",
        -6_800,
        5_100,
        136,
        102,
        3,
    ),
}


def examples(language):
    """The fenced blocks in a language, and which they are."""
    for page in PAGES:
        blocks = [code for name, code in FENCED.findall(page.read_text()) if name == language]
        yield from ((code, f"{page.name}-{k}") for k, code in enumerate(blocks))


def python_examples():
    return [pytest.param(code, id=name) for code, name in examples("python")]


def scripts():
    """The commands of each block that have terrapath run, be it fenced or indented."""
    blocks = list(examples("sh"))
    for page in PAGES:
        bare = FENCED.sub("", page.read_text())
        blocks += [(textwrap.dedent(block), page.name) for block in INDENTED.findall(bare)]
    for block, name in blocks:
        lines = block.replace("\\\n", " ").splitlines()
        if commands := [line for line in lines if line.startswith("terrapath ")]:
            yield pytest.param(commands, id=f"{name}: {commands[0][:50]}")


def promises(code):
    """Which lines of an example print numbers that a comment tells, and the comment."""
    for number, line in enumerate(code.splitlines(), start=1):
        told = PRINTING.match(line)
        if told and NUMBER.search(told[1]):
            yield number, told[1]


def shows(printed, promised):
    """Are the numbers promised among those printed, in that order, to the digits written?"""
    numbers = iter(NUMBER.findall(printed))
    wanted = re.findall(rf"({NUMBER.pattern})(\.\.\.)?", promised)
    return all(any(agrees(n, start, dots) for n in numbers) for start, dots in wanted)


def agrees(number, start, dots):
    decimals = len(start.partition(".")[2])
    return number.startswith(start) if dots else f"{float(number):.{decimals}f}" == start


def write_map(path, crs, west, north, columns, rows, bands):
    x, y = np.arange(columns) / 20, np.arange(rows)[:, None] / 20
    hills = (np.sin(x) * np.cos(y) * 100).astype(np.float32)
    size = {"width": columns, "height": rows, "count": bands, "dtype": np.float32}
    place = {"crs": crs, "transform": from_origin(west, north, 100, 100)}
    with rasterio.open(path, "w", driver="GTiff", **size, **place) as raster:
        for band in range(1, bands + 1):
            raster.write(hills / band**3, band)


def anchors(page):
    """What GitHub makes of a page's headings."""
    headings = re.findall(r"^#+ (.*)$", FENCED.sub("", page.read_text()), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("code", python_examples())
def test_python_examples_run_and_print_what_they_say(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    printed = defaultdict(str)

    def note(*values):
        printed[sys._getframe(1).f_lineno] += f"{' '.join(map(str, values))}\n"

    exec(compile(code, "<example>", "exec"), {"print": note})
    for line, promised in promises(code):
        assert shows(printed[line], promised), (printed[line], promised)


@pytest.mark.parametrize("commands", list(scripts()))
def test_commands_run(commands, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for command in commands:
        words = shlex.split(command)[1:]
        if words[0] in LONG:
            pytest.skip(f"terrapath {words[0]} takes long; it has tests of its own")
        for name, layout in MAPS.items():
            if name in command and not Path(name).exists():
                write_map(name, *layout)
        assert run(words) == 0, command


@pytest.mark.parametrize("page", LINKING, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_lead_somewhere(page):
    for link in re.findall(r"\]\(([^)\s]+)\)", FENCED.sub("", page.read_text())):
        place, _, anchor = link.partition("#")
        if "://" not in link:
            target = page.parent / place if place else page
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


def test_the_reference_holds_the_public_face_and_nothing_else():
    pages = "\n".join(page.read_text() for page in REFERENCE)
    names = re.findall(r"^::: terrapath\.([\w.]+)$", pages, re.MULTILINE)
    packages = {name: getattr(tp, name).__all__ for name in ("scenario", "travel")}
    inside = {f"{package}.{name}" for package, names in packages.items() for name in names}
    assert sorted(names) == sorted({*tp.__all__} - {"__version__", *packages} | inside)


def test_there_are_examples():
    codes = [code for code, _ in examples("python")]
    assert len(codes) >= 20
    assert sum(len(list(promises(code))) for code in codes) >= 7
    assert len(list(scripts())) >= 10


@pytest.mark.parametrize("printed", ["15.734153368 9.0", "[15.734152811  9.04]"])
def test_what_is_printed_is_held_against_the_comment(printed):
    assert shows(printed, "15.734153")
    assert shows(printed, "15.7341... and 9.0")
    assert not shows(printed, "15.734154")
    assert not shows(printed, "15.735...")
    assert not shows(printed, "9.0 15.734153")
    assert not shows("", "9.0")
