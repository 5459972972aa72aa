"""Numerical policies are defined once, in phigen/scheme/policies.py, and printed into all targets."""

import re
from dataclasses import fields, replace

import pytest
from support import spec_of

from phigen import resources
from phigen.compiler import compile_spec, emit
from phigen.scheme import policies

RUNTIMES = [
    *resources.templates().glob("c/runtime/**/*.[ch]"),
    *resources.templates().glob("js/runtime/*.mjs"),
    *resources.templates().glob("numpy/*.jinja"),
]

#: A system for each kind of implicit step, with policies whose numbers its code contains.
CASES = {
    "rigid_body": {
        "start_policy": "probe_step",
        "newton_policy": "shrinking",
        "plausibility_policy": "max_energy_change",
        "gauge_search": "close_call",
        "tangent_policy": "tangent_solved",
    },
    "nambu_pendulum": {"path_policy": "contracting", "path_tangent_policy": "tangent_negligible"},
    "kowalevski_gauss": {"gauss_policy": "rounding", "gauss_tangent_policy": "tangent_shrinking"},
    "point_vortices": {
        "lattice_sweep_policy": "slow",
        "lattice_newton_policy": "useful",
        "lattice_tangent_policy": "nearly_carried",
    },
}


@pytest.mark.thin(2)
@pytest.mark.parametrize("system", CASES)
def test_a_number_is_changed_in_all_targets_by_its_record(system, monkeypatch):
    program = compile_spec(spec_of(system), profile="fast", tangent=True).program
    for policy, name in CASES[system].items():
        monkeypatch.setitem(policies.POLICIES, policy, replace(policies.POLICIES[policy], **{name: 0.0977}))
    for target in ("c", "js", "numpy"):
        text = "".join(emit(program, target, "phigen").values())
        for name in CASES[system].values():
            assert re.search(rf"\b(?:\w+_)?{name.upper()} (?:= )?0\.0977\b", text), f"{name} in {target}"


def test_no_runtime_file_defines_a_number_of_a_policy():
    names = {f.name.upper() for policy in policies.POLICIES.values() for f in fields(policy)}
    defined = re.compile(r"(?:#define PHI_|\bconst |^ *PHI_|^)([A-Z_]+)(?: =)? (?:-?[0-9.]|2 \*\*)", re.MULTILINE)
    for file in RUNTIMES:
        assert not names & set(defined.findall(file.read_text(encoding="utf-8"))), file.name


def test_small_numbers_of_the_runtimes_have_names():
    """A threshold inside an expression would be a policy that is defined separately in each language."""
    threshold = re.compile(r"(?<![\w.])[0-9.]+e-[0-9]+\b|2(?:\.0)? ?\*\* ?-[0-9]+")
    for file in (f for f in RUNTIMES if not f.name.startswith(("lane_functions", "philox", "fmu"))):
        for line in file.read_text(encoding="utf-8").splitlines():
            if re.match(
                r"#define |static const double \w+ = |const [A-Z_]+ = |export const [A-Z]+ = |[A-Z_]+ = | ?\*|/\*",
                line.strip(),
            ):
                continue
            assert set(threshold.findall(line)) <= {"1e-300", "2 ** -53"}, f"{file.name}: {line}"


def test_constants_that_runtimes_import_are_those_of_the_record():
    """Every constant must be read by a runtime, and every constant that a runtime reads must be defined."""
    for file in RUNTIMES:
        text = file.read_text(encoding="utf-8")
        for names, policy in re.findall(r'import \{ (.*) \} from "\./(\w+)\.mjs"', text):
            if policy in policies.POLICIES:
                constants = {c.name for c in policies.POLICIES[policy].constants()}
                assert set(names.split(", ")) <= constants, f"{file.name}: {policy}"
