# Two commands to start with:
#
#   make demo    compile a system, integrate it, print what was conserved
#   make test    run the checks that a change must pass; `make test-all` adds the long tests
#
# The first call installs phigen and its tools in .venv. PYTHON=python3.12 chooses the interpreter.

SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DELETE_ON_ERROR:

VENV := .venv
BIN := $(VENV)/bin
RUNS := $(VENV)/.phigen-runs
STAMP := $(VENV)/.phigen-installed
SITE := $(VENV)/.phigen-docs
WORKERS ?= auto

# Tests start Python some hundred times. Compiled modules halve the time of these starts.
test test-all: export PYTHONDONTWRITEBYTECODE :=

.PHONY: help demo test test-all lint rules format golden figures docs bench clean

help:
	@sed -n '/^#/!q; s/^# \{0,1\}//p' Makefile

demo: $(RUNS)
	$(BIN)/phigen demo

test: rules
	$(call tested,)

# `make test`, with the long tests, and with C that is compiled with the flags that users get.
test-all: rules
	$(call tested,--all)

lint: rules
	$(BIN)/mypy

rules: $(STAMP)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

# mypy runs while the tests run. It uses one core, for half a minute if it has no cache. Its output is printed last.
define tested
@$(BIN)/mypy >$(VENV)/.types 2>&1 & types=$$!; failed=0; \
$(BIN)/python -m pytest -n $(WORKERS) $(1) || failed=$$?; \
wait $$types || failed=1; cat $(VENV)/.types; exit $$failed
endef

format: $(STAMP)
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

# Write the golden files: whole solvers in generated/, and for other systems the paragraphs that no whole solver has.
# Read the diff before you commit it.
golden: $(STAMP)
	$(BIN)/python tests/golden.py

# Make the figures and numbers of README.md, docs/gallery.md and docs/paper.md. Takes about two minutes.
figures: $(STAMP)
	$(BIN)/python docs/make_gallery.py
	$(BIN)/python docs/make_paper.py
	$(BIN)/python docs/make_overview.py

# Make the web site of the documentation in build/site.
docs: export NO_MKDOCS_2_WARNING := 1
docs: $(SITE)
	$(BIN)/mkdocs build --quiet

# Compare phigen with other methods; see docs/benchmarks.md. Takes about ten minutes on a quiet machine.
bench: $(STAMP)
	$(BIN)/python -m benchmarks

clean:
	rm -rf $(VENV) build dist

# Install again if the dependencies changed. An existing environment is not replaced.
$(RUNS): pyproject.toml
	@if ! [ -x $(BIN)/python ]; then \
	  for candidate in $(PYTHON) python3 python3.13 python3.12 python3.11 python; do \
	    if "$$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then \
	      found="$$candidate"; break; \
	    fi; \
	  done; \
	  if [ -z "$${found:-}" ]; then \
	    echo "error: phigen needs Python 3.11 or newer, and none was found; name one: make PYTHON=/path/to/python3" >&2; \
	    exit 1; \
	  fi; \
	  echo "making $(VENV) with $$("$$found" --version)"; \
	  if ! "$$found" -m venv $(VENV); then \
	    rm -rf $(VENV); \
	    echo "error: $$found cannot make virtual environments; on Debian: apt-get install python3-venv" >&2; \
	    exit 1; \
	  fi; \
	fi
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --editable '.[plot]'
	@touch $@

# The packages for tests.
$(STAMP): $(RUNS)
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --editable '.[dev,plot]'
	@touch $@

# The packages for the web site.
$(SITE): $(RUNS)
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check --editable '.[docs]'
	@touch $@
