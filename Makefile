# Needs python3 (3.11 or newer) with venv, and make; everything else goes into .venv.
# Apart from temporary files, nothing is written outside this directory. ROS need not be installed.

PYTHON ?= python3
ARGS ?=
SOAK_SECONDS ?= 600

VENV := .venv
PY := $(VENV)/bin/python3
PIP := $(PY) -m pip --disable-pip-version-check
# scripts in .venv contain its path, so a tree that was moved or copied gets a new one
STAMPS := $(VENV)/stamps-$(shell pwd | cksum | cut -d ' ' -f 1)

# A change in any of these files reinstalls the package.
SOURCE := setup.py setup.cfg pyproject.toml package.xml config launch resource scripts wam_*
SOURCE_ID := $(shell find $(SOURCE) -type f ! -name '*.pyc' | LC_ALL=C sort | xargs sha256sum | sha256sum | cut -c 1-16)
# auto: the inner loop as C, with the same bits, where there is a compiler; 1: or the reason why not; 0: as plain Python.
# It stays so until another is given, or `make clean`.
COMPILE ?= $(or $(patsubst $(STAMPS)/compile-%,%,$(wildcard $(STAMPS)/compile-?)),auto)
ifeq ($(and $(filter 1,$(words $(COMPILE))),$(filter auto 0 1,$(COMPILE))),)
$(error COMPILE is '$(COMPILE)'; allowed: auto, 0, 1)
endif
INSTALLED := $(STAMPS)/installed-$(SOURCE_ID)-$(COMPILE)

# A sourced ROS or another environment must not reach .venv: its libraries would mix with those of the wheels.
unexport PYTHONPATH PYTHONHOME RMW_IMPLEMENTATION _ROS_WHEELS_BOOTSTRAP_COMPLETE
ifdef ROS_DISTRO
unexport LD_LIBRARY_PATH ROS_DISTRO
endif
export AMENT_PREFIX_PATH := $(CURDIR)/$(VENV)
# HOME may be read-only or missing
export ROS_LOG_DIR ?= $(CURDIR)/.cache/ros
export MPLCONFIGDIR ?= $(CURDIR)/.cache/matplotlib

.DEFAULT_GOAL := help
.PHONY: help demo install dependencies check test bench soak docs site constraints clean
.DELETE_ON_ERROR:
# pip must not run twice at once in one .venv
.NOTPARALLEL:

# Remove what a build leaves here: build/lib would bring back deleted modules
TIDY := rm -rf build/lib* build/temp* build/mypyc build/launchers build/bdist.* *.egg-info; rmdir build 2>/dev/null || true

help:  ## print this list
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "make %-12s %s\n", $$1, $$2}' Makefile

demo: $(INSTALLED)  ## run the demonstration: start all nodes, press on a foam box, record, report; ARGS="--real-time-factor 0"
	@$(VENV)/bin/wam demo $(ARGS)

install: $(INSTALLED)  ## install the stack and ROS wheels into .venv; then .venv/bin/wam --help; COMPILE=0: nothing as C
	@$(if $(IS_SHOWN),:,$(SHOW_BUILD))

dependencies: $(STAMPS)/test  # for the container: everything but the package itself

check: PYTEST_ARGS = -n auto -m "not ros and not slow"
check: $(STAMPS)/test  ## lint, types and fast tests without ROS nodes, in under a minute; ARGS="-k plant" goes to pytest
	@$(RUN_CHECKS)

test: PYTEST_ARGS = -n 2
test: $(STAMPS)/test $(INSTALLED)  ## lint, types and all tests; ARGS="-k plant -x" goes to pytest
	@$(RUN_CHECKS)

check test: export ROS_PYTHON_CHECK_FIELDS = 1
define RUN_CHECKS
failed=; \
echo '== ruff'; { $(PY) -P -m ruff check . && $(PY) -P -m ruff format --check -q .; } || failed="$$failed ruff"; \
echo '== mypy'; $(PY) -P -m mypy || failed="$$failed mypy"; \
echo '== pytest'; $(PY) -P -m pytest --dist loadgroup $(PYTEST_ARGS) $(ARGS) || failed="$$failed pytest"; \
if [ -n "$$failed" ]; then echo "make $@: failed:$$failed" >&2; exit 1; fi
endef

bench: $(STAMPS)/test $(INSTALLED)  ## run the benchmarks; they print ratios of one run
	@$(PY) benchmarks/bench.py $(ARGS) || test $$? = 1  # a required speed is missed

soak: $(INSTALLED)  ## run the nodes for SOAK_SECONDS (600): memory, lost messages; the figures go into docs/safety.md
	@$(VENV)/bin/wam evaluate soak --fresh --seconds $(SOAK_SECONDS) --write docs/safety.md $(ARGS)

docs: $(STAMPS)/docs $(INSTALLED)  ## regenerate the pages of docs/, build the site docs/_build/html; ARGS="--pages [docs/PAGE.md ...]" for text only
	@$(PY) docs/generate.py $(ARGS)
	@$(SITE)

site: $(STAMPS)/docs $(INSTALLED)  ## build the site docs/_build/html from the pages as they are
	@$(SITE)

define SITE
rm -rf docs/api docs/_build/html; \
$(PY) -P -m sphinx -W --keep-going -n -j 2 -d docs/_build/doctrees docs docs/_build/html && \
echo "site: docs/_build/html/index.html"
endef

constraints: $(STAMPS)/venv  ## pin the newest compatible versions in constraints.txt; then make clean test
	@mkdir -p .cache
	@$(PIP) install -q --dry-run --ignore-installed --report .cache/resolved.json '.[compile,completion,docs,live,ros,test]'
	@$(TIDY)
	@$(PY) -c 'import json, pathlib, re; file = pathlib.Path("constraints.txt"); \
	head = [line for line in file.read_text().splitlines() if line.startswith("#")]; \
	pins = {re.sub("[-_]+", "-", p["metadata"]["name"]).lower(): p["metadata"]["version"] \
	        for p in json.loads(pathlib.Path(".cache/resolved.json").read_text())["install"]}; \
	pins.pop("wam-stack"); \
	file.write_text("\n".join(head + sorted(f"{n}=={v}" for n, v in pins.items())) + "\n")'

clean:  ## remove .venv, caches and build files; recordings stay
	@rm -rf $(VENV) .cache build *.egg-info .pytest_cache .mypy_cache .ruff_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

$(STAMPS)/venv:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
		echo "wam_stack needs Python 3.11 or newer: make PYTHON=python3.12 ..." >&2; exit 1; }
	@echo "Making $(VENV)"
	@$(PYTHON) -m venv --clear $(VENV) || { \
		echo "Could not make $(VENV); on Debian and Ubuntu: apt install python3-venv" >&2; exit 1; }
	@mkdir -p $(STAMPS) && touch $@

ROS_EXTRAS := bus,compile,completion,kit,live,ros
TEST_EXTRAS := $(ROS_EXTRAS),test
DOCS_EXTRAS := $(TEST_EXTRAS),docs

# The C++ libraries that come with pin: 200 MB of what others compile against, and each library in two or three copies,
# because a wheel has no links.
CXX := $(VENV)/lib/python3*/site-packages/cmeel.prefix

define INSTALL_WITH
@rm -f $(STAMPS)/installed-*
@$(TIDY)
@$(PIP) install -q --no-compile --use-pep517 --no-build-isolation -c constraints.txt '.[$(1)]'
@rm -rf $(CXX)/include $(CXX)/bin $(CXX)/lib/cmake; hardlink $(CXX) >/dev/null 2>&1 || true
@$(TIDY)
@touch $@
endef

$(STAMPS)/ros: $(STAMPS)/venv constraints.txt setup.py
	@echo "Installing into $(VENV): about 0.7 GB, a minute or two the first time"
	@$(PIP) install -q -c constraints.txt setuptools
	$(call INSTALL_WITH,$(ROS_EXTRAS))

$(STAMPS)/test: $(STAMPS)/ros
	@echo "Installing the tools of the tests"
	$(call INSTALL_WITH,$(TEST_EXTRAS))

$(STAMPS)/docs: $(STAMPS)/test
	@echo "Installing what builds the site"
	$(call INSTALL_WITH,$(DOCS_EXTRAS))

# what is installed, and why it is plain Python where it is
COMPILE_LOG := $(STAMPS)/compile.log
PLAIN_0 := COMPILE=0; as C: make install COMPILE=1
PLAIN_1 := $(VENV) was changed after it was installed; as C: make clean, then make install COMPILE=1
PLAIN_auto := no C compiler with the headers of Python; as C: apt install gcc python3-dev, then make install COMPILE=1
define SHOW_BUILD
if (cd $(VENV) && bin/python3 -c 'import wam_driver.fast_steps') 2>/dev/null; then echo "The inner loop is compiled"; \
elif [ $(COMPILE) = auto ] && [ -e $(COMPILE_LOG).failed ]; then \
	echo "The inner loop is plain Python, with the same numbers: it could not be compiled, see $(COMPILE_LOG).failed"; \
else echo "The inner loop is plain Python, with the same numbers: $(PLAIN_$(COMPILE))"; fi
endef

REINSTALL := $(PIP) install -q --no-deps --force-reinstall --no-build-isolation .

$(INSTALLED): $(STAMPS)/ros
	@rm -f $(STAMPS)/installed-* $(STAMPS)/compile-?
	@$(TIDY)
ifeq ($(COMPILE),auto)
	@echo "Compiling the inner loop, where there is a compiler: one to several minutes; COMPILE=0 leaves it as plain Python"
	@rm -f $(COMPILE_LOG).failed
	@WAM_COMPILE=auto $(REINSTALL) 2>$(COMPILE_LOG) || { mv $(COMPILE_LOG) $(COMPILE_LOG).failed; $(REINSTALL); }
else
	@WAM_COMPILE=$(filter-out 0,$(COMPILE)) $(REINSTALL)
	@touch $(STAMPS)/compile-$(COMPILE)
endif
	@$(TIDY)
	@touch $@
	@$(SHOW_BUILD)$(eval IS_SHOWN := 1)
