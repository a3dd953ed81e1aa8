# Needs Python 3.11 or newer with venv; everything else is installed into .venv.

PYTHON ?= python3
# The versions that the tests ran with; "make setup LOCK=" takes the newest that pyproject.toml allows.
LOCK ?= requirements.lock
BIN := .venv/bin
READY := .venv/.ready

.PHONY: help setup demo test test-all lint bench figures lock clean

help:
	@echo "make demo      build a design, render a pressed sample, read it back, print the figures (out/)"
	@echo "make test      the tests, without the slow ones"
	@echo "make test-all  every test"
	@echo "make lint      ruff and mypy"
	@echo "make bench     every figure that the documentation states"
	@echo "make figures   every picture and generated page of docs/"
	@echo "make setup     .venv with everything, in the versions of requirements.lock (the others call it)"
	@echo "make lock      requirements.lock anew, from what is installed in .venv"

setup: $(READY)

$(READY): pyproject.toml $(LOCK)
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
	  { echo "error: $(PYTHON) is missing or older than 3.11; call make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || \
	  { echo "error: $(PYTHON) cannot make virtual environments; on Debian: apt install python3-venv" >&2; exit 1; }
	@echo "Setting up .venv (once; some minutes) ..."
	@$(PYTHON) -m venv .venv
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check $(if $(LOCK),--constraint $(LOCK)) --editable '.[dev]'
	@touch $@

demo: $(READY)
	@$(BIN)/python -m cmpdesign.demo

test: $(READY)
	@$(BIN)/python -m pytest -n 2

test-all: $(READY)
	@$(BIN)/python -m pytest -n 2 -m ''

lint: $(READY)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/mypy

bench: $(READY)
	@set -e; for name in extraction accuracy comparison; do echo "== benchmarks.$$name"; $(BIN)/python -m benchmarks.$$name --publish; done
	@$(BIN)/python -m docs.figures
	@set -e; for name in startup numbering tracking rendering contact large_strain reconstruction medium laser kerf molds stress damage calibration camera codecs; do echo "== benchmarks.$$name"; $(BIN)/python -m benchmarks.$$name; done

figures: $(READY)
	@$(BIN)/python -m docs.figures

lock: $(READY)
	@$(BIN)/python -m tools.lock

clean:
	@rm -rf .venv out
