"""The entry point: help, version, scenes, the installed script."""

import subprocess
import sys
from pathlib import Path

import terrapath as tp
from terrapath.cli.main import run


def test_scenes_lists_every_scene(capsys):
    assert run(["scenes"]) == 0
    listed = capsys.readouterr().out
    for name in tp.scenes.names():
        assert name in listed


def test_help_and_version_need_no_heavy_import():
    program = (
        "import sys\n"
        "from terrapath.cli.main import run\n"
        "assert run(['--version']) == 0\n"
        "assert run(['--help']) == 0\n"
        "for command in ('plan', 'check', 'field'):\n"
        "    assert run([command, '--help']) == 0\n"
        "heavy = {'numba', 'numpy', 'scipy', 'matplotlib', 'rasterio', 'shapely', 'sympy'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert tp.__version__ in done.stdout
    assert "terrapath" in done.stdout


def test_the_installed_script_answers():
    script = Path(sys.executable).with_name("terrapath")
    done = subprocess.run([script, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == f"terrapath {tp.__version__}"
