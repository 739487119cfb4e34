from .custom import from_function as from_function, from_table as from_table
from .energy import llobera_sluckin as llobera_sluckin, minetti as minetti, pandolf as pandolf
from .model import TravelModel as TravelModel
from .registry import by_name as by_name
from .vehicles import vehicle as vehicle
from .walking import (
    campbell as campbell,
    irmischer_clarke as irmischer_clarke,
    langmuir as langmuir,
    naismith as naismith,
    tobler as tobler,
)
