from .answers import Answer as Answer
from .answers import answer as answer
from .answers import check as check
from .answers import field as field
from .checked import scenario_schema as scenario_schema
from .loading import load as load
from .scenario import Scenario as Scenario
from .toml import ScenarioError as ScenarioError
