"""Devices of the workers of a sweep: each takes one of those of its machine."""

from __future__ import annotations

import os

from phigen import registry
from phigen.runtime.devices.device import CHOICE
from phigen.runtime.devices.opening import devices_of
from phigen.runtime.members import cores
from phigen.sweeping.store import imported


def workers_of(target: str) -> int:
    """Return the number of workers on this machine: one for each device of a target, or for each core."""
    if target not in registry.DEVICES:
        return cores()
    return 1 if os.environ.get(CHOICE) else devices_of(target)


def own_device(target: str) -> int | None:
    """Return the number of the device of this worker; None for the default one, or that of `CHOICE`.

    Workers of one machine are numbered by Dask, and take its devices in turn.
    """
    if target not in registry.DEVICES or os.environ.get(CHOICE):
        return None
    try:
        name = imported("distributed").get_worker().name
    except ValueError:  # no worker
        return None
    return name % devices_of(target) if isinstance(name, int) else None
