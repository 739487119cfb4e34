"""The numerical core; its sub-folders mirror the packages above.

Every function here is a Numba kernel over plain arrays and ``NamedTuple``s of
arrays. Kernels allocate as little as possible, never raise and never touch
global state. They import nothing from the layers above, so that each one can be
read, timed and tested alone. With ``NUMBA_DISABLE_JIT=1`` they run unchanged as
plain Python.
"""
