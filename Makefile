# make demo   the paper's tables and figures, in out/
# make test   formatter, linter, type checker, tests
# make soak   faults of the action library, many times: minutes
# make fuzz   files and libraries damaged at random, read in child processes: minutes; FUZZ_SEED, FUZZ_ROUNDS
# make bench  speed and accuracy side by side with other libraries
# make evaluate  recognition beside its rivals, in out/
# make figures  the pictures of docs/
# make lock   renew the pinned requirements

PYTHON ?= python3

.PHONY: demo test soak fuzz bench evaluate figures lock clean

demo: .venv/ready
	.venv/bin/kineme reproduce --out out/

test: .venv-dev/ready
	.venv-dev/bin/ruff format --check .
	.venv-dev/bin/ruff check .
	.venv-dev/bin/mypy
	.venv-dev/bin/pytest -n 2 --dist loadscope

soak: .venv-dev/ready
	.venv-dev/bin/pytest soak -p no:cacheprovider

fuzz: .venv-dev/ready
	.venv-dev/bin/pytest fuzz -p no:cacheprovider

.venv/ready: requirements/run.txt pyproject.toml
	$(call environment,.venv,requirements/run.txt)

.venv-dev/ready: requirements/dev.txt pyproject.toml
	$(call environment,.venv-dev,requirements/dev.txt)

# The packages of a lock file, each checked against its hash, then this project on top.
define environment
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "kineme needs Python 3.11 or later, found " + sys.version.split()[0] + "; choose one with: make PYTHON=python3.12")'
	@$(PYTHON) -c 'import ensurepip' || { echo "This Python cannot create environments; on Debian: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv --clear $(1)
	$(1)/bin/pip install --quiet --require-hashes -r $(2)
	$(1)/bin/pip install --quiet --no-deps --no-build-isolation --editable .
	touch $@
endef

bench: .venv-bench/ready
	PYTHONPATH=src .venv-bench/bin/python -m bench

# Two steps: the peer that comes as source is compiled with pinned tools, nothing is fetched aside.
.venv-bench/ready: requirements/run.txt bench/build.txt bench/peers.txt
	$(PYTHON) -m venv --clear .venv-bench
	.venv-bench/bin/pip install --quiet --require-hashes -r requirements/run.txt -r bench/build.txt
	.venv-bench/bin/pip install --quiet --require-hashes --no-build-isolation -r bench/peers.txt
	touch $@

evaluate: .venv-rivals/ready
	.venv-rivals/bin/kineme evaluate lasa --out out/

.venv-rivals/ready: bench/rivals.txt pyproject.toml
	$(call environment,.venv-rivals,bench/rivals.txt)

figures: .venv-dev/ready
	.venv-dev/bin/python docs/make_figures.py

lock:
	uv pip compile pyproject.toml --group build --universal --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/run.txt
	uv pip compile pyproject.toml --group dev --universal --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/dev.txt
	uv pip compile bench/build.in -c requirements/run.txt --universal --generate-hashes --no-emit-index-url --no-header --quiet -o bench/build.txt
	uv pip compile bench/peers.in -c requirements/run.txt --universal --generate-hashes --no-emit-index-url --no-header --quiet -o bench/peers.txt
	uv pip compile pyproject.toml bench/rivals.in --group build --universal --generate-hashes --no-emit-index-url --no-header --quiet -o bench/rivals.txt

clean:
	rm -rf .venv .venv-dev .venv-bench .venv-rivals out
