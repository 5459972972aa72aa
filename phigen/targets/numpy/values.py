"""Values that several templates of NumPy modules use."""

from __future__ import annotations

from phigen.ir.path_functions import TERMS
from phigen.scheme.policies import PathPolicy
from phigen.scheme.program import Program
from phigen.scheme.steps import InnerSolve
from phigen.targets.features import switches
from phigen.targets.header import facts, plain
from phigen.targets.numpy.language import listed, quoted
from phigen.targets.policies import PYTHON, policies_of

_NOISE_ARGUMENTS = """
    Random numbers depend on seed, on the number of the member, and on the number of the step. member is the number of
    the first member, or an array with the numbers of all members; step0 is the number of the first step. `increments`
    replaces the random increments of the noise. Its shape is (steps, increments) or (steps, members, increments)."""

#: Sentences for docstrings in generated modules: on the gauge, on the energy level, and on steps of equal size in the
#: time tau of a monitor.
_OF_GAUGE = """gauge (one factor for each Casimir in GAUGE) replaces the factors that gauge() returns. For a fixed
    gauge, a step is a Poisson map."""
_OF_LEVEL = (
    "The argument gauge is the energy level e; if it is not given, e = -H(x0). For a fixed e, a step is a Poisson map."
)
_OF_TAU = """

    h is the size of a step in the time tau. With times=True, the result is a pair: the states, and an array (rows, ...)
    of their times t."""


#: Names of constants in `phigen.scheme.policies` that NumPy modules do not read.
_NOT_IN_NUMPY = ("TRIALS", "LONGEST_PATH")


def values_of(program: Program) -> dict[str, object]:
    """Return the values that templates of NumPy modules share."""
    said = {"title": plain(program.about.title) or program.name, **facts(program, listed, quoted, "None")}
    policies = {name: PYTHON.text(policy, _NOT_IN_NUMPY) for name, policy in policies_of(program).items()}
    return {**said, **policies, **_of_fixed(program), **_of_time(program), **_of_noise(program), **_of_step(program)}


def _of_fixed(program: Program) -> dict[str, object]:
    """Return the template values that concern gauges, energy levels, steps in tau, and correctors at the ends
    of runs.
    """
    corrected = program.step.corrected
    return {
        "gauge": listed(program.held),
        "monitored": program.monitor is not None,
        "corrected": corrected,
        "state_of_run": "_followed(END, stages[0], x, carry)[0]" if corrected else "x",
        "runs": ", steps if stride is None else stride, steps" * corrected,
        "flows_of_step": "value" if corrected else "SCHEDULE",
        "flows_of_run": "BEGIN + SCHEDULE + END" if corrected else "SCHEDULE",
        "said_of_tau": _OF_TAU * bool(program.monitor),
        "said_of_gauge": _of_gauge(program),
        "prepare_arguments": "values, np.zeros((len(GAUGE), 1)), PROBE_STEP" if program.held else "values, PROBE_STEP",
    }


def _of_gauge(program: Program) -> str:
    """Return what docstrings say about the gauge.

    A second sentence says that a step is a Poisson map. The second sentence is left out for systems with forces, and
    for Gauss steps that preserve the structure only up to the truncation error.
    """
    said = _OF_LEVEL if program.monitor else _OF_GAUGE
    return said.partition(".")[0] + "." if program.truncated or program.forced else said


def _of_time(program: Program) -> dict[str, object]:
    """Return the template values that concern the time: arguments of functions, and text for docstrings."""
    time = bool(program.time)
    return {
        "time": time,
        "at_t": "t, " * time,
        "t0_given": ", t0=0.0" * time,
        "t0_passed": ", t0=t0" * time,
        "said_from_t0": ", from the time t0" * time,
        "said_of_t0": " t0 is the time of x0." * time,
        "said_of_each": "h, t0 and parameters" if time else "h and parameters",
    }


def _of_step(program: Program) -> dict[str, object]:
    """Return the template values that concern the kind of step, its coefficients and stages, and its iteration."""
    step = program.step
    inner, schedule = step.inner_solve or InnerSolve(), step.flow_schedule
    longest, features = PathPolicy().longest_path, switches(program)
    return {
        "path": step.path is not None,
        **{f"taylor_{kind}": features[f"TAYLOR_{kind.upper()}"] for kind in ("product", "chain", "power")},
        "splitting": step.kind.flows,
        "collocation": step.kind.collocates,
        "renewed": step.renewed,
        "prepared": step.prepared,
        "moments": listed(schedule.moments) if schedule and step.refresh else "",
        "middles": listed(program.midpoints),
        "fractions": listed(program.fractions),
        "max_iterations": inner.max_iterations,
        "tolerance": repr(inner.tolerance),
        "path_pieces": repr(tuple(1 << k for k in range(longest.bit_length()))),
        "terms": TERMS,
        "series": len(step.path.series) if step.path else 0,
    }


def _of_noise(program: Program) -> dict[str, object]:
    """Return the template values that concern noise. The values are arguments of functions, text for docstrings, and
    code that renews the coefficients that depend on time or noise.
    """
    noise = program.noise
    renewed, drawn = bool(program.time or noise), ["drawn(done)"] if noise else []
    now = ", ".join(["s", "t0 + done * h" if program.time else "done * h", "h", *drawn])
    first = ["float(t0)" if program.time else "0.0", "float(h)"]
    first += ["_drawing(float(h), len(x), seed, member, step0, increments)(0)"] if noise else []
    named = ("seed", "member", "step0", "increments")
    return {
        "noise_given": ", seed=0, member=0, step0=0, increments=None" * bool(noise),
        "noise_passed": "".join(f", {name}={name}" for name in named) * bool(noise),
        "said_of_noise": _NOISE_ARGUMENTS * bool(noise),
        "of_stage": ", ".join(["_, parameters, h", *(["t"] if program.time else []), *(["dw"] if noise else [])]),
        "stages_now": f"[_renewed({now}) for s in stages]" if renewed else "stages",
        "renewed_stage": f"            stage = _renewed({', '.join(['stage', *first])})\n" if renewed else "",
    }
