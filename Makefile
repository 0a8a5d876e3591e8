# Everything runs from .venv, made on first use and refreshed when pyproject.toml or constraints.txt change.
PYTHON ?= python3
VENV   := .venv
BIN    := $(VENV)/bin
# In the environment, for what builds the package too, which would come in its newest version, tried or not; two names: before pip 25.3, and since.
STATED := PIP_CONSTRAINT=constraints.txt PIP_BUILD_CONSTRAINT=constraints.txt
# Bytecode is left to the first import: of all that is installed, half of pip's time goes into it, and a tenth of it is imported.
PIP    := $(STATED) $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-input --no-compile

# Node comes with the pyright[nodejs] wheel: never the system's, never a download.
export PYRIGHT_PYTHON_GLOBAL_NODE := 0
export PYRIGHT_PYTHON_IGNORE_WARNINGS := 1

# Bytecode is kept even where the environment forbids it: tests start dozens of processes, and each would compile the package.
unexport PYTHONDONTWRITEBYTECODE

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
.PHONY: help demo studio test test-quick test-long test-all test-kernels fuzz browser lint format types layers docs bench bench-guard bench-smoke peers wheel-test oldest pythons release coverage cost mutants licences audit clean

help:  ## list these targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' Makefile | expand -t 22

demo: $(VENV)/.runtime  ## run the demonstration (runtime dependencies only)
	$(BIN)/taskcal demo

studio: $(VENV)/.studio  ## start the studio on a virtual robot's example project, in taskcal-studio/
	$(BIN)/taskcal studio taskcal-studio --example

# Each worker takes a run of neighbouring tests, which share fixtures, and then from the others what they have not begun.
test: $(VENV)/.test  ## run the tests
	$(BIN)/python -m pytest --numprocesses auto --dist worksteal

test-quick: $(VENV)/.test  ## run some tests of every file on few examples, for a look while working
	$(BIN)/python -m pytest --numprocesses auto --hypothesis-profile quick -m quick

# Status 5: no experiment among the tests that a change touches.
test-long: $(VENV)/.test  ## run the experiments, of minutes each, that a change touches (tests/touched.py)
	@touched=$$($(BIN)/python -m tests.touched) && { [ -n "$$touched" ] || { echo "the change touches no test"; exit 0; }; \
	$(BIN)/python -m pytest --numprocesses auto -m "long and not browser" $$touched || [ $$? = 5 ]; }

test-all: $(VENV)/.test  ## run all tests and all experiments, but for those in a browser; an hour
	$(BIN)/python -m pytest --numprocesses auto -m "not browser"

# Folders whose results come from sums over all rows.
KERNEL_TESTS ?= tests/estimation tests/identification tests/planning

test-kernels: $(VENV)/.test  ## run the numerical tests under two other kernels of OpenBLAS, which round otherwise (tests/blas_kernels.py)
	$(BIN)/python -m tests.blas_kernels --numprocesses auto --dist worksteal -m "not long and not realdata" $(KERNEL_TESTS)

fuzz: $(VENV)/.test  ## damage some files of every kind at random, other ones than the tests do
	$(BIN)/python -m tests.readers.fuzz

browser: $(VENV)/.dev  ## open reports, documents and studio in a real browser (Debian's chromium); TASKCAL_PICTURES=build/pictures keeps screenshots
	timeout 2100 $(BIN)/python -m pytest --numprocesses 2 --dist loadfile -m browser

lint: $(VENV)/.dev  ## rules and format (ruff), spelling (codespell), dead code (vulture)
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/codespell README.md CONTRIBUTING.md CHANGELOG.md docs src tests benchmarks examples
	$(BIN)/vulture

format: $(VENV)/.dev  ## ruff: repair what can be repaired
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

types: $(VENV)/.dev  ## pyright, strict on src
	$(BIN)/pyright --pythonpath $(BIN)/python

layers: $(VENV)/.dev  ## import-linter: the order of the folders
	$(BIN)/lint-imports

docs: $(VENV)/.dev  ## build the documentation into build/docs/VERSION, and the list of versions
	$(BIN)/python docs/versions.py

bench: $(VENV)/.test  ## time the benchmarks
	$(BIN)/python -m pytest benchmarks --benchmark-only

bench-guard: $(VENV)/.test  ## race a few ratios by processor time, which other work hardly changes; a doubling fails
	$(BIN)/python -m pytest benchmarks --benchmark-only --benchmark-quiet --guard

bench-smoke: $(VENV)/.test  ## run every benchmark that bench-guard does not run once, untimed
	$(BIN)/python -m pytest benchmarks --benchmark-disable -m "not guard and not long"

# Of the installed package, what differs where the sources do not lie beside it: files it reads, commands, pages, processes of its own.
WHEEL_TESTS ?= -m quick tests/public tests/cli tests/robot tests/taskcal_studio tests/report

wheel-test: $(VENV)/.test  ## build sdist and wheel, install the wheel apart, run some tests against it; WHEEL_TESTS=tests for all
	$(BIN)/python -m tests.installed_wheel --numprocesses auto --hypothesis-profile quick -p no:cacheprovider $(WHEEL_TESTS)

OLDEST_TESTS ?= -m quick

oldest: build/oldest/.test  ## run some tests with the oldest versions of all dependencies; needs a network; OLDEST_TESTS=tests for all
	build/oldest/bin/python -m pytest --numprocesses auto --hypothesis-profile quick -p no:cacheprovider $(OLDEST_TESTS)

build/oldest/.test: pyproject.toml constraints-oldest.txt
	$(PYTHON) -m venv build/oldest
	build/oldest/bin/python -m pip install --quiet --disable-pip-version-check --no-input -c constraints-oldest.txt -e '.[test]'
	@touch $@

PYTHONS ?= 3.11 3.12 3.13 3.14

# A Python that is not there is named, and not tried.
pythons:  ## run some tests with each Python of 3.11 to 3.14 that is here; needs a network; PYTHONS=3.13 for one, OLDEST_TESTS=tests for all
	@for v in $(PYTHONS); do \
	python$$v -c '' 2>/dev/null || { echo "python$$v is not here: not tried"; continue; }; \
	echo "python$$v"; python$$v -m venv build/python$$v && \
	$(STATED) build/python$$v/bin/python -m pip install --quiet --disable-pip-version-check --no-input --no-compile -e '.[test]' && \
	build/python$$v/bin/python -m pytest --numprocesses auto --hypothesis-profile quick -p no:cacheprovider $(OLDEST_TESTS) || exit 1; done

# Checks, changelog, tag, archives of both libraries, bill of materials, provenance: all but the upload (release.py).
release: $(VENV)/.test  ## make a release up to the upload: VERSION=1.2.3; DRY=1 leaves no trace in the repository
	$(BIN)/python -m release $(VERSION) $(if $(DRY),--dry)

coverage: $(VENV)/.test  ## which lines and branches which tests run, compiled kernels left out; page in build/coverage; half an hour
	$(BIN)/python -m pytest --numprocesses auto --cov --cov-context=test --junitxml=build/coverage/tests.xml --cov-report=term:skip-covered --cov-report=html:build/coverage/page $(COVERAGE_TESTS)

COST_TESTS ?= tests

cost: $(VENV)/.test  ## run the tests, and show what they cost by folder, file, function and fixture; COST_TESTS= for some
	$(BIN)/python -m tests.cost --numprocesses auto --dist worksteal $(COST_TESTS)

MUTANTS ?= 200
SEED ?= 0

mutants: $(VENV)/.test build/mutants/.tools  ## make 200 small mistakes in all packages, run the tests of their modules; two hours; MUTANTS=, SEED=, PACKAGES=
	build/mutants/tools/bin/python -m tests.mutants $(CURDIR)/$(BIN)/python $(MUTANTS) $(SEED) $(PACKAGES)

# In an environment of its own: thirty packages, none of which the tests need.
build/mutants/.tools:
	$(PYTHON) -m venv build/mutants/tools
	build/mutants/tools/bin/python -m pip install --quiet --disable-pip-version-check --no-input 'cosmic-ray>=8.7'
	@touch $@

licences: $(VENV)/.test  ## renew docs/reference/dependencies.md from the installed packages
	$(BIN)/python -m docs.dependency_table

# In an environment of its own: what audits brings thirty packages, none of which Taskcal needs.
audit:  ## ask for known vulnerabilities of the versions in constraints.txt; needs a network
	$(PYTHON) -m venv build/audit
	build/audit/bin/python -m pip install --quiet --disable-pip-version-check --no-input 'pip-audit>=2.9'
	build/audit/bin/pip-audit --requirement constraints.txt --no-deps --disable-pip

peers: $(VENV)/.test  ## install other calibration packages, run them on the same rows, renew docs/benchmarks.md; half an hour
	$(BIN)/python -m benchmarks.peers

clean:  ## remove .venv and everything built
	rm -rf $(VENV) build dist docs/reference/api docs/reference/commands taskcal-demo taskcal-studio
	rm -rf .pytest_cache .ruff_cache .hypothesis .benchmarks .import_linter_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(VENV)/pyvenv.cfg:
	@command -v $(PYTHON) >/dev/null || { echo "Taskcal needs Python 3.11 or newer; '$(PYTHON)' was not found. Try: make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import platform, sys; sys.version_info >= (3, 11) or sys.exit("Taskcal needs Python 3.11 or newer; $(PYTHON) is " + platform.python_version() + ". Try: make PYTHON=python3.12")'
	$(PYTHON) -m venv $(VENV)

# Stamps: the package is installed editable, so only its dependencies make these stale.
$(VENV)/.runtime: $(VENV)/pyvenv.cfg pyproject.toml constraints.txt
	$(PIP) -e .
	@touch $@

$(VENV)/.studio: $(VENV)/pyvenv.cfg pyproject.toml constraints.txt
	$(PIP) -e '.[studio]'
	@touch $@

$(VENV)/.test: $(VENV)/pyvenv.cfg pyproject.toml constraints.txt
	$(PIP) -e '.[test]'
	@touch $@

$(VENV)/.dev: $(VENV)/pyvenv.cfg pyproject.toml constraints.txt
	$(PIP) -e '.[dev]'
	@touch $@
