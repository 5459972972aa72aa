"""Assignment of the devices of a machine to the workers of a sweep."""

from __future__ import annotations

import os

from phigen import registry
from phigen.runtime.devices.device import CHOICE
from phigen.runtime.devices.opening import devices_of
from phigen.runtime.members import cores
from phigen.sweeping.store import imported


def workers_of(target: str) -> int:
    """Return the default number of workers on this machine: one for each device of a target, or for each core."""
    if target not in registry.DEVICES:
        return cores()
    return 1 if os.environ.get(CHOICE) else devices_of(target)


def own_device(target: str) -> int | None:
    """Return the device number of this worker; None for the default device or the one that `CHOICE` selects.

    Dask numbers the workers of a machine; consecutive workers use consecutive devices.
    """
    if target not in registry.DEVICES or os.environ.get(CHOICE):
        return None
    try:
        name = imported("distributed").get_worker().name
    except ValueError:  # this process is not a worker
        return None
    return name % devices_of(target) if isinstance(name, int) else None
