# make demo   the paper's tables and figures, in out/
# make test   formatter, linter, type checker, tests
# make bench  speed and accuracy side by side with other libraries
# make lock   renew the pinned requirements

PYTHON ?= python3

.PHONY: demo test check bench lock clean

demo: .venv/ready
	.venv/bin/kineme reproduce --out out/

test: .venv-dev/ready
	.venv-dev/bin/ruff format --check .
	.venv-dev/bin/ruff check .
	.venv-dev/bin/mypy
	.venv-dev/bin/pytest

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

lock:
	uv pip compile pyproject.toml --group build --universal --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/run.txt
	uv pip compile pyproject.toml --group dev --universal --generate-hashes --no-emit-index-url --no-header --quiet -o requirements/dev.txt

clean:
	rm -rf .venv .venv-dev .venv-bench out
