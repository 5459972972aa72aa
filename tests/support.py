"""Functions that many tests use, collected so that tests import them from one module."""

from many_digits import *  # noqa: F403
from solvers import *  # noqa: F403
from systems import *  # noqa: F403
from tools import *  # noqa: F403
