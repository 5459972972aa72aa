"""The name of a spec hides no header and no module, and no two solvers in one program share a symbol."""

import re
import subprocess
import sys

import pytest
from support import compile_text, files, tool

from phigen import System, resources
from phigen.errors import SpecError
from phigen.spec.names import SPEC_NAME
from phigen.spec.taken import CLASHING_ENDS, objection

_STANDARD = """assert complex ctype errno fenv float inttypes iso646 limits locale math setjmp signal stdalign stdarg
stdatomic stdbool stddef stdint stdio stdlib stdnoreturn string tgmath threads time uchar wchar wctype"""
_POSIX = """aio cpio dirent dlfcn fcntl fmtmsg fnmatch ftw glob grp iconv langinfo libgen monetary mqueue ndbm netdb
nl_types poll pthread pwd regex sched search semaphore spawn strings stropts syslog tar termios trace ulimit unistd
utime utmpx wordexp features endian getopt alloca malloc memory obstack argp"""
_CPP = "algorithm chrono complex filesystem fstream functional iostream map memory random regex string thread vector"


def reached(compiler, language, names):
    """Return the names, without suffix, of all headers in the folders of the search path that the headers ``names``
    include, directly or through others. Names that do not exist are left out.
    """
    text = "".join(f"#if __has_include(<{name}>)\n#include <{name}>\n#endif\n" for name in names)
    command = [tool(compiler), "-x", language, "-E", "-M", "-v", "-"]
    process = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
    searched = re.search(r"#include <\.\.\.> search starts here:\n(.*?)End of search list", process.stderr, re.DOTALL)
    # Files in backward/ are included as backward/NAME, so a header called NAME does not hide them.
    folders = {line.strip() for line in searched[1].splitlines() if not line.endswith("/backward")}
    paths = [path.rpartition("/") for path in process.stdout.split() if path.endswith(".h")]
    return {file.removesuffix(".h") for folder, _, file in paths if folder in folders}


@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_no_name_of_a_spec_hides_a_header_that_others_include(compiler):
    plus = {"gcc": "g++", "clang": "clang++"}[compiler]
    headers = reached(compiler, "c", [f"{n}.h" for n in [*_STANDARD.split(), *_POSIX.split()]])
    headers |= reached(plus, "c++", _CPP.split())
    assert {"features", "stdio", "stddef", "pthread"} <= headers
    assert [n for n in sorted(headers) if re.fullmatch(SPEC_NAME, n) and objection(n) is None] == []


def test_no_name_of_a_spec_hides_a_module_of_python_or_of_its_packages():
    modules = [*sys.stdlib_module_names, "numpy", "scipy", "sympy", "matplotlib", "phigen"]
    assert [n for n in modules if re.fullmatch(SPEC_NAME, n) and objection(n) is None] == []


def symbols(name, header):
    """Return the symbols in a header that begin with the name of the spec, without this prefix."""
    return set(re.findall(rf"\b{name}_(\w+)", re.sub(r"/\*.*?\*/", "", header, flags=re.DOTALL)))


@pytest.fixture(scope="module")
def declared():
    """Return the symbols of all bundled solvers, and of a solver with all optional functions, without the names of
    specs.
    """
    asked = compile_text(
        "coordinates: [q, p]\npoisson: {canonical: {q: [q], p: [p]}}\nhamiltonian: q**2 + p**2\norder: 1\n"
        "tangent: true\nadjoint: true\nmodified_hamiltonian: 1\n"
    )
    declared_names = symbols("t", files(asked, "c")["t.h"])
    root = resources.bundled_specs().parent
    for header in (root / "generated").glob("*/*.h"):
        declared_names |= symbols(header.stem, header.read_text())
    for golden in (root / "tests" / "golden").glob("*.txt"):
        header_text = golden.read_text().partition(f"==== {golden.stem}.h ====")[2].partition("\n==== ")[0]
        declared_names |= symbols(golden.stem, header_text)
    assert {"attitude", "init", "init_gauge", "default_params", "step_tangent", "modified_hamiltonian"} < declared_names
    return declared_names


def test_no_two_specs_share_a_symbol(declared):
    """A symbol of one solver can only equal a symbol of another solver if one of the specs has a name that ends in a
    word such as _default. The list of refused ends has exactly these words.
    """
    pairs = {(s.removesuffix(f"_{t}"), s) for s in declared for t in declared if s.endswith(f"_{t}")}
    # Names of specs have no capital letters.
    clashing = {end: s for end, s in sorted(pairs, reverse=True) if end.islower()}
    assert clashing == CLASHING_ENDS
    for end in CLASHING_ENDS:
        assert f"a_{CLASHING_ENDS[end]}" in objection(f"a_{end}")[0]
        assert objection(f"{end}_a") is None


def test_no_symbol_of_a_solver_is_one_of_the_c_library(declared):
    libraries = [
        run_text(tool("gcc"), f"-print-file-name={name}") for name in ("libc.so.6", "libm.so.6", "libresolv.so.2")
    ]
    listed = run_text(tool("nm"), "-D", "--defined-only", *libraries)
    known = {line.split()[-1].partition("@")[0] for line in listed.splitlines() if line.strip()}
    assert {"sem_init", "printf"} < known
    names = {s.removesuffix(f"_{t}") for s in known for t in declared if s.endswith(f"_{t}")}
    assert [n for n in sorted(names) if re.fullmatch(SPEC_NAME, n) and objection(n) is None] == []


def run_text(*command):
    """Run a command and return its output."""
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.parametrize(
    "name", ["wave_packet", "atom", "features2", "res_x", "default_body", "modified", "com10", "test"]
)
def test_other_names_are_free(name):
    assert objection(name) is None


@pytest.mark.parametrize(
    ("name", "parameter", "complaint"),
    [
        ("math", "k", "hide the header"),
        ("body_default", "k", "clash"),
        ("body", "h", "called 'h'"),
        ("Body", "k", "cannot be used"),
    ],
)
def test_systems_from_sympy_obey_the_same_rules(name, parameter, complaint):
    import sympy

    import phigen

    q, p, k = sympy.symbols(["q", "p", parameter])
    system = System.from_sympy([q, p], sympy.Matrix([[0, 1], [-1, 0]]), k * q**2 + p**2, {k: 1}, name=name)
    with pytest.raises(SpecError, match=complaint):
        phigen.compile(system)
