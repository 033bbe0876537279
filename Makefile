# For those who work on camviz; a reader needs only start.py.
BIN := .venv/bin

.PHONY: test lint browser site bench lock

test:
	python3 start.py test

lint:
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	.ci/types
	$(BIN)/codespell

browser:
	$(BIN)/python -m pytest -m browser -n 2 tests/browser --ignore=tests/browser/test_site_in_chromium.py

site:
	python3 start.py site
	$(BIN)/python -m pytest -m browser -n 2 tests/browser/test_site_in_chromium.py

bench:
	$(BIN)/python benchmarks/kernel.py
	$(BIN)/python benchmarks/calibration.py
	$(BIN)/python benchmarks/optics.py
	$(BIN)/python benchmarks/wide.py
	$(BIN)/python benchmarks/lightfield.py
	$(BIN)/python benchmarks/mosaics.py
	$(BIN)/python benchmarks/noise.py
	$(BIN)/python benchmarks/mtf.py
	$(BIN)/python benchmarks/class_votes.py
	$(BIN)/python benchmarks/browser.py
	$(BIN)/python benchmarks/replay.py

# Newest versions that pyproject.toml allows, for every platform and Python, with hashes and without naming any host.
# The reader's lock holds the build backend, too; the site's and the tester's hold only what each adds.
LOCK := uv pip compile --universal --generate-hashes --no-header --no-annotate --no-emit-index-url
lock:
	mkdir -p build
	printf 'hatchling\neditables\n' > build/backend.in
	$(LOCK) --upgrade pyproject.toml build/backend.in --extra lab --output-file requirements.lock
	$(LOCK) pyproject.toml --extra site -c requirements.lock --output-file build/site.lock
	$(LOCK) pyproject.toml --extra test -c build/site.lock --output-file build/all.lock
	python3 .github/added_locks.py requirements.lock build/site.lock build/all.lock
