# make demo    install into .venv, then stack three blocks from one demonstration
# make test    install into .venv, then run the tests (about 20 minutes on 2 cores)
# make check   lint, types and tests

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check
FOLDERS := face envs planner baselines configs bench tests
LEARNING := $(addprefix tests/,bench/train/test_command.py bench/train/test_hindsight.py \
    baselines/learning/test_export_actor.py baselines/learning/test_learned_policy.py baselines/learning/test_learning_page.py)

.DEFAULT_GOAL := help
NEWEST := .venv-newest
OLDEST := .venv-oldest
INSTALL := bin/python -m pip --disable-pip-version-check install --quiet

# $(call chosen,NAMES): the PYTHON that the user names, else the first of these that runs, else python3
chosen = $(if $(filter file,$(origin PYTHON)),$(shell \
    for name in $(1); do $$name -c '' 2>/dev/null && echo $$name && exit; done; echo $(PYTHON)),$(PYTHON))

.PHONY: help demo test learn slow newest oldest lint types check picture perf soak study docs bodies beads clean

help: ## show the targets
	@grep -E '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*## /\t/' | expand -t 12

$(BIN)/python:
	@sh .ci/prerequisites $(PYTHON)
	@echo "making $(VENV)"
	@$(PYTHON) -m venv $(VENV)

$(VENV)/.installed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing (about a minute)"
	@$(PIP) install --quiet --editable . --constraint constraints.txt
	@touch $@

$(VENV)/.developed: pyproject.toml constraints.txt | $(BIN)/python
	@echo "installing with the developers' tools (about a minute)"
	@$(PIP) install --quiet --editable '.[dev]' --constraint constraints.txt
	@touch $@ $(VENV)/.installed

$(VENV)/.learned: $(VENV)/.developed
	@echo "installing what training needs (some minutes)"
	@$(PIP) install --quiet --editable '.[dev,rl]' --constraint constraints.txt
	@touch $@

demo: $(VENV)/.installed ## stack three blocks from one demonstration: report, figure, video
	@$(BIN)/onedemo run configs/bench/stack.yaml

test: $(VENV)/.developed ## run the tests
	@$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadfile

learn: $(VENV)/.learned ## install torch and Stable-Baselines3 too, run the tests of training
	@$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadscope $(LEARNING)

slow: $(VENV)/.developed ## run the long tests too, on newly drawn values
	@$(BIN)/python -m pytest --hypothesis-profile=default -n 2 --dist loadfile

newest: ## the planner's and the judge's tests with the newest of all they need, no simulator; PYTHON=python3.13
	@test -x $(NEWEST)/bin/python || $(call chosen,python3.13 python3.12) -m venv $(NEWEST)
	@$(NEWEST)/bin/python .ci/requirements.py newest > $(NEWEST)/requirements.txt
	@echo "installing into $(NEWEST) (some minutes)"
	@$(NEWEST)/$(INSTALL) --upgrade --requirement $(NEWEST)/requirements.txt
	@$(NEWEST)/$(INSTALL) --no-deps --ignore-requires-python --editable .
	@$(NEWEST)/bin/python -m pytest -m "not slow" -n 2 --dist loadfile tests/planner

oldest: ## the tests with the lowest version that is allowed of all they need; PYTHON=python3.10
	@test -x $(OLDEST)/bin/python || sh .ci/prerequisites $(call chosen,python3.10)
	@test -x $(OLDEST)/bin/python || $(call chosen,python3.10) -m venv $(OLDEST)
	@$(OLDEST)/bin/python .ci/requirements.py oldest > $(OLDEST)/constraints.txt
	@echo "installing into $(OLDEST) (some minutes)"
	@$(OLDEST)/$(INSTALL) --editable '.[dev]' --constraint $(OLDEST)/constraints.txt
	@$(OLDEST)/bin/python -m pytest -m "not slow" -n 2 --dist loadfile

lint: $(VENV)/.developed ## ruff
	@$(BIN)/ruff check $(FOLDERS)
	@$(BIN)/ruff format --check --quiet $(FOLDERS)

types: $(VENV)/.developed ## pyright
	@$(BIN)/pyright

check: lint types test ## lint, types and tests

picture: $(BIN)/python ## draw the packages and who imports whom: docs/architecture.svg
	@$(BIN)/python tests/draw_architecture.py

perf: $(VENV)/.developed ## the table of speeds
	@$(BIN)/onedemo perf

soak: $(VENV)/.developed ## a million steps that try to break the guard, fifty runs killed at any moment: bench/soak.json
	@$(BIN)/python tests/soak.py --guard 1000000 --kills 50 --seed 0 --output bench/soak.json

study: $(VENV)/.developed ## plan in a thousand random scenes, judged; and change each setting: bench/scenes.json, ablation.json
	@$(BIN)/python tests/scene_study.py --count 150 --output bench/scenes.json
	@$(BIN)/python tests/repet_ablation.py --count 20 --output bench/ablation.json

docs: $(VENV)/.developed ## the page and the clip of every task: docs/tasks
	@$(BIN)/onedemo tasks --write docs/tasks --clips

bodies: $(VENV)/.developed ## fit the capsules of the robots anew (for a new robot)
	@$(BIN)/python -c "from onedemo.envs.scene import robot_bodies as b; b.TABLE.write_text(b.table_text(tuple(b.ROBOTS)))"

beads: $(VENV)/.developed ## let the beads settle in their glasses anew (for a new glass)
	@$(BIN)/python -c "from onedemo.envs.pour import geometry as g, places as p; from onedemo.envs.scene import beads; beads.TABLE.write_text(beads.table_text(((p.WIDE, g.BEADS), (p.SLIM, g.BEADS))))"

clean: ## remove the environment, the caches and the builds; runs/ stays
	@rm -rf $(VENV) $(NEWEST) $(OLDEST) build dist *.egg-info .pytest_cache .ruff_cache .hypothesis
