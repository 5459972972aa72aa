"""Content of the page of a system without a lattice. `phigen.cli.report_material` collects the content."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from phigen.compilation import Compilation
from phigen.proofs.examination import Examination
from phigen.report.live import Live
from phigen.runtime.trajectory import Trajectory
from phigen.spec.model import Run
from phigen.study.backward import Constancy
from phigen.study.lyapunov import Spectrum
from phigen.study.precision import Study
from phigen.study.summary import Summary
from phigen.study.verification import Verification
from phigen.symbolic.arrays import Floats


@dataclass(frozen=True)
class Material:
    """Proofs of a spec and measurements on one run. Missing parts are None, and ``notes`` give the reasons.

    ``steps`` describes the steps of the run. ``methods`` maps the labels of methods to their trajectories; the solver
    comes first. If the rows of ``methods`` are several steps apart, ``opening`` has trajectories of the first steps,
    with a row for every step. ``section`` has three parts: the function whose zeros define the Poincaré section, some
    of the points (rows, DIM), and the number of all points. ``spectrum`` contains the Lyapunov exponents. ``constancy``
    measures the modified Hamiltonian along the run; if it is missing, ``no_constancy`` is the reason. ``environment``
    describes the conditions under which times were measured. ``command`` is the command that writes the page again.
    """

    examination: Examination
    compilation: Compilation
    command: str
    run: Run | None = None
    steps: str = ""
    methods: Mapping[str, Trajectory] = field(default_factory=dict)
    opening: Mapping[str, Trajectory] = field(default_factory=dict)
    summaries: tuple[Summary, ...] = ()
    section: tuple[str, Floats, int] | None = None
    spectrum: Spectrum | None = None
    verification: Verification | None = None
    constancy: Constancy | None = None
    no_constancy: str = ""
    study: Study | None = None
    live: Live | None = None
    environment: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
