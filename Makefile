# Needs python3 (3.11 or newer) with venv, and make; everything else goes into .venv.
# Nothing outside this directory is written, and nothing here needs ROS to be installed.

PYTHON ?= python3
ARGS ?=

VENV := .venv
PY := $(VENV)/bin/python3
PIP := $(PY) -m pip --disable-pip-version-check
# scripts in .venv name its path: a tree that was moved or copied gets a new one
STAMPS := $(VENV)/stamps-$(shell pwd | cksum | cut -d ' ' -f 1)

# The installed copy is that of these very files: a change in any of them reinstalls it.
SOURCE := setup.py setup.cfg pyproject.toml package.xml config launch resource scripts wam_*
SOURCE_ID := $(shell find $(SOURCE) -type f ! -name '*.pyc' | LC_ALL=C sort | xargs sha256sum | sha256sum | cut -c 1-16)
INSTALLED := $(STAMPS)/installed-$(SOURCE_ID)

# A sourced ROS or another environment must not leak into .venv: its libraries would be mixed with the wheels'.
unexport PYTHONPATH PYTHONHOME RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
ifdef ROS_DISTRO
unexport LD_LIBRARY_PATH ROS_DISTRO
endif
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)
# HOME may be read-only or missing
export ROS_LOG_DIR ?= $(CURDIR)/.cache/ros
export MPLCONFIGDIR ?= $(CURDIR)/.cache/matplotlib

.DEFAULT_GOAL := help
.PHONY: help demo install test bench docs constraints clean
.DELETE_ON_ERROR:
# pip must not run twice at once in one .venv
.NOTPARALLEL:

# What a build leaves here; build/lib would bring back modules that have been deleted
TIDY := rm -rf build/lib build/bdist.* *.egg-info; rmdir build 2>/dev/null || true

help:  ## this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-12s %s\n", $$1, $$2}' Makefile

demo: $(INSTALLED)  ## start every node, press on a foam box, record, judge; ARGS="--lockstep" for options
	@$(VENV)/bin/wam demo $(ARGS)

install: $(INSTALLED)  ## .venv with the stack and ROS from wheels; then .venv/bin/wam --help

test: export ROS_PYTHON_CHECK_FIELDS = 1
test: $(STAMPS)/test $(INSTALLED)  ## lint, types and all tests; ARGS="-k plant -x" goes to pytest
	@failed=; \
	echo '== ruff'; $(PY) -P -m ruff check . || failed="$$failed ruff"; \
	echo '== mypy'; $(PY) -P -m mypy || failed="$$failed mypy"; \
	echo '== pytest'; $(PY) -P -m pytest $(ARGS) || failed="$$failed pytest"; \
	if [ -n "$$failed" ]; then echo "make test: failed:$$failed" >&2; exit 1; fi

bench: $(STAMPS)/test $(INSTALLED)  ## benchmarks, as ratios of one run
	@for script in benchmarks/*.py; do echo "== $$script"; $(PY) "$$script" $(ARGS) || exit 1; done

docs: $(STAMPS)/test $(INSTALLED)  ## write the generated pages of docs/ again
	@$(PY) docs/generate.py $(ARGS)

constraints: $(STAMPS)/venv  ## pin the newest versions that go together; then make clean test
	@mkdir -p .cache
	@$(PIP) install -q --dry-run --ignore-installed --report .cache/resolved.json '.[ros,test,view]'
	@$(TIDY)
	@$(PY) -c 'import json, pathlib, re; file = pathlib.Path("constraints.txt"); \
	head = [line for line in file.read_text().splitlines() if line.startswith("#")]; \
	pins = {re.sub("[-_]+", "-", p["metadata"]["name"]).lower(): p["metadata"]["version"] \
	        for p in json.loads(pathlib.Path(".cache/resolved.json").read_text())["install"]}; \
	pins.pop("wam-stack"); \
	file.write_text("\n".join(head + sorted(f"{n}=={v}" for n, v in pins.items())) + "\n")'

clean:  ## remove .venv, caches and build leftovers; recordings stay
	@rm -rf $(VENV) .cache build *.egg-info .pytest_cache .mypy_cache .ruff_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMPS)/venv:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "wam_stack needs Python 3.11 or newer: make PYTHON=python3.12 ..." >&2; exit 1; }
	@$(PYTHON) -m venv --clear $(VENV) || { \
		echo "Could not make $(VENV); on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@mkdir -p $(STAMPS) && touch $@

$(STAMPS)/ros: $(STAMPS)/venv constraints.txt setup.py
	@echo "Installing into $(VENV): about 1 GB, a minute or two the first time"
	@$(TIDY)
	@$(PIP) install -q -c constraints.txt setuptools
	@$(PIP) install -q --use-pep517 --no-build-isolation -c constraints.txt '.[ros]'
	@$(TIDY)
	@touch $@

$(STAMPS)/test: $(STAMPS)/ros
	@echo "Installing what the tests need"
	@$(TIDY)
	@$(PIP) install -q --use-pep517 --no-build-isolation -c constraints.txt '.[ros,test]'
	@$(TIDY)
	@touch $@

$(INSTALLED): $(STAMPS)/ros
	@rm -f $(STAMPS)/installed-*
	@$(TIDY)
	@$(PIP) install -q --no-deps --force-reinstall --no-build-isolation .
	@$(TIDY)
	@touch $@
