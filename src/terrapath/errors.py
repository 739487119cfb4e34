"""What goes wrong with an input. Every message names the value, the limit and the remedy."""


class TerrapathError(Exception):
    """Base of every error that Terrapath raises on purpose. The command exits with 2."""


class InputError(TerrapathError, ValueError):
    """An argument that cannot be used."""


class OutsideSurfaceError(InputError):
    """A point where the surface is not defined."""


class BlockedError(InputError):
    """A point that no path can be at."""


class FitError(InputError):
    """A function that no spline of a reasonable size follows to the asked tolerance."""


class MapError(TerrapathError):
    """A file that cannot be read as a map, or written."""


class MissingExtraError(TerrapathError, ImportError):
    """A package that not every installation has. The message names the command to install it."""


class CertificateError(TerrapathError):
    """A certificate that does not prove what it claims."""


class TerrapathWarning(UserWarning):
    """Base of every warning that Terrapath gives on purpose. The command shows it as one line."""


class KernelWarning(TerrapathWarning, RuntimeWarning):
    """Kernels are compiled more slowly or more often than they could be."""


class UnfinishedWarning(TerrapathWarning, RuntimeWarning):
    """A path could not be refined or bounded, and is left out or given as it was before."""
