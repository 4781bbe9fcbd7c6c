# make run    starts the cell (ARGS="--world empty --speed max" passes options on; `make run ARGS=--help` lists them)
# make test   runs the tests  (ARGS="tests/planner -k corridor" passes options on)
# make lint   checks style, types and the rules of the house
# make bench  runs the benchmarks (ARGS=bus picks one), beside other libraries where there are some
# make docs   renews the generated tables in README.md and docs/, the AsyncAPI document and the access-control lists
# Each makes its own environment in .venv first; it is made anew only when pyproject.toml changes.

PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
ARGS   ?=

.PHONY: run test lint docs bench clean

run: $(VENV)/.run
	@exec $(BIN)/rackhand up $(ARGS)

# What needs no processes is tested first. Cells are several processes each that mostly wait for each other: two at a time.
test: $(VENV)/.dev
ifeq ($(strip $(ARGS)),)
	@$(BIN)/pytest -m "not system" --numprocesses logical
	@$(BIN)/pytest -m system --numprocesses 2 --dist loadfile
else
	@$(BIN)/pytest $(ARGS)
endif

lint: $(VENV)/.dev
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy
	@$(BIN)/lint-imports

docs: $(VENV)/.dev
	@$(BIN)/python -m rackhand.services.launch.reference README.md docs/*.md docs/asyncapi.json docs/access.json5

bench: $(VENV)/.bench
	@$(BIN)/python -m benchmarks $(ARGS)

clean:
	rm -rf $(VENV) .venv-placo build *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis

# Stamps: which set of dependencies the environment holds, as of which pyproject.toml.
$(VENV)/.run: $(VENV)/bin/python pyproject.toml
	@echo "rackhand: installing what the cell needs into $(VENV) (once; a minute or two)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable .
	@touch $@

$(VENV)/.dev: $(VENV)/bin/python pyproject.toml
	@echo "rackhand: installing the cell and its test tools into $(VENV) (once; a minute or two)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev]'
	@touch $@ $(VENV)/.run

$(VENV)/.bench: $(VENV)/bin/python pyproject.toml
	@echo "rackhand: installing the cell, its test tools and the libraries to measure against into $(VENV) (once; a few minutes)"
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	@touch $@ $(VENV)/.dev $(VENV)/.run

$(VENV)/bin/python:
	@command -v $(PYTHON) >/dev/null || { echo "rackhand: $(PYTHON) not found. Install Python 3.11 or newer, or name one: make run PYTHON=/path/to/python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "rackhand: $$($(PYTHON) --version 2>&1) is too old. Python 3.11 or newer is needed; name one: make run PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import venv, ensurepip' 2>/dev/null || { echo "rackhand: $(PYTHON) has no venv module. On Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@echo "rackhand: making the environment $(VENV) with $$($(PYTHON) --version)"
	@$(PYTHON) -m venv $(VENV)
