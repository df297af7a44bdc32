# Two commands on a fresh machine: `make run` (the main job) and `make test`.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
FORMER := $(BIN)/python -m pip uninstall --quiet --yes --disable-pip-version-check nanobench 2>/dev/null || true
OUT ?= results
JOBS ?= $(shell nproc 2>/dev/null || echo 2)
# One test process more than there are cores: some tests wait for sockets, for each other or for what another compiles.
TEST_JOBS ?= $(shell expr $(JOBS) + 1)

.PHONY: dist docs run test test-slow lint types pytest pytest-slow learned learned-slow learned-all bench figures figures-slow clean help

help:
	@echo "make run    install, then audit, the three tasks and the report into ./$(OUT)"
	@echo "make test   install with the test tools, lint, run the tests"
	@echo "make types  check the types; make learned: the tests of learned models"
	@echo "make test-slow  the slow proofs that make test leaves out"
	@echo "make bench  speed benchmarks, as ratios against a peer or a plain version in one run, kept in a table"
	@echo "make figures  every number of README and docs from results; RESULTS=DIR takes those of earlier commands"
	@echo "make docs   the site, into build/site; every warning is an error, every link is checked"
	@echo "make dist   wheel and source distribution into ./dist, checked, and tried in an empty environment"
	@echo "make clean  remove the virtual environment, results and compiled models of the tests"

# The stamps make an installation happen once per change of what is to be installed. An installation under the former
# name "nanobench" is taken away: its entry points would be found beside those of today. Python compiles a module when it
# is first imported: most of the installed ones never are.
$(BIN)/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "python3 >= 3.11 is needed; found $$($(PYTHON) --version); set PYTHON=python3.11" >&2; exit 2; }
	$(PYTHON) -m venv $(VENV) || { echo "python3-venv is missing; apt-get install python3-venv" >&2; rm -rf $(VENV); exit 2; }

$(VENV)/.installed: setup.cfg pyproject.toml constraints.txt | $(BIN)/python
	@$(FORMER)
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -c constraints.txt -e ".[report,identification,smoothers,mpc,tune]"
	@touch $@

# evo is the referee of the metrics, allantools of the Allan deviation; their further dependencies are not needed.
$(VENV)/.installed-test: setup.cfg pyproject.toml constraints.txt | $(BIN)/python
	@$(FORMER)
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -c constraints.txt -e ".[report,identification,smoothers,mpc,rotorpy,cluster,control,tune,ulog,rosbag,hdf5,excel,radio,viewer,test]"
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -c constraints.txt evo allantools
	@touch $@ $(VENV)/.installed

$(VENV)/.installed-learned: $(VENV)/.installed-test
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -c constraints.txt -e ".[learned]"
	@touch $@

$(VENV)/.installed-docs: setup.cfg pyproject.toml constraints.txt $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -c constraints.txt -e ".[docs]"
	@touch $@

run: $(VENV)/.installed
	$(BIN)/nanobench run --out $(OUT) --jobs $(JOBS)

lint: $(VENV)/.installed-learned
	$(BIN)/ruff check .
	$(BIN)/python -m tools.prose
	$(BIN)/mypy

test: $(VENV)/.installed-test
	$(BIN)/ruff check .
	$(BIN)/python -m tools.prose
	@$(MAKE) --no-print-directory pytest

pytest: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n $(TEST_JOBS) --leave-out-slow

types: $(VENV)/.installed-learned
	$(BIN)/mypy

# Learned models need processes of their own.
learned: $(VENV)/.installed-learned
	NANOBENCH_TEST_LEARNED=1 $(BIN)/python -m pytest -n 0 --leave-out-slow tests/learned

# What `make test` leaves out, and says so: proofs that take long.
test-slow: $(VENV)/.installed-learned
	@$(MAKE) --no-print-directory -j 2 pytest-slow learned-slow

pytest-slow: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n $(TEST_JOBS) -m slow

learned-slow: $(VENV)/.installed-learned
	NANOBENCH_TEST_LEARNED=1 $(BIN)/python -m pytest -n 0 -m slow tests/learned

# Both at once: JAX starts and compiles once.
learned-all: $(VENV)/.installed-learned
	NANOBENCH_TEST_LEARNED=1 $(BIN)/python -m pytest -n 0 tests/learned

bench: $(VENV)/.installed-test
	$(BIN)/python benchmarks/speed/bench.py

# Numbers of README.md and docs/*.md: run what prints them (RESULTS=DIR: take what lies there), store them, write the text.
RESULTS ?=
figures: $(VENV)/.installed
	$(BIN)/python -m tools.figures --results $(or $(RESULTS),$(OUT)) $(if $(RESULTS),,--run quick)

figures-slow: $(VENV)/.installed
	$(BIN)/python -m tools.figures --results $(or $(RESULTS),$(OUT)) --run slow

docs: $(VENV)/.installed-docs
	$(BIN)/python -m mkdocs build --strict --quiet
	$(BIN)/python -m tools.docs_site.check_links build/site

# Wheel and source distribution, checked, and the first tutorial with the wheel alone in an empty environment.
dist: $(VENV)/.installed
	$(BIN)/python -m pip install --quiet --no-compile --disable-pip-version-check -c constraints.txt -e ".[release]"
	rm -rf dist build/fresh
	$(BIN)/python -m build --outdir dist .
	$(BIN)/python -m twine check --strict dist/*
	$(PYTHON) -m venv build/fresh
	build/fresh/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt "$$(ls dist/*.whl)[report]"
	cd build/fresh && bin/python $(CURDIR)/docs/tutorials/first_log.py >/dev/null && bin/nanobench --version
	@! grep -l "URL_OF_THIS_REPOSITORY\|CONTACT$$" README.md setup.cfg CITATION.cff || echo "before an upload: fill in the address and contact there"

clean:
	rm -rf $(VENV) $(OUT) build
