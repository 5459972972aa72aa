"""Interruption of runs at a point that the test chooses."""

import itertools
from contextlib import contextmanager, nullcontext

import pytest

from phigen.cli.interruption import Stop


@contextmanager
def interrupted(pieces, steps=16):
    """Interrupt each run of the command line after ``pieces`` pieces.

    A piece has at most ``steps`` steps, or as many as there are between two rows.
    """
    asked = itertools.count()

    class Later(Stop):
        @property
        def requested(self):
            return next(asked) >= pieces

        @requested.setter
        def requested(self, value):
            pass

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("phigen.runtime.march._MOST_STEPS", steps)
        patch.setattr("phigen.cli.recording.interruptible", lambda: nullcontext(Later()))
        yield
