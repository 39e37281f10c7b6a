# Everything a fresh machine needs is Python >= 3.11 with pip, and make.
PYTHON ?= python3
UV_VERSION := 0.13.8
TOOLS := .tools
UV := PYTHONPATH=$(TOOLS) UV_PYTHON_DOWNLOADS=never $(PYTHON) -m uv
BIN := .venv/bin
WHEEL := .venv-wheel/bin
SYNC = $(UV) sync --quiet --frozen --no-default-groups --python $(PYTHON)

.PHONY: demo test test-all compiled check format benchmark gpu peers reproduce tune-rivals screenshots docs docs-snippets fuzz results extras dist audit publish setup clean

demo: .venv/demo ## run the nutation under AFSM and leave a recording and its telemetry
	$(BIN)/spheretwin simulate nutation --record nutation.rrd --telemetry nutation.parquet

# Tests of one file stay together: they share results. The order of the files is that of tests/conftest.py.
# Bytecode is written: hundreds of processes would compile the sources again. The processes share the cores: threads
# of a linear algebra library would wait for each other, and take twice the processor time.
PYTEST = PYTHONDONTWRITEBYTECODE= OPENBLAS_NUM_THREADS=1 $(BIN)/pytest -rs --numprocesses auto --maxprocesses 4 --dist loadfile --no-loadscope-reorder

test: compiled ## run the tests of the first suite in parallel, in five minutes
	$(PYTEST) -m "not release"

test-all: compiled ## run all tests, also those marked release
	$(PYTEST)

compiled: setup ## compile the loop and the stages of the first suite, which tests that run in parallel load
	$(BIN)/python tests/compiled_loops.py

check: .venv-wheel/installed ## format, lint, types, import layers
	$(WHEEL)/ruff format --check .
	$(WHEEL)/ruff check .
	$(WHEEL)/mypy
	$(WHEEL)/lint-imports

benchmark: setup ## print the speed ratios and the bars of studies, hold the allocation against linear programmes
	$(BIN)/python tests/benchmarks/ratios.py
	$(BIN)/python tests/benchmarks/compilation.py
	$(BIN)/python tests/benchmarks/lanes.py
	$(BIN)/python tests/benchmarks/studies.py
	$(BIN)/python tests/benchmarks/allocation.py
	$(BIN)/python tests/benchmarks/deadlines.py

gpu: .venv-gpu/installed ## hold runs on a GPU against the processor, and print their speed; without a GPU compile the kernels
	.venv-gpu/bin/python tests/benchmarks/gpu.py

peers: .venv-peers/installed ## compare JAX, MJX, Drake and plain NumPy with ours, and print the times of all
	PYTHONPATH=tests/benchmarks .venv-peers/bin/python tests/benchmarks/peers/compare.py

reproduce: setup ## run all that the paper shows, over 20 seeds or more, and leave a page in reproduced/
	$(BIN)/spheretwin reproduce all --out reproduced
	@echo "here:      reproduced/reproduce.html"

# A folder of trials that other sources made is refused; remove it first.
tune-rivals: setup ## search the gains of the compared laws again, and freeze them
	for study in rivals_ideal rivals_electronics; do \
		$(BIN)/spheretwin sweep $$study --optimise && cp $${study}_study/gains.json twin/paper/$$study.json || exit 1; \
	done

screenshots: setup ## take the pictures and clips of the pages; with INSPECT=DIR these and more, at five sizes, in both themes, and as a colour-blind reader sees them
	$(BIN)/python -m tests.screenshots.take $(if $(INSPECT),--inspect $(INSPECT))

docs: .venv/docs ## build the site without a network, with warnings as errors, in build/docs
	$(BIN)/sphinx-build --fail-on-warning --keep-going --quiet --jobs 2 docs build/docs
	@echo "here:      build/docs/index.html"

docs-snippets: setup ## also run the snippets of the documentation that take minutes
	SPHERETWIN_LONG_SNIPPETS=1 $(BIN)/pytest tests/docs -rs

# libFuzzer is part of clang. An input that breaks a promise is written to build/fuzz as crash-*, and
# `build/fuzz/edges crash-*` repeats it.
CLANG ?= clang
FUZZ_S ?= 300
fuzz: setup ## fuzz the exported C code and its FMU with libFuzzer under sanitizers, for FUZZ_S seconds (needs clang)
	mkdir -p build/fuzz/corpus
	$(BIN)/python -m tests.twin.export.fuzz_target build/fuzz
	cd build/fuzz && $(CLANG) -std=c99 -g -O1 -fsanitize=fuzzer,address,undefined,float-cast-overflow \
		-fno-sanitize-recover=all -o edges edges_fuzz.c st_fmu.c st_plant.c st_controller.c -lm && \
		./edges -max_len=512 -max_total_time=$(FUZZ_S) corpus

results: setup ## remake the pages of the results in build/results; conditions.txt there has date, versions and machine
	mkdir -p build/results
	{ date -u +%FT%TZ; git describe --always --dirty; $(BIN)/spheretwin doctor; } > build/results/conditions.txt
	$(BIN)/spheretwin reproduce all --out build/results/paper
	$(BIN)/spheretwin crosscheck --out build/results/crosscheck
	$(BIN)/spheretwin magnetics check --out build/results/magnetics_check
	$(BIN)/spheretwin magnetics map --out build/results/magnetics_map
	@echo "here:      build/results (make peers prints the comparison with other programs)"

dist: $(TOOLS)/uv ## build wheel, source distribution and build/sbom.json, check them, and run a scenario from a clean environment
	rm -rf dist build/clean
	$(UV) build --quiet --out-dir dist .
	$(UV) tool run --quiet twine check --strict dist/*
	$(UV) venv --quiet --python $(PYTHON) build/clean
	$(UV) pip install --quiet --python build/clean dist/*.whl
	$(UV) export --quiet --frozen --no-default-groups --all-extras --format cyclonedx1.5 --output-file build/sbom.json
	cd build/clean && bin/spheretwin doctor && bin/spheretwin simulate hold --duration 0.5 --controller.law pid --json

# Addresses of other hosts are asked for known weaknesses of the locked versions.
audit: $(TOOLS)/uv ## look the locked dependencies up in the database of known vulnerabilities (needs the network)
	$(UV) audit --frozen

publish: $(TOOLS)/uv ## publish what make dist has built; for the workflow of a release, which needs no token
	$(UV) publish --trusted-publishing always dist/*

extras: .venv/demo ## add optional packages: EXTRAS="bench plots", or all of them
	$(SYNC) --inexact --compile-bytecode $(if $(EXTRAS),$(EXTRAS:%=--extra %),--all-extras)

format: .venv-wheel/installed
	$(WHEEL)/ruff format .
	$(WHEEL)/ruff check --fix .

setup: .venv/installed

# What the demo needs and no more, with its recording; what is there already stays.
.venv/demo: uv.lock pyproject.toml $(TOOLS)/uv
	$(SYNC) --inexact --compile-bytecode --extra record
	@touch $@

# What the tests need: every extra that they use is among their group. Packages of make extras stay.
.venv/installed: uv.lock pyproject.toml $(TOOLS)/uv
	$(SYNC) --inexact --compile-bytecode --group test
	@touch $@ .venv/demo

# What the site needs beyond the tests: its API pages import the package.
.venv/docs: .venv/installed
	$(SYNC) --inexact --compile-bytecode --group docs
	@touch $@

# Some peers are as large as all the rest: they stay out of the way.
.venv-peers/installed: uv.lock pyproject.toml $(TOOLS)/uv
	UV_PROJECT_ENVIRONMENT=.venv-peers $(SYNC) --compile-bytecode --group peers
	@touch $@

# The compiler for GPUs is large, and numba-cuda holds NumPy back.
.venv-gpu/installed: uv.lock pyproject.toml $(TOOLS)/uv
	UV_PROJECT_ENVIRONMENT=.venv-gpu $(SYNC) --compile-bytecode --extra gpu --extra rl
	@touch $@

# Type checkers and import-linter do not see folders that are mapped by an editable install.
.venv-wheel/installed: uv.lock pyproject.toml $(TOOLS)/uv $(shell find models control viz twin -name '*.py')
	rm -rf build/lib build/bdist*
	UV_PROJECT_ENVIRONMENT=.venv-wheel $(SYNC) --no-editable --reinstall-package spheretwin --all-extras --no-extra gpu --group dev
	@touch $@

# pip installs uv into a folder of the project: nothing outside it is touched.
$(TOOLS)/uv:
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --root-user-action ignore --target $(TOOLS) --upgrade uv==$(UV_VERSION)

clean:
	rm -rf .venv .venv-wheel .venv-peers .venv-gpu $(TOOLS) build *.egg-info
