"""Records: rows of an array with named fields, the same in plain Python as in compiled kernels."""

import numpy as np


def record(*fields):
    """The type of records with these (name, type); each field is an attribute of a row."""
    return np.dtype((np.record, list(fields)))
