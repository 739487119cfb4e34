"""Every example in the documentation runs."""

import re
import shlex
from pathlib import Path

import pytest

from terrapath.cli.main import run

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LUNAR_MAP = ROOT.parent / "shared" / "data" / "herodotus_mons.tif"


def python_examples():
    for page in PAGES:
        for k, code in enumerate(re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)):
            yield pytest.param(code, id=f"{page.name}-{k}")


def commands():
    for page in PAGES:
        for line in re.findall(r"^    (terrapath .*)$", page.read_text(), re.MULTILINE):
            yield pytest.param(line, id=line[:60])


@pytest.mark.parametrize("code", list(python_examples()))
def test_python_examples_run(code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "<example>", "exec"), {})


@pytest.mark.parametrize("line", list(commands()))
def test_commands_run(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    if "dem.tif" in line:
        pytest.skip("names a map of the reader's own")
    if "reproduce" in line:
        pytest.skip("takes minutes; tests/test_reproduce.py runs it")
    if "herodotus" in line:
        if not LUNAR_MAP.exists():
            pytest.skip("the lunar map is not here")
        (tmp_path / LUNAR_MAP.name).symlink_to(LUNAR_MAP)
    assert run(shlex.split(line)[1:]) == 0


def test_there_are_examples():
    assert len(list(python_examples())) >= 5
    assert len(list(commands())) >= 3
    assert all(
        (ROOT / "docs" / link).exists()
        for link in re.findall(r"\]\(docs/([^)#]+)\)", (ROOT / "README.md").read_text())
    )
