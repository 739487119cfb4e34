from .answers import Answer as Answer, answer as answer, check as check, field as field
from .checked import scenario_schema as scenario_schema
from .scenario import Scenario as Scenario, load as load
from .templates import template as template
from .toml import ScenarioError as ScenarioError
