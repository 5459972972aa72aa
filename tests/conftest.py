import pytest


@pytest.fixture(scope="session", autouse=True)
def compiled_solvers(tmp_path_factory):
    """Compiled C is shared by all tests and workers of one session, and not left in the cache of the user."""
    base = tmp_path_factory.getbasetemp()
    shared = (base.parent if base.name.startswith("popen-") else base) / "solvers"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PHIGEN_CACHE_DIR", str(shared))
        yield shared
