"""Comparison of the sweep in a store with a requested sweep, in all settings that determine the results."""

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

#: Entries of a plan that determine the results, with their names in messages. Names of sweeps and runs, and the
#: division into chunks, are left out, since results do not depend on them.
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

#: Entries of a plan that determine only the statistics of observables over a run, with their names in messages.
_AVERAGED = {"after": "average: after:", "blocks": "average: blocks:", "stride": "stride:"}

#: Facts that determine the results of a sweep: key in the result of `_facts` → name in messages.
_FACTS = {"target": "target", "phigen": "version of phigen", "folder": "folder of the spec", "contents": "data files"}

#: Largest number of characters of a value that is quoted in a message.
_SHORT = 40


def differences(
    job: store.Job, plan: Plan, solver: Mapping[str, Any], spec: Spec, listed: Mapping[str, Floats]
) -> list[str]:
    """Return phrases for messages, one for each difference between the sweep in a store and the requested sweep.

    The requested sweep has the ``plan``, the ``solver`` (as `store.solver_data` describes it), the ``spec``, and the
    values ``listed`` of a file of members.
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
    """Return a copy of ``about``, the origin of a sweep, with the additional key ``folder``: the folder of the spec."""
    return {**about, "folder": str(Path(about["file"]).parent) if "file" in about else None}


def _phrases(name: str, stored: Any, requested: Any) -> list[str]:
    """Return a phrase if two values of an entry differ: ``number of steps 60, not 61`` or ``other initial values``.

    For mappings, there is a phrase for each key whose values differ.
    """
    if stored == requested:
        return []
    if isinstance(stored, dict) and isinstance(requested, dict) and stored.keys() == requested.keys():
        noun = name.removesuffix("s")
        return [p for key, value in stored.items() for p in _phrases(f"{noun} {key}", value, requested[key])]
    if max(len(str(stored)), len(str(requested))) > _SHORT or isinstance(stored, list | tuple | dict):
        return [f"other {name.rstrip(':')}"]
    return [f"{name} {stored}, not {requested}"]


def _differences_of_solver(job: store.Job, solver: Mapping[str, Any]) -> list[str]:
    """Return a list with a phrase for a message if the solver differs from that of the stored sweep, otherwise
    [].

    The headers of files and the digest of the spec are not compared.
    """
    stored = store.solver_data(job.interface, job.files, job.functions, job.spec)
    stored_texts, texts = ([*about["files"].values(), about["functions"]] for about in (stored, solver))
    same = stored["interface"] == solver["interface"] and [*map(_body, stored_texts)] == [*map(_body, texts)]
    return [] if same else ["another solver: other equations, observables, order, scheme or profile"]


def _body(text: str) -> str:
    """Return the text of a generated file for a comparison: without the header and the digest of the spec."""
    return re.sub(r'(SPEC_SHA256\W+)"[0-9a-f]{64}"', r"\1", header.split(text)[1])


def _differences_of_run(job: store.Job, plan: Plan, spec: Spec) -> list[str]:
    """Return phrases for differences in those settings of the run that are not in the plan.

    These settings are the section, and the initial state and arrays of a lattice. Workers read them from the spec.
    """
    if "crossings" not in plan.keep and not plan.sizes:
        return []
    stored_spec = specs.loads(job.spec)
    stored, run = stored_spec.runs.get(job.plan.about["run"]), spec.runs.get(plan.about["run"])
    if stored is None or run is None:  # a run that was made by arguments in Python is not in the spec
        return []
    phrases = []
    if "crossings" in plan.keep and (stored.section, stored.direction) != (run.section, run.direction):
        phrases.append("another section")
    if run.lattice is not None and [*_start(stored_spec, stored)] != [*_start(spec, run)]:
        phrases.append("other initial values, bonds or parameters at sites")
    return phrases


def _start(spec: Spec, run: Run) -> Iterator[Any]:
    """Yield the settings of a run and a spec that determine the initial state, bonds and parameter arrays of a
    lattice."""
    if run.lattice is not None:
        yield from (run.lattice.state, run.lattice.bonds, run.lattice.arrays, run.initial)
    yield from ((p.name, p.values) for p in spec.parameters)
