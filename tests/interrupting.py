"""Runs that are interrupted when a test says so."""

import itertools
from contextlib import contextmanager, nullcontext

import pytest

from phigen.cli.interruption import Stop


@contextmanager
def interrupted(pieces, steps=16):
    """Runs are interrupted after so many pieces of work, of so many steps at most."""
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
