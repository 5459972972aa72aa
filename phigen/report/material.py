"""Everything that a page is made of; gathering it takes the time, see `phigen.cli.report_material`."""

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
    """Proofs, and measurements on one run; missing parts are None, and ``notes`` have the reason.

    ``steps`` are those of the run, in words. ``methods`` are trajectories by their labels, the solver's first;
    ``opening`` has each of the first steps, where ``methods`` do not have all. ``section`` is what its Poincaré section
    is the zero of, some of its points (rows, DIM), and how many there are; ``spectrum`` are its Lyapunov exponents.
    ``constancy`` is that of the modified Hamiltonian; ``no_constancy`` says why there is none.
    ``environment`` says what the times depend on. ``command`` makes the page again.
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
