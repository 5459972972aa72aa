"""Assignment of the devices (graphics cards) of a machine to the worker processes of a sweep."""

from __future__ import annotations

import os

from phigen import registry
from phigen.runtime.devices.device import CHOICE
from phigen.runtime.devices.opening import devices_of
from phigen.runtime.members import cores
from phigen.sweeping.store import imported


def workers_of(target: str) -> int:
    """Return the default number of workers on this machine: one for each device if the target has devices, else one for
    each core."""
    if target not in registry.DEVICES:
        return cores()
    return 1 if os.environ.get(CHOICE) else devices_of(target)


def own_device(target: str) -> int | None:
    """Return the number of the device that this worker process uses; None for the default device.

    Dask numbers the workers of a machine, and consecutive workers use consecutive devices. If the environment variable
    PHIGEN_DEVICE is set, it selects a device for all workers, and the result is None.
    """
    if target not in registry.DEVICES or os.environ.get(CHOICE):
        return None
    try:
        name = imported("distributed").get_worker().name
    except ValueError:  # this process is not a worker of Dask
        return None
    return name % devices_of(target) if isinstance(name, int) else None
