import subprocess
import sys
from importlib import import_module

import pytest

import phigen
from phigen import resources


def test_importing_phigen_loads_neither_numpy_nor_sympy():
    code = "import sys, phigen; phigen.SpecError; sys.exit(any(m in sys.modules for m in ('numpy', 'sympy', 'click')))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_a_build_of_an_ordinary_system_imports_nothing_of_lattices_or_attitudes():
    code = """
import sys
from phigen import resources, spec
from phigen.compiler import compile_proved, emit
program = compile_proved(spec.load(resources.bundled_specs() / "pendulum_euler.yaml")).program
assert all(emit(program, target, "phigen") for target in ("c", "numpy", "js"))
print(*(m for m in sys.modules if m.startswith(("phigen.lattice", "phigen.attitude", "phigen.targets.c.lattice"))))
"""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert process.stdout.split() == []


def test_public_names_are_found():
    from phigen.errors import StepError

    assert phigen.StepError is StepError
    assert "Trajectory" in dir(phigen)
    with pytest.raises(AttributeError, match="nonsense"):
        phigen.nonsense  # noqa: B018


def test_bundled_specs_are_found():
    assert (resources.bundled_specs() / "rigid_body.yaml").is_file()


@pytest.mark.parametrize("name", ["jax", "torch"])
def test_propagators_say_what_they_need(name, monkeypatch):
    monkeypatch.setitem(sys.modules, name, None)
    monkeypatch.delitem(sys.modules, f"phigen.{name}", raising=False)
    with pytest.raises(phigen.MissingPackageError, match=f"pip install {name}"):
        import_module(f"phigen.{name}")
