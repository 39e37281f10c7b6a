# Everything a fresh machine needs is Python >= 3.11 with pip, and make.
PYTHON ?= python3
UV_VERSION := 0.13.8
TOOLS := .tools
UV := PYTHONPATH=$(TOOLS) UV_PYTHON_DOWNLOADS=never $(PYTHON) -m uv
BIN := .venv/bin

.PHONY: demo test check format benchmark setup clean

demo: setup ## run the nutation under AFSM and leave a recording and its telemetry
	$(BIN)/spheretwin simulate nutation --record nutation.rrd --telemetry nutation.parquet
	@echo "here:      $(BIN)/rerun nutation.rrd"

test: setup ## pass the tests
	$(BIN)/pytest

check: setup .venv-wheel/installed ## format, lint, types, import layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	.venv-wheel/bin/mypy
	.venv-wheel/bin/lint-imports

benchmark: setup ## print the speed ratios, and hold the bounded allocation against linear programmes
	$(BIN)/python tests/benchmarks/ratios.py
	$(BIN)/python tests/benchmarks/allocation.py

format: setup
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

setup: .venv/installed

.venv/installed: uv.lock pyproject.toml $(TOOLS)/uv
	$(UV) sync --quiet --frozen --compile-bytecode --python $(PYTHON) --all-extras --group dev
	@touch $@

# Type checkers and import-linter do not see folders that are mapped by an editable install.
.venv-wheel/installed: uv.lock pyproject.toml $(TOOLS)/uv $(shell find models control viz twin -name '*.py')
	rm -rf build
	UV_PROJECT_ENVIRONMENT=.venv-wheel $(UV) sync --quiet --frozen --python $(PYTHON) --no-editable --reinstall-package spheretwin --all-extras --group dev
	@touch $@

# pip installs uv into a folder of the project: nothing outside it is touched.
$(TOOLS)/uv:
	$(PYTHON) -m pip install --quiet --disable-pip-version-check --root-user-action ignore --target $(TOOLS) --upgrade uv==$(UV_VERSION)

clean:
	rm -rf .venv .venv-wheel $(TOOLS) build *.egg-info
