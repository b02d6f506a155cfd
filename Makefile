# make demo, make test: set everything up, then do it. make check: format, lint, types.
# make models: write the parameters of mjhill/joints/joints.toml into models/.
# make joints: fit that file and constant_velocity.toml to the literature first, and write docs/joints.md.
# make setup VENV=.venv-oldest VERSIONS=oldest: an environment with the oldest dependencies allowed.
PYTHON ?= python3
VENV ?= .venv
VERSIONS ?= newest
TESTS ?=
READY := $(VENV)/.ready
RUN := $(VENV)/bin
export VENV

.PHONY: demo test check format models joints setup clean

demo: $(READY)
	@.ci/graphics
	@$(RUN)/mjhill demo

test: $(READY)
	@.ci/graphics
	@$(RUN)/pytest -n 2 --dist worksteal -q $(TESTS)

check: $(READY)
	@$(RUN)/ruff format --check .
	@$(RUN)/ruff check .
	@$(RUN)/mypy

format: $(READY)
	@$(RUN)/ruff format .
	@$(RUN)/ruff check --fix .

models: $(READY)
	@$(RUN)/python -m mjhill.engine.mjcf models

joints: $(READY)
	@mkdir -p out
	@$(RUN)/mjhill identify --output out/joints > out/joints.txt
	@$(RUN)/mjhill identify --fix velocity_activation=0 --output out/constant_velocity > out/constant.txt
	@cp out/joints/joints.toml mjhill/joints/joints.toml
	@cp out/constant_velocity/joints.toml mjhill/joints/constant_velocity.toml
	@cp out/joints/report.md docs/joints.md
	@cp out/joints/facts.png docs/facts.png
	@$(RUN)/python -m mjhill.engine.mjcf models

setup: $(READY)

$(READY): pyproject.toml .ci/venv .ci/oldest
	@.ci/venv "$(PYTHON)" "$(VENV)" $(VERSIONS)
	@touch $@

clean:
	rm -rf $(VENV) .venv-newest .venv-oldest out build dist
