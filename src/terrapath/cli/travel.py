"""``terrapath travel``: the travel models, and what one says of each grade."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from .console import ExitCode
from .options import as_number

if TYPE_CHECKING:
    from ..travel import TravelModel

SHOWN = (-1.0, -0.5, -0.3, -0.2, -0.1, -0.05, 0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0)


def travel_command(
    model: Annotated[
        str | None, typer.Argument(metavar="MODEL", help="Such as tobler; without it, all.")
    ] = None,
    options: Annotated[
        list[str] | None,
        typer.Argument(metavar="NAME=VALUE", help="Options of the model, such as factor=0.6."),
    ] = None,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Draw its pace: .png, .svg, .pdf or .jpg."),
    ] = None,
) -> int:
    """List the travel models, or show one: its pace, and with the best switchbacks.

    A travel model is what a metre costs in time or energy, uphill and downhill. Plan with it by
    `terrapath plan WHERE --travel MODEL`.
    """
    from ..travel.registry import EXAMPLES, MODELS, by_name, plug_ins

    if model is None:
        if plot is not None:
            raise InputError(f"--plot {plot} needs a model: terrapath travel tobler --plot {plot}")
        _print_all([by_name(name, **EXAMPLES.get(name, {})) for name in MODELS])
        for name, entry in plug_ins().items():
            typer.echo(f"{name}, of {entry.value}")
        return ExitCode.SOLVED
    chosen = by_name(model, **dict(map(_option, options or [])))
    if plot is not None:
        from ..plotting import plot_travel

        plot_travel(chosen, plot)
    _print_one(chosen)
    return ExitCode.SOLVED


def _option(text: str) -> tuple[str, object]:
    name, equals, value = text.partition("=")
    if not (equals and name and value):
        raise InputError(f"{text!r} is not an option of a model; write NAME=VALUE, as factor=0.6")
    return name, as_number(value)


def _print_all(models: list[TravelModel]) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    table = Table(box=None, pad_edge=False)
    for column in ("model", "unit", "grades", "critical grades", "per metre of"):
        table.add_column(column, no_wrap=True)
    for model in models:
        table.add_row(
            model.name,
            model.unit,
            _range(model.grades),
            _critical(model.critical),
            f"{model.distance} distance",
        )
    console.print(table)
    console.print("\nSources:")
    for model in models:
        console.print(f"  {model.name}: {model.source}", soft_wrap=True)


def _print_one(model: TravelModel) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False)
    lines = {
        "source": model.source,
        "given per metre of": f"{model.distance} distance",
        "unit": f"{model.unit} per horizontal metre",
        "grades": _range(model.grades),
        "critical grades": _critical(model.critical),
    }
    if model.gauge:
        lines["gauge"] = (
            f"{model.gauge:.6g} {model.unit} per metre of height: the pace is not above 0"
        )
    if model.bridges:
        lines["not convex at"] = "; ".join(map(_range, model.bridges)) + " (a lower bound there)"
    console.print(repr(model), soft_wrap=True)
    for name, value in lines.items():
        console.print(f"  {name}: {value}", soft_wrap=True)
    table = Table(box=None, pad_edge=False)
    for column in ("grade", "pace", "with switchbacks"):
        table.add_column(column, justify="right")
    low, high = model.grades if model.beyond == "refuse" else (-math.inf, math.inf)
    for grade in (grade for grade in SHOWN if low <= grade <= high):
        raw = float(model.raw(grade))
        shown = f"{raw:.6g}" if math.isfinite(raw) else "-"
        table.add_row(f"{100 * grade:+.0f} %", shown, f"{float(model(grade)):.6g}")
    console.print(table)


def _range(grades: tuple[float, float]) -> str:
    if all(map(math.isinf, grades)):
        return "all"
    low, high = (f"{100 * grade:.3g}" if math.isfinite(grade) else "any" for grade in grades)
    return f"{low} to {high} %"


def _critical(critical: tuple[float, float]) -> str:
    down, up = (f"{100 * grade:.3g} %" if math.isfinite(grade) else "none" for grade in critical)
    return f"{down}, {up}"
