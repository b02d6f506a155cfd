# make demo, make test: set everything up, then do it. make check: format, lint, types.
PYTHON ?= python3
VENV ?= .venv
READY := $(VENV)/.ready
RUN := $(VENV)/bin
export VENV

.PHONY: demo test check format setup clean

demo: $(READY)
	@.ci/graphics
	@$(RUN)/mjhill demo

test: $(READY)
	@.ci/graphics
	@$(RUN)/pytest -n 2 -q

check: $(READY)
	@$(RUN)/ruff format --check .
	@$(RUN)/ruff check .
	@$(RUN)/mypy

format: $(READY)
	@$(RUN)/ruff format .
	@$(RUN)/ruff check --fix .

setup: $(READY)

$(READY): pyproject.toml .ci/venv
	@.ci/venv "$(PYTHON)" "$(VENV)"
	@touch $@

clean:
	rm -rf $(VENV) out build dist
