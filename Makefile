# Each target sets up what it needs by itself, given Python 3.10 or newer and a C++ compiler.

PYTHON ?= python3
ARGS ?=# of pytest: make test ARGS='-k energy'
EXTRAS := test,lint

# -I: the package as installed, with its messages, not the directory of that name beside this file.
VENV_PYTHON := .venv/bin/python -I
DEMO := $(VENV_PYTHON) -m collision_response.demo

# The environments bring their own ROS; a sourced one must not get in among it.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONHOME PYTHONPATH
unexport RMW_IMPLEMENTATION ROS_DISTRO VIRTUAL_ENV _ROS_WHEELS_BOOTSTRAP_COMPLETE
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST

.PHONY: help demo test lint audit arm64 bench stability faults fuzz states soak twice reliability examples colcon docs clean
.PHONY: .venv .audit-venv .bench-venv .colcon-venv .docs-venv .examples-venv

help:
	@echo 'make demo       collisions, answered by the node'
	@echo "make test       the tests; make test ARGS='-k energy' some of them"
	@echo 'make lint       ruff and mypy'
	@echo 'make audit      known weaknesses of what the package needs; asks the package index'
	@echo 'make bench      times against peers and limits, and stability: some ten minutes'
	@echo 'make stability  the measurements of docs/stability.md alone: some eight minutes'
	@echo 'make faults     clients that crowd, leave and stop, and SIGTERM: docs/reliability.md'
	@echo 'make fuzz       hostile input, to the node from outside'
	@echo 'make states     body states at rates'
	@echo "make soak       load and faults for ten minutes; make soak ARGS='--minutes 1' for one"
	@echo 'make reliability  these four: some half an hour'
	@echo 'make twice      ten times two test suites at once, on busy cores: an hour or more'
	@echo 'make examples   all programs of examples/: each checks what it prints'
	@echo 'make colcon     a colcon build of this tree, and a call of the node it installs'
	@echo 'make arm64      the library compiled for arm64, its tests under emulation'
	@echo 'make docs       the reference site: these pages, the API, the interfaces'
	@echo 'make clean      remove all that these made'

demo: .venv
	@$(DEMO)

test: .venv
	@$(VENV_PYTHON) -m pytest -n auto --dist loadscope $(ARGS)

lint: .venv
	@$(VENV_PYTHON) -m ruff check .
	@$(VENV_PYTHON) -m mypy

audit: .venv .audit-venv
	@.audit-venv/bin/pip-audit --progress-spinner off > .audit-venv/report 2>&1 \
		--path "$$($(VENV_PYTHON) -c 'import site; print(*site.getsitepackages())')"; status=$$?; \
	cat .audit-venv/report; \
	if grep -q '^numpy .*could not be audited' .audit-venv/report; then \
		echo 'This package index keeps no record of weaknesses: nothing was audited.'; exit 1; \
	fi; exit $$status

.audit-venv:
	@test -x .audit-venv/bin/pip-audit || { $(PYTHON) -m venv .audit-venv && .audit-venv/bin/pip install -q pip-audit; }

# Quick ones: emulation takes ten times as long.
ARM64 := answers articulated batch_pairs batch_scenes extended_batch moreau resolve scene_values

arm64: .venv
	@tools/arm64.sh $(or $(ARGS),$(ARM64:%=test/test_%.py))

.venv:
	@$(PYTHON) tools/setup_venv.py .venv $(EXTRAS) $(OPTIONAL)

bench: .bench-venv
	@.bench-venv/bin/python -I benchmarks $(ARGS)

stability: .bench-venv
	@.bench-venv/bin/python -I benchmarks/stability.py

reliability fuzz: OPTIONAL := benchmarks/reliability/requirements.txt

faults fuzz states soak twice: .venv
	@$(VENV_PYTHON) benchmarks/reliability $@ $(ARGS)

reliability: .venv
	@$(VENV_PYTHON) benchmarks/reliability all

.bench-venv:
	@$(PYTHON) tools/setup_venv.py .bench-venv plots,test benchmarks/requirements.txt

examples: .examples-venv
	@set -e; for example in examples/*.py; do echo "== $$example"; .examples-venv/bin/python -I $$example; done

.examples-venv:
	@$(PYTHON) tools/setup_venv.py .examples-venv plots examples/requirements.txt

colcon: .colcon-venv
	@PATH="$(CURDIR)/.colcon-venv/bin:$$PATH"; \
	export PATH AMENT_PREFIX_PATH="$(CURDIR)/.colcon-venv" CMAKE_PREFIX_PATH="$(CURDIR)/.colcon-venv"; \
	colcon --log-level error build --symlink-install --cmake-args -G Ninja -DPython3_FIND_VIRTUALENV=FIRST \
		-DCMAKE_PROJECT_INCLUDE="$(CURDIR)/cmake/ros_wheels.cmake" && \
	. install/setup.sh && python test/colcon_call.py

.colcon-venv:
	@$(PYTHON) tools/setup_venv.py .colcon-venv

docs: .docs-venv
	@rm -rf .docs && mkdir .docs && cp -r docs .docs/source
	@.docs-venv/bin/python -m sphinx -q -W --keep-going .docs/source .docs/html
	@echo '==> .docs/html/index.html'

.docs-venv:
	@test -x .docs-venv/bin/sphinx-build || \
		{ $(PYTHON) -m venv .docs-venv && .docs-venv/bin/pip install -q -r docs/requirements.txt; }

clean:
	rm -rf .venv .arm64 .audit-venv .bench-venv .colcon-venv .docs-venv .examples-venv .docs .kernels build install log .hypothesis .mypy_cache .pytest_cache .ruff_cache
	find . -name __pycache__ -prune -exec rm -rf {} +
