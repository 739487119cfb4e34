"""The benchmarks of kernels: their work runs, at its smallest, and nothing is timed."""

import json
import runpy

import pytest

from common import ROOT

FOLDER = ROOT / "benchmarks" / "kernels"
CASES = runpy.run_path(str(FOLDER / "cases.py"))["CASES"]


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_the_work_of_a_case_runs(case):
    work = case.prepare(case.least)
    assert work.items > 0
    work.run()


def test_the_baseline_has_a_ratio_for_each_case_and_no_other():
    baseline = json.loads((FOLDER / "baseline.json").read_text(encoding="utf-8"))
    assert sorted(baseline["ratios"]) == sorted(case.name for case in CASES)
    assert all(ratio > 0.0 for ratio in baseline["ratios"].values())
