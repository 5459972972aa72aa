import atexit
import gc
import os
import re
import signal
import zlib
from collections import defaultdict

import pytest
from hypothesis import settings
from systems import ALIKE, NAMES, QUICK
from tools import WARNINGS, not_tested

from phigen.runtime import toolchain

#: Folders whose tests all run on one worker of pytest-xdist, because they share pages that take long to make.
WHOLE = ("tests/report/",)
#: With --all, a test with the mark `thin` runs one in ONE_IN of its cases, unless the mark says otherwise. With
#: --corpus it runs all cases.
ONE_IN = 2
#: Files whose tests share no compiled system, so that pytest-xdist may give each test to another worker.
APART = ("tests/random/test_differential.py",)


def pytest_addoption(parser):
    parser.addoption(
        "--all", action="store_true", help="run the slow tests too, and compile one system of each kind with -O3"
    )
    parser.addoption("--corpus", action="store_true", help="with --all: include systems that resemble others")
    parser.addoption("--random", type=int, metavar="N", help="test N random systems of each kind, in tests/random")
    parser.addoption("--seed", type=int, default=0, metavar="S", help="seed of the first random system")


def pytest_configure(config):
    settings.register_profile("phigen", max_examples=250 if config.option.all else 130, deadline=None)
    settings.load_profile("phigen")
    # Compiled systems stay in memory for later tests. So the garbage collector has millions of objects to visit, few of
    # them garbage, and it should run rarely.
    gc.set_threshold(200_000, 20, 100)
    if hasattr(config, "workerinput"):
        # This function is called last when a worker ends. It ends the process at once: freeing millions of objects one
        # by one would take seconds.
        atexit.register(os._exit, 0)
    # A shell starts background processes with SIGINT ignored, and child processes inherit that; tests of interrupts
    # need the default handler.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if not toolchain.available():
        raise pytest.UsageError("the tests need a C compiler; on Debian: apt-get install gcc libc6-dev")
    config.addinivalue_line("markers", "exhaustive: runs only with --corpus, or if the test is named as file::name")
    config.addinivalue_line("markers", "slow: runs only with --all or -m, or if the test is named as file::name")
    config.addinivalue_line(
        "markers",
        "corpus: only cases with systems in `systems.QUICK` are quick; systems in `systems.ALIKE` need --corpus",
    )
    config.addinivalue_line(
        "markers",
        "thin(n, of_all=m): one in n of the quick cases runs, chosen by a hash of their names; with --all, one in m of "
        "all cases, by default one in 2",
    )
    config.addinivalue_line("markers", "few(*cases, of): of the cases `of`, all but the named ones are slow")


def pytest_collection_modifyitems(config, items):
    named = any("::" in argument for argument in config.args)
    if named or config.option.corpus:
        return
    selected = _thinned([item for item in items if not _is_slow(item)], lambda mark: mark.args[0])
    if config.option.all or config.option.markexpr:
        selected |= _thinned(
            [item for item in items if not _is_alike(item)], lambda mark: mark.kwargs.get("of_all", ONE_IN)
        )
    remaining = [item for item in items if item in selected]
    config.hook.pytest_deselected(items=[item for item in items if item not in selected])
    items[:] = remaining


def _thinned(items, one_in):
    """Return the set of the items without most cases of the tests with the mark `thin`. One in ``one_in(mark)`` cases
    remains, chosen by a hash of the name, so that with two parameters all values of each occur.
    """
    cases = defaultdict(list)
    for item in items:
        if item.get_closest_marker("thin"):
            cases[item.nodeid.partition("[")[0]].append(item)
    left_out = set()
    for several in cases.values():
        several.sort(key=lambda item: zlib.crc32(item.name.encode()))
        left_out.update(several[-(-len(several) // one_in(several[0].get_closest_marker("thin"))) :])
    return {item for item in items if item not in left_out}


def _is_alike(item):
    return bool(item.get_closest_marker("exhaustive")) or (
        bool(item.get_closest_marker("corpus")) and not _texts(item).isdisjoint(ALIKE)
    )


def _texts(item):
    """Return the parameters of a test that are strings."""
    return {v for v in item.callspec.params.values() if isinstance(v, str)} if hasattr(item, "callspec") else set()


def _is_slow(item):
    texts = _texts(item)
    thinned = [(QUICK, NAMES)] if item.get_closest_marker("corpus") else []
    thinned += [(mark.args, mark.kwargs["of"]) for mark in item.iter_markers("few")]
    return (
        item.get_closest_marker("slow")
        or item.get_closest_marker("exhaustive")
        or any(texts & {*of} - {*few} for few, of in thinned)
    )


def pytest_sessionfinish():
    # pytest runs the garbage collector five times to find unclosed resources; it does not visit frozen objects.
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Give all tests of one system of the corpus to one worker, and all other tests of a file to one worker, so that
    the tests can share compiled systems.
    """
    from xdist.scheduler import LoadScopeScheduling

    class BySystem(LoadScopeScheduling):
        def _split_scope(self, nodeid):
            if nodeid.startswith(APART):
                return nodeid
            systems = {part for part in re.split(r"[-\]\[]", nodeid) if part in NAMES}
            return (
                min(systems)
                if systems
                else next((room for room in WHOLE if nodeid.startswith(room)), nodeid.split("::")[0])
            )

    return BySystem(config, log)


@pytest.fixture(scope="session", autouse=True)
def compiled_solvers(tmp_path_factory):
    """Let all tests and workers of one session share compiled C, in a folder other than the cache of the user.

    Every solver that a test compiles must compile without a warning. Compilers need a sixth of the time with -O0, which
    gives fewer warnings than -O3. Tests that need -O3 set the flag themselves, and tests of the corpus use
    `as_users_compile`.
    """
    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if base.name.startswith("popen-") else base) / "solvers"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PHIGEN_CACHE_DIR", str(shared))
        patch.setattr(toolchain, "BASE_FLAGS", (*_optimised("-O0"), *WARNINGS))
        yield shared


@pytest.fixture
def as_users_compile(request, compiled_solvers, monkeypatch):
    """With --all, compile C with -O3, as users do. Tests that name systems of the corpus do so only for systems in
    `QUICK`.
    """
    values = request.node.callspec.params.values() if hasattr(request.node, "callspec") else ()
    if request.config.option.all and {*map(str, values)}.isdisjoint({*NAMES} - {*QUICK}):
        monkeypatch.setattr(toolchain, "BASE_FLAGS", _optimised("-O3"))


def _optimised(how):
    return tuple(how if flag.startswith("-O") else flag for flag in toolchain.BASE_FLAGS)


@pytest.fixture
def without_compiler(monkeypatch, tmp_path_factory):
    """Hide all C compilers: those in PATH, the variable CC, and the compilers in Python packages."""
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path_factory.mktemp("empty")))
    monkeypatch.setattr(toolchain, "find_spec", lambda name: None)


def pytest_terminal_summary(terminalreporter, exitstatus, config):
    if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED and not config.option.all:
        terminalreporter.write_line("no quick test was selected; --all runs the slow tests too")
    skipped = [report.longrepr[2] for report in terminalreporter.stats.get("skipped", [])]
    if skipped:
        terminalreporter.section("skipped tests")
        for line in not_tested(skipped):
            terminalreporter.write_line(line)
