"""Every error and warning that kineme raises on purpose.

A message says what was expected, what came and what to do next. Each class is also the built-in
error that NumPy and scikit-learn users would catch.
"""


class KinemeError(Exception):
    """Base class: ``except kineme.KinemeError`` catches all of them."""


class TrajectoryError(KinemeError, ValueError):
    """A trajectory or a set of demonstrations is not usable as it is."""


class DegenerateMovementError(TrajectoryError):
    """Start and goal coincide where the original formulation divides by ``g - x0``."""


class SpecificationError(KinemeError, ValueError):
    """A parameter of a specification (DMP, kernel, preprocessing step) is out of its range."""


class DataError(KinemeError, OSError):
    """A file or a packaged data set is missing, truncated or not what its name says."""


class DegenerateMovementWarning(UserWarning):
    """Some movements almost end where they start: their weights are huge and fragile."""


class ExtrapolationWarning(UserWarning):
    """Something is asked for that lies outside what was demonstrated: it is done, and how well is a guess."""
