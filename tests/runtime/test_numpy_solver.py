import traceback

from phigen.runtime.modules import load_module


def test_traceback_shows_the_generated_line():
    module = load_module("def f(x):\n    return 1 / x  # the culprit\n", "sample")
    try:
        module.f(0)
    except ZeroDivisionError:
        text = traceback.format_exc()
    assert "the culprit" in text
    assert "phigen sample" in text
