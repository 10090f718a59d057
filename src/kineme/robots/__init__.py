"""From a movement to the joints of an arm: models, inverse kinematics, timing, and checks before anything moves."""

from kineme._lazy import lazy_names as _lazy_names

__getattr__, __dir__, __all__ = _lazy_names(__name__)
