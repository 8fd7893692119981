# Each target makes .venv with the pinned versions when it is missing or out of date, then does its job.
.DEFAULT_GOAL := help
.PHONY: help install run test test-interop lint bench stress clean
.DELETE_ON_ERROR:

# The first Python that is new enough; make PYTHON=/path/to/python3.12 picks another.
candidates := python3 python3.13 python3.12 python3.11 python
new_enough := import sys; sys.exit(sys.version_info < (3, 11))
PYTHON ?= $(shell for p in $(candidates); do $$p -c '$(new_enough)' 2>/dev/null && echo $$p && break; done)

# One BLAS thread: the matrices here are small, so a second thread costs more than it gains, and sums keep their order.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

# The stamp holds the folder it was made in, since a virtual environment does not survive being moved or copied.
venv := .venv
stamp := $(venv)/.installed
ifneq ($(shell cat $(stamp) 2>/dev/null),$(CURDIR))
.PHONY: $(stamp)
endif

help: ## show this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## /{printf "make %-12s %s\n", $$1, $$2}' Makefile

install: $(stamp) ## make .venv and install the pinned versions
	@echo "$(venv) is up to date"

run: $(stamp) ## fly the TU Delft V3 kite as two coupled FMUs; the report goes to results/v3_kite
	$(venv)/bin/kitecosim run v3_kite --out results/v3_kite

test: $(stamp) ## run the tests
	$(venv)/bin/python -m pytest -q -n 2 --dist loadfile

test-interop: $(stamp) ## run the FMUs in other tools; KITECOSIM_REQUIRE_INTEROP=1 makes one that is missing a failure
	$(venv)/bin/python -m pytest -q tests/interop

lint: $(stamp) ## check style, format and types
	$(venv)/bin/python -m ruff check
	$(venv)/bin/python -m ruff format --check
	$(venv)/bin/python -m mypy

bench: $(stamp) ## measure accuracy and run time of every case; results/bench, then tables and figures of docs/
	$(venv)/bin/python -m benchmarks run
	$(venv)/bin/python -m benchmarks docs

stress: $(stamp) ## try to break it: random problems and calls, thousands of steps and cycles, killed runs, spoiled scenes
	$(venv)/bin/python -m benchmarks run coupling.random coupling.gust structure.random kites.random motion.random fmus.fuzz fmus.cycles particles.kite runs.killed scenes.mutated

clean: ## remove .venv, results, caches and build artefacts
	rm -rf $(venv) results build dist *.egg-info .mypy_cache .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(stamp): pyproject.toml constraints.txt $(wildcard fmus/binary/* aero/panel/*.[ch])
	@test -n "$(PYTHON)" && "$(PYTHON)" -c '$(new_enough)' 2>/dev/null || { \
	    echo "kitecosim needs Python 3.11 or newer$(if $(PYTHON), and $(PYTHON) is not); name one: make PYTHON=python3.12" >&2; \
	    exit 1; }
	@if test -f $@ && test "$$(cat $@)" != "$(CURDIR)" || ! $(venv)/bin/python -c '$(new_enough)' 2>/dev/null; then \
	    echo "making $(venv)"; "$(PYTHON)" -m venv --clear $(venv); fi
	@echo "installing the pinned versions, about a minute"
	@$(venv)/bin/python -m pip install -qq --disable-pip-version-check -c constraints.txt setuptools
	@$(venv)/bin/python -m pip install -qq --disable-pip-version-check -c constraints.txt --no-build-isolation -e '.[dev]'
	@printf '%s' "$(CURDIR)" > $@
