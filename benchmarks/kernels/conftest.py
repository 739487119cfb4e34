"""The ratios of a run: a table that compares them with a stored baseline, and the storing."""

import json
from pathlib import Path

import pytest

from terrapath.paper.report import machine_lines

BASELINE = Path(__file__).with_name("baseline.json")
SLOWER = 30.0  # a kernel that is slower by more than this is marked, percent

MEASURED = pytest.StashKey[list[dict]]()


def pytest_addoption(parser):
    """Add the option that stores the baseline."""
    parser.addoption(
        "--store-ratios", action="store_true", help="make the ratios of this run the baseline"
    )


def pytest_configure(config):
    """Begin with an empty table."""
    config.stash[MEASURED] = []


@pytest.fixture
def note(request):
    """A function that enters a measure into the table."""
    return request.config.stash[MEASURED].append


def stored():
    """The baseline: its machine, and ratios by the names of kernels."""
    if not BASELINE.exists():
        return {"machine": "no baseline is stored", "ratios": {}}
    return json.loads(BASELINE.read_text(encoding="utf-8"))


def four_digits(ratio):
    """The ratio to four digits, which is as exact as it is."""
    return float(f"{ratio:.4g}")


def change(kernel, ratio, ratios):
    """How much slower than the baseline, in words."""
    if kernel not in ratios:
        return "new"
    percent = 100.0 * (ratio / ratios[kernel] - 1.0)
    return f"{percent:+.0f} %{'  SLOWER' if percent > SLOWER else ''}"


def pytest_terminal_summary(terminalreporter, config):
    """Print the table; store the baseline with --store-ratios."""
    measured, baseline = config.stash[MEASURED], stored()
    if not measured:
        return
    line, ratios = terminalreporter.write_line, baseline["ratios"]
    terminalreporter.section("kernels beside their reference loops")
    line(f"{'kernel':24} {'ns':>14} per     {'ratio':>13}  against the baseline")
    for row in measured:
        shown = f"{row['kernel']:24} {row['nanoseconds']:14,.1f} {row['item']:8}"
        ratio = four_digits(row["ratio"])
        line(f"{shown}{ratio:13,.1f}  {change(row['kernel'], ratio, ratios)}")
    line(f"At a ratio of 2, an item takes as long as two steps. Baseline: {baseline['machine']}")
    if config.getoption("store_ratios"):
        found = {row["kernel"]: four_digits(row["ratio"]) for row in measured}
        new = {"machine": machine_lines()[-1], "ratios": ratios | found}
        BASELINE.write_text(json.dumps(new, indent=1) + "\n", encoding="utf-8")
        line(f"stored in {BASELINE}")
