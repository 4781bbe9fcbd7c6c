# make run    starts the cell (ARGS="--world empty --speed max" passes options on; `make run ARGS=--help` lists them)
# make demo   plays goods to arm in a cell of its own (ARGS="--lockstep --seed 7 --no-viewer" passes options on)
# make test   runs the tests  (ARGS="tests/planner -k corridor" passes options on)
# make lint   checks style, types, the rules of the house, and the documentation's links
# make bench  runs the benchmarks (ARGS=bus picks one), beside other libraries where there are some
# make docs   renews the generated tables in README.md and docs/, the AsyncAPI document and the access-control lists
# make site   builds the documentation into build/site and checks its links, without network
# Each makes its own environment in .venv first; it is made anew only when pyproject.toml changes.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
ARGS   ?=
SITE   := NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
# In a terminal pip shows its progress.
PIP    := $(BIN)/python -m pip install $(shell test -t 2 || echo --quiet) --disable-pip-version-check --editable

.PHONY: run demo test lint docs site bench clean

run: $(VENV)/.run
	@exec $(BIN)/rackhand up $(ARGS)

demo: $(VENV)/.run
	@exec $(BIN)/rackhand demo $(ARGS)

# What needs no processes is tested first. Cells are several processes each that mostly wait for each other: two at a time.
# Tests that flood a cell have the machine to themselves.
test: $(VENV)/.dev
ifeq ($(strip $(ARGS)),)
	@$(BIN)/pytest -m "not system" --numprocesses logical --dist worksteal
	@$(BIN)/pytest -m "system and not alone" --numprocesses 2 --dist loadfile --no-loadscope-reorder
	@$(BIN)/pytest -m "system and alone"
else
	@$(BIN)/pytest $(ARGS)
endif

lint: $(VENV)/.dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports
	@$(SITE)

docs: $(VENV)/.dev
	@$(BIN)/python -m rackhand.services.launch.reference README.md docs/*.md docs/asyncapi.json docs/access.json5
	@$(BIN)/python -m rackhand.services.gateway.reference docs/http.md

site: $(VENV)/.dev
	@$(SITE)
	@echo "open build/site/index.html"

bench: $(VENV)/.bench
	@$(BIN)/python -m benchmarks $(ARGS)

clean:
	rm -rf $(VENV) .venv-placo build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

# Stamps: which set of dependencies the environment holds, as of which pyproject.toml.
$(VENV)/.run: $(VENV)/bin/python pyproject.toml
	@echo "rackhand: installing what the cell needs into $(VENV) (once; a minute or two)"
	@$(PIP) .
	@$(BIN)/rackhand prepare
	@touch $@

$(VENV)/.dev: $(VENV)/bin/python pyproject.toml
	@echo "rackhand: installing the cell and its test tools into $(VENV) (once; a minute or two)"
	@$(PIP) '.[dev]'
	@$(BIN)/rackhand prepare
	@touch $@ $(VENV)/.run

$(VENV)/.bench: $(VENV)/bin/python pyproject.toml
	@echo "rackhand: installing the cell, its test tools and the libraries to measure against into $(VENV) (once; a few minutes)"
	@$(PIP) '.[bench]'
	@$(BIN)/rackhand prepare
	@touch $@ $(VENV)/.dev $(VENV)/.run

$(VENV)/bin/python:
	@command -v $(PYTHON) >/dev/null || { echo "rackhand: $(PYTHON) not found. Install Python 3.11 or newer, or name one: make run PYTHON=/path/to/python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "rackhand: $$($(PYTHON) --version 2>&1) is too old. Python 3.11 or newer is needed; name one: make run PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "rackhand: $(PYTHON) has no venv module. On Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@$(PYTHON) -c 'import ctypes; ctypes.CDLL("libgomp.so.1")' 2>/dev/null || { echo "rackhand: the arm's kinematics need libgomp.so.1, which is not installed. On Debian and Ubuntu: apt install libgomp1" >&2; exit 1; }
	@echo "rackhand: making the environment $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(VENV)
