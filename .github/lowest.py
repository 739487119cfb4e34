"""Print the lowest version of each dependency that pyproject.toml allows, as pip's constraints."""

import itertools
import re
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())["project"]
extras = project["optional-dependencies"].values()
for requirement in itertools.chain(project["dependencies"], *extras):
    if lowest := re.match(r"([\w.-]+).*?>=\s*([\w.]+)", requirement):
        print(f"{lowest[1]}=={lowest[2]}")
