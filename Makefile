# Every target installs what it needs. Requires Python 3.10 or newer and a C++ compiler.

PYTHON ?= python3
ARGS ?=# options for pytest and others: make test ARGS='-k energy'
EXTRAS := test,lint

# -I: import the installed package, which has the generated messages, not the source directory.
VENV_PYTHON := .venv/bin/python -I
DEMO := $(VENV_PYTHON) -m collision_response.demo

# The virtual environments have their own ROS. The variables of a sourced ROS would mix the two.
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH LD_LIBRARY_PATH PYTHONHOME PYTHONPATH
unexport RMW_IMPLEMENTATION ROS_DISTRO VIRTUAL_ENV _ROS_WHEELS_BOOTSTRAP_COMPLETE
export ROS_AUTOMATIC_DISCOVERY_RANGE := LOCALHOST
unexport MAKEFLAGS  # ninja fails if it names a job server that is out of reach

.PHONY: help demo test lint audit arm64 bench stability faults fuzz states soak twice reliability examples colcon colcon-test docs clean
.PHONY: .venv .audit-venv .bench-venv .colcon-venv .docs-venv .examples-venv

help:
	@echo 'make demo       collisions that the node answers'
	@echo "make test       run the tests; some of them: make test ARGS='-k energy'"
	@echo 'make lint       run ruff, mypy and clang-format'
	@echo 'make audit      look up known vulnerabilities of the dependencies in the package index'
	@echo 'make bench      speed compared with other programs and with targets, and stability: about ten minutes'
	@echo 'make stability  only the measurements of docs/stability.md: about five minutes'
	@echo 'make faults     many clients, clients that leave or stop, and SIGTERM: docs/reliability.md'
	@echo 'make fuzz       send invalid input to the node'
	@echo 'make states     body states at several rates'
	@echo "make soak       load and faults for ten minutes; for one minute: make soak ARGS='--minutes 1'"
	@echo 'make reliability  faults, fuzz, states and soak: about half an hour'
	@echo 'make twice      run two test suites at once on busy cores, ten times: an hour or more'
	@echo 'make examples   run all programs in examples/; each checks its own output'
	@echo 'make colcon     build this tree with colcon and call the installed node'
	@echo 'make colcon-test  run the tests in such a build, as colcon does: about ten minutes'
	@echo 'make arm64      compile the library for arm64 and run its tests under emulation'
	@echo 'make docs       build the documentation site: pages, API, ROS interfaces'
	@echo 'make clean      remove everything that these targets created'

demo: .venv
	@$(DEMO)

test: .venv
	@$(VENV_PYTHON) -m pytest -n auto --dist loadscope $(ARGS)

lint: .venv
	@$(VENV_PYTHON) -m ruff check .
	@$(VENV_PYTHON) -m ruff format --check --quiet .
	@$(VENV_PYTHON) -m mypy
	@find collision_response -name '*.[ch]pp' | xargs .venv/bin/clang-format --dry-run --Werror

audit: .venv .audit-venv
	@.audit-venv/bin/pip-audit --progress-spinner off > .audit-venv/report 2>&1 \
		--path "$$($(VENV_PYTHON) -c 'import site; print(*site.getsitepackages())')"; status=$$?; \
	cat .audit-venv/report; \
	if grep -q '^numpy .*could not be audited' .audit-venv/report; then \
		echo 'This package index has no vulnerability records: nothing was audited.'; exit 1; \
	fi; exit $$status

.audit-venv:
	@test -x .audit-venv/bin/pip-audit || { $(PYTHON) -m venv .audit-venv && .audit-venv/bin/pip install -q pip-audit; }

# Only fast test files, because emulation is ten times slower.
ARM64 := answers articulated batch_pairs batch_scenes extended_batch moreau resolve scene_values

arm64: .venv
	@tools/arm64.sh $(or $(ARGS),$(ARM64:%=test/test_%.py))

.venv:
	@$(PYTHON) tools/setup_venv.py .venv $(EXTRAS) $(OPTIONAL)

bench: .bench-venv
	@OPENBLAS_NUM_THREADS=1 .bench-venv/bin/python -I benchmarks $(ARGS)

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

# With MAKEFLAGS, colcon does not hold back compilers while the machine is busy.
colcon: .colcon-venv
	@PATH="$(CURDIR)/.colcon-venv/bin:$$PATH"; \
	export PATH AMENT_PREFIX_PATH="$(CURDIR)/.colcon-venv" CMAKE_PREFIX_PATH="$(CURDIR)/.colcon-venv" MAKEFLAGS=-j; \
	colcon --log-level error build --symlink-install --cmake-args -G Ninja -DPython3_FIND_VIRTUALENV=FIRST \
		-DCMAKE_PROJECT_INCLUDE="$(CURDIR)/cmake/ros_wheels.cmake" && \
	. install/setup.sh && python test/colcon_call.py

colcon-test: colcon
	@.colcon-venv/bin/pip install -q catkin_pkg hypothesis matplotlib pytest scipy  # the test_depends of package.xml
	@PATH="$(CURDIR)/.colcon-venv/bin:$$PATH"; export PATH AMENT_PREFIX_PATH="$(CURDIR)/.colcon-venv"; \
	colcon --log-level error test --event-handlers console_direct+ --return-code-on-test-failure

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
