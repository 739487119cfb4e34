"""``terrapath schema``: the JSON Schema of scenario files."""

from __future__ import annotations

import json

import typer


def schema_command() -> None:
    """Print the JSON Schema of scenario files, for editors that check and complete them."""
    from ..scenario.checked import scenario_schema

    typer.echo(json.dumps(scenario_schema(), indent=2))
