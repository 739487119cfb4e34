"""Floor 0: the numerical core.

Every function here is a Numba kernel over plain arrays and ``NamedTuple``s of
arrays. Kernels allocate as little as possible, never raise, never touch global
state, and import nothing from the floors above, so that each one can be read,
timed and tested alone. They run unchanged as plain Python when
``NUMBA_DISABLE_JIT=1``.
"""
