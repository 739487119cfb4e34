"""Travel models that other packages announce by an entry point."""

import pytest

import terrapath as tp
from common import FLAT, REGION, one_line
from packages import installed_package
from terrapath.cli.main import run

MODULE = """
import terrapath as tp

def snowshoes(speed=1.0):
    return tp.travel.from_table([-0.6, 0.0, 0.6], [3.0 / speed, 1.0 / speed, 4.0 / speed], unit="s")

def no_model():
    return 7
"""
ENTRIES = """[terrapath.travel]
snow-shoes = snow_travel:snowshoes
odd = snow_travel:no_model
lost = no_such_package_at_all:model
tobler = snow_travel:snowshoes
"""


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package that announces models."""
    with installed_package(tmp_path, monkeypatch, "snow_travel", MODULE, ENTRIES):
        yield


def test_a_plug_in_is_travelled_with_by_its_name_and_options(installed):
    assert tp.travel.by_name("snow-shoes").raw(0.0) == 1.0
    assert tp.travel.by_name("snow_shoes", speed=2.0).raw(0.0) == 0.5
    problem = tp.Problem(FLAT, (0, 0), (3, 4), REGION, travel="snow-shoes")
    assert problem.path([problem.start, problem.goal]).value == pytest.approx(5.0)


def test_the_command_lists_it_and_shows_it(installed, capsys):
    assert run(["travel"]) == 0
    assert "snow_shoes, of snow_travel:snowshoes" in capsys.readouterr().out
    assert run(["travel", "snow-shoes", "speed=2"]) == 0


@pytest.mark.parametrize(
    ("name", "options", "shown"),
    [
        ("odd", {}, "makes no travel model, but int"),
        ("lost", {}, "cannot be loaded"),
        ("snowshoes", {}, "did you mean snow_shoes"),
        ("snow-shoes", {"sped": 1}, "did you mean speed"),
    ],
)
def test_what_cannot_be_used_is_one_line(installed, name, options, shown):
    with pytest.raises(tp.InputError, match=shown) as caught:
        tp.travel.by_name(name, **options)
    one_line(caught)


def test_no_plug_in_takes_the_name_of_a_model_of_ours(installed):
    assert tp.travel.by_name("tobler").source == tp.travel.tobler().source
