"""Numbers with their units, as reports and files show them."""

import pytest

from terrapath.surface.georeference import amount


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (16.9957845, "m", "16.996 m"),
        (16.9957845, "weighted m", "16.996 weighted m"),
        (0.0123456, "m", "0.012346 m"),
        (21536.0, "ft", "21,536.000 ft"),
        (17.0181234, "weighted units", "17.018123 weighted units"),
        (17.0181234, "", "17.018123"),
        (1234.5678, "", "1,234.568"),
        (61.5, "s", "0:01 h (61.500 s)"),
    ],
)
def test_numbers_have_the_digits_that_their_unit_makes_sense_of(value, unit, shown):
    assert amount(value, unit) == shown
