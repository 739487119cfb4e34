"""``terrapath travel``: the list of models, and one of them."""

import matplotlib.image
import numpy as np
import pytest

import terrapath as tp
from terrapath.cli.main import run
from terrapath.travel.registry import MODELS


def test_the_list_has_every_model_with_its_range_and_source(capsys):
    assert run(["travel"]) == 0
    listed = capsys.readouterr().out
    for name in MODELS:
        assert name in listed
    for part in ("1892", "(1993)", "-45 to 45 %", "-28.6 %", "slope", "J/kg"):
        assert part in listed


def test_one_model_shows_its_pace_and_critical_grades(capsys):
    assert run(["travel", "tobler", "factor=0.6"]) == 0
    shown = capsys.readouterr().out
    assert "Tobler (1993)" in shown
    assert "-28.6 %, 28.6 %" in shown
    assert f"{float(tp.travel.tobler(factor=0.6)(0.3)):.6g}" in shown


def test_a_model_with_a_gauge_and_one_that_is_not_convex_say_so(capsys):
    assert run(["travel", "vehicle", "mass=900", "rolling_resistance=0.1", "regeneration=0.5"]) == 0
    assert "gauge: 8829 J" in capsys.readouterr().out
    assert run(["travel", "campbell"]) == 0
    assert "a lower bound there" in capsys.readouterr().out


@pytest.mark.parametrize("words", [["tobler"], ["minetti"], ["campbell", "percentile=20"]])
def test_a_picture_is_drawn(words, tmp_path, capsys):
    picture = tmp_path / "pace.png"
    assert run(["travel", *words, "--plot", str(picture)]) == 0
    pixels = matplotlib.image.imread(picture)
    assert pixels.shape[0] > 500
    assert len(np.unique(pixels.reshape(-1, pixels.shape[2]), axis=0)) > 50


def test_a_table_is_drawn_within_its_range(tmp_path):
    model = tp.travel.from_table([-0.2, 0.0, 0.1], [1.0, 0.7, 2.0])
    tp.plot_travel(model, tmp_path / "table.svg")
    assert (tmp_path / "table.svg").stat().st_size > 10_000


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["tobbler"], "did you mean tobler?"),
        (["tobler", "factor"], "write NAME=VALUE"),
        (["tobler", "factor=0"], "above 0"),
        (["tobler", "factor=fast"], "above 0"),
        (["tobler", "speed=2"], "no option 'speed'"),
        (["vehicle"], "needs mass and rolling_resistance"),
        (["--plot", "pace.png"], "needs a model"),
        (["tobler", "--plot", "pace.txt"], "no known picture format"),
    ],
)
def test_bad_input_is_one_line(words, message, capsys):
    assert run(["travel", *words]) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
