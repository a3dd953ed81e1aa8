# Needs Python 3.11 or newer with venv and its headers; everything else is installed into .venv. Without a C++ compiler,
# the one in the package ziglang is installed, too.

PYTHON ?= python3
# The versions that the tests ran with; "make setup LOCK=" takes the newest that pyproject.toml allows.
LOCK ?= requirements.lock
BIN := .venv/bin
# The base environment, what tests and documentation need besides, and the native modules.
BASE := .venv/.base
READY := .venv/.ready
CORE := .venv/.core
SOURCES := $(wildcard cmake/CMakeLists.txt extractor/native/* extractor/native/*/* extractor/native/*/*/* cmpdesign/native/*)
ifeq ($(shell command -v $(CXX) || command -v g++ || command -v clang++),)
  ZIG := --zig
endif

# The tests start some hundred programs, each of which would compile its modules again.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo test test-all test-sanitized lint bench figures docs lock wheel clean

help:
	@echo "make demo      build a design, render a pressed sample, read it back, print the figures (out/)"
	@echo "make test      the tests, without the slow ones"
	@echo "make test-all  every test"
	@echo "make test-sanitized  the extractor's tests on native modules that check every index and address"
	@echo "make wheel     dist/: a wheel that runs on other machines without a compiler"
	@echo "make lint      ruff and mypy"
	@echo "make bench     every figure that the documentation states"
	@echo "make figures   every picture and generated page of docs/"
	@echo "make docs      the documentation as a site, links checked (build/site)"
	@echo "make setup     .venv with everything, in the versions of requirements.lock; demo makes the smaller part that it needs"
	@echo "make lock      requirements.lock anew, from what is installed in .venv"

setup: $(READY) $(CORE)

$(BASE): pyproject.toml $(LOCK)
	@$(PYTHON) -c 'import tomllib' 2>/dev/null || \
	  { echo "error: $(PYTHON) is missing or older than 3.11; call make PYTHON=/path/to/python3.11" >&2; exit 1; }
	@$(PYTHON) tools/set_up.py base --lock "$(LOCK)" $(ZIG)
	@touch $@ $(CORE)

$(READY): pyproject.toml $(LOCK) | $(BASE)
	@$(PYTHON) tools/set_up.py dev --lock "$(LOCK)"
	@touch $@

# The native modules, where a source is newer.
$(CORE): $(SOURCES) | $(BASE)
	@PATH=$(CURDIR)/$(BIN):$$PATH cmake --build cmake
	@touch $@

demo: $(BASE) $(CORE)
	@$(BIN)/python -m cmpdesign.demo

test: $(READY) $(CORE)
	@$(BIN)/python -m pytest -n 2 --dist worksteal

test-all: $(READY) $(CORE)
	@$(BIN)/python -m pytest -n 2 --dist worksteal -m ''

lint: $(READY) $(CORE)
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/clang-format --dry-run --Werror $(filter %.cpp %.hpp,$(SOURCES))
	@$(BIN)/mypy
	@$(BIN)/mypy examples

bench: $(READY) $(CORE)
	@set -e; for name in extraction accuracy comparison datasets photoreal; do echo "== benchmarks.$$name"; $(BIN)/python -m benchmarks.$$name --publish; done
	@$(BIN)/python -m tools.figures
	@set -e; for name in startup interrupts numbering tracking rendering contact large_strain reconstruction medium laser kerf molds stress damage calibration camera codecs live sweeps views lenses rig; do echo "== benchmarks.$$name"; $(BIN)/python -m benchmarks.$$name; done

figures: $(READY) $(CORE)
	@$(BIN)/python -m tools.figures

docs: $(READY)
	@NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet
	@echo "build/site/index.html"

lock: $(READY) $(CORE)
	@$(BIN)/python -m tools.lock

wheel: $(READY)
	@$(BIN)/python -m tools.wheel

test-sanitized: $(READY)
	@$(BIN)/python -m tools.sanitized

clean:
	@rm -rf .venv out build dist; git clean -qfdX cmake extractor cmpdesign
