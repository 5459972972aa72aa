"""Expressions of ``stop`` that are written on the command line instead of in a spec."""

from __future__ import annotations

from dataclasses import replace

from phigen.errors import Location
from phigen.spec.declarations import declare
from phigen.spec.fields import SPEC
from phigen.spec.kinds import Reader
from phigen.spec.lattice_sections import watched_names
from phigen.spec.model import Spec
from phigen.spec.problems import Problems
from phigen.spec.runs import crossed
from phigen.spec.yaml_source import Scalar, read
from phigen.symbolic.expression import Expression


def stop_of(spec: Spec, run: str, text: str, place: str) -> Expression | None:
    """Return the expression in a text from the command line. It may use the names that ``stop:`` of a run may use.

    Raises `SpecError` with the messages that ``stop:`` in a spec would have. In the messages, columns are those of the
    text, and ``place`` stands for the name of the file.
    """
    of_spec = Reader(Problems(spec.file, spec.source))
    declared = declare(SPEC.read(read(spec.source, of_spec.problems), (), of_spec) or {}, of_spec)
    reader, begin = Reader(Problems(place, text)), Location(1, 1, place)
    if spec.noise:
        reader.problems.add("stop: not available with noise", begin)
    reader.locations["runs", run, "stop"] = begin
    watched = watched_names(declared, spec.observables, spec.recorded)
    node = Scalar(begin, text, plain=False, offset=0)
    stop = crossed(run, "stop", {"stop": node}, replace(declared, reader=reader), replace(watched, piecewise=True))
    reader.problems.finish()
    return stop
