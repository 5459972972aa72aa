"""Differences between the sweep in a store and a requested one, in the settings that determine the results."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from phigen import spec as specs
from phigen.runtime.interface import Floats
from phigen.spec.model import Run, Spec
from phigen.sweeping import store
from phigen.sweeping.plan import Plan
from phigen.targets import header

#: Names of the entries of a plan in messages. The names of sweeps and runs and the division into chunks are not among
#: them, since results do not depend on them.
_ENTRIES = {
    "coordinates": "coordinates",
    "sizes": "sizes of the lattice",
    "initial": "initial values",
    "parameters": "parameters",
    "h": "step",
    "t0": "time at the start",
    "steps": "number of steps",
    "axes": "ranges of over:",
    "members": "number of members",
    "listed": "columns of the file of members",
    "seed": "seed of the sweep",
    "noise": "seed of the noise",
    "keep": "keep:",
    "frames": "frames:",
}

#: Entries that affect only the statistics of observables over a run.
_AVERAGED = {"after": "average: after:", "blocks": "average: blocks:", "stride": "stride:"}

#: Additional properties of a plan, with their names in messages.
_FACTS = {"target": "target", "phigen": "version of phigen", "folder": "folder of the spec", "contents": "data files"}

#: Largest number of characters of a value in a message.
_SHORT = 40


def differences(
    job: store.Job, plan: Plan, solver: Mapping[str, Any], spec: Spec, listed: Mapping[str, Floats]
) -> list[str]:
    """Return the differences of the sweep in a store from a plan: one phrase for each entry that determines results.

    ``solver`` describes the solver (see `store.solver_data`), ``listed`` the values from a file of members.
    """
    ours, theirs = plan.as_json(), job.plan.as_json()
    entries = _ENTRIES | (_AVERAGED if any("(" in word for word in plan.keep) else {})
    phrases = [phrase for key, name in entries.items() for phrase in _phrases(name, theirs[key], ours[key])]
    before, now = _facts(theirs["about"]), _facts(ours["about"])
    phrases += [phrase for key, name in _FACTS.items() for phrase in _phrases(name, before.get(key), now.get(key))]
    if not phrases:
        phrases += _differences_of_solver(job, solver)
        phrases += _differences_of_run(job, plan, spec)
        if any(not np.array_equal(job.root[name][:], values, equal_nan=True) for name, values in listed.items()):
            phrases.append("other values in the file of members")
    return phrases


def _facts(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the additional properties of a plan, with the folder of the spec in place of its file."""
    return {**about, "folder": str(Path(about["file"]).parent) if "file" in about else None}


def _phrases(name: str, stored: Any, requested: Any) -> list[str]:
    """Return phrases such as ``number of steps 60, not 61`` or ``other initial values``; for mappings, one for each
    entry."""
    if stored == requested:
        return []
    if isinstance(stored, dict) and isinstance(requested, dict) and stored.keys() == requested.keys():
        noun = name.removesuffix("s")
        return [p for key, value in stored.items() for p in _phrases(f"{noun} {key}", value, requested[key])]
    if max(len(str(stored)), len(str(requested))) > _SHORT or isinstance(stored, list | tuple | dict):
        return [f"other {name.rstrip(':')}"]
    return [f"{name} {stored}, not {requested}"]


def _differences_of_solver(job: store.Job, solver: Mapping[str, Any]) -> list[str]:
    """Return differences of the solver; comments and the digest of the spec in its files are ignored."""
    stored = store.solver_data(job.interface, job.files, job.functions, job.spec)
    stored_texts, texts = ([*about["files"].values(), about["functions"]] for about in (stored, solver))
    same = stored["interface"] == solver["interface"] and [*map(_body, stored_texts)] == [*map(_body, texts)]
    return [] if same else ["another solver: other equations, observables, order, scheme or profile"]


def _body(text: str) -> str:
    """Return a generated file without its header and without the digest of its spec."""
    return re.sub(r'(SPEC_SHA256\W+)"[0-9a-f]{64}"', r"\1", header.split(text)[1])


def _differences_of_run(job: store.Job, plan: Plan, spec: Spec) -> list[str]:
    """Return differences in the settings of the run that workers read from the spec: sections, and initial states of
    lattices."""
    if "crossings" not in plan.keep and not plan.sizes:
        return []
    stored_spec = specs.loads(job.spec)
    stored, run = stored_spec.runs.get(job.plan.about["run"]), spec.runs.get(plan.about["run"])
    if stored is None or run is None:  # the run was built in Python
        return []
    phrases = []
    if "crossings" in plan.keep and (stored.section, stored.direction) != (run.section, run.direction):
        phrases.append("another section")
    if run.lattice is not None and [*_start(stored_spec, stored)] != [*_start(spec, run)]:
        phrases.append("other initial values, bonds or parameters at sites")
    return phrases


def _start(spec: Spec, run: Run) -> Iterator[Any]:
    """Yield the settings that determine the initial state of a lattice and its arrays."""
    if run.lattice is not None:
        yield from (run.lattice.state, run.lattice.bonds, run.lattice.arrays, run.initial)
    yield from ((p.name, p.values) for p in spec.parameters)
