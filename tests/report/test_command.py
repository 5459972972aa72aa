"""``phigen report``: what it writes, and what it does when something fails."""

from pathlib import Path

import pytest
from cli_specs import GOOD, NOT_POISSON
from click.testing import CliRunner
from html_check import Page

from phigen.cli import group
from phigen.study import verification


@pytest.fixture
def phigen(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    # Figures are slow and have their own tests, so the page is made as if matplotlib were not installed. The patch
    # replaces the look-up of matplotlib and not a function of phigen: modules that are first imported during a test
    # would keep the replacement.
    monkeypatch.setattr("phigen.report.drawable.find_spec", lambda name: None)
    return lambda *args: CliRunner().invoke(group, ["report", *map(str, args)], prog_name="phigen")


def write(text=GOOD):
    Path("a.yaml").write_text(text.format(name="a", order=2) if text is GOOD else text, encoding="utf-8")
    return "a.yaml"


@pytest.mark.slow
def test_page_is_written_next_to_the_spec_and_messages_go_to_stderr(phigen):
    result = phigen(write(), "--quick")
    assert result.exit_code == 0
    assert result.stdout == ""
    assert "wrote a.html" in result.stderr
    assert "matplotlib was not installed" in result.stderr
    text = Path("a.html").read_text(encoding="utf-8")
    assert Page(text).errors == []
    assert "solution, against the closed form" in text
    assert "the closed form" in text
    assert "no figures" in text


def test_page_can_go_to_stdout(phigen):
    result = phigen(write(GOOD.split("runs:")[0].format(name="a", order=2)), "-o", "-", "-q")
    assert result.exit_code == 0
    assert Page(result.stdout).errors == []
    assert not Path("a.html").exists()
    assert result.stderr == ""


def test_spec_without_runs_has_a_page_that_says_so(phigen):
    result = phigen(write(GOOD.split("runs:")[0].format(name="a", order=2)))
    assert result.exit_code == 0
    assert "warning" in result.stderr
    assert "nothing was measured" in Path("a.html").read_text(encoding="utf-8")


def test_refuted_mathematics_has_no_page(phigen):
    result = phigen(write(NOT_POISSON), "-o", "x.html")
    assert result.exit_code == 5
    assert "Jacobi identity" in result.stderr
    assert not Path("x.html").exists()


def test_failing_run_has_a_page_that_says_where(phigen):
    text = GOOD.format(name="a", order=2).replace("(q**2 + p**2)/2", "p**2/2 - 1/q**2").replace("step: 0.1", "step: 2")
    result = phigen(write(text), "--quick")
    assert result.exit_code == 7
    page = Path("a.html").read_text(encoding="utf-8")
    assert Page(page).errors == []
    assert "The run could not be completed" in page


@pytest.mark.slow
def test_solver_that_falls_short_has_a_page_with_the_verdict(phigen, monkeypatch):
    monkeypatch.setattr(verification, "ONE_STEP", 0.0)
    result = phigen(write(), "--quick")
    assert result.exit_code == 5
    assert "verification failed" in result.stderr
    page = Path("a.html").read_text(encoding="utf-8")
    assert "✗ failed" in page
    assert Page(page).errors == []


@pytest.mark.parametrize(
    ("arguments", "code"),
    [(["--run", "walk"], 2), (["-o", "no/such/folder.html"], 2), (["-o", "."], 2), (["--order", "99"], 2)],
)
def test_wrong_usage_is_noticed_before_the_work(phigen, arguments, code):
    result = phigen(write(), *arguments)
    assert result.exit_code == code
    assert not list(Path().glob("*.html"))


def test_missing_file_is_an_error_of_the_spec(phigen):
    result = phigen("none.yaml")
    assert result.exit_code == 1
    assert "there is no file" in result.stderr


@pytest.mark.slow
def test_without_compiler_times_are_those_of_python(phigen, without_compiler):
    text = GOOD.format(name="a", order=2).replace("steps: 50", "steps: 4")
    result = phigen(write(text), "--quick")
    assert result.exit_code == 0
    page = Path("a.html").read_text(encoding="utf-8")
    assert "There was no C compiler" in page
    assert "generated for NumPy" in page


def test_panel_alone_is_a_page_for_a_frame(phigen):
    result = phigen(write(), "--panel")
    assert result.exit_code == 0, result.stderr
    text = Path("a-panel.html").read_text(encoding="utf-8")
    assert "wrote a-panel.html" in result.stderr
    assert 'id="live-panel"' in text
    assert phigen("a.yaml", "--panel", "--quick").exit_code == 2
    assert phigen("a.yaml", "--panel", "-o", "-").stdout == text


def test_system_with_noise_has_no_panel_and_the_page_gives_the_reason(phigen):
    result = phigen("thermal_spin", "--panel")
    assert result.exit_code == 5
    assert "no live panel: it would compare the solver with RK4, which does not apply" in result.stderr
    assert list(Path().glob("*.html")) == []
