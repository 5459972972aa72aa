"""All that tests share, by the names that tests import."""

from many_digits import *  # noqa: F403
from solvers import *  # noqa: F403
from systems import *  # noqa: F403
from tools import *  # noqa: F403
