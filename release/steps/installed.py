"""The package is the installed one, in the version of the wheel, with its types and data."""

import sys
from importlib.metadata import version
from pathlib import Path

import kineme

assert kineme.__version__ == version("kineme") == sys.argv[1], (kineme.__version__, version("kineme"), sys.argv)
folder = Path(kineme.__file__).parent
assert "site-packages" in folder.parts, folder
assert (folder / "py.typed").is_file()
print(f"kineme {kineme.__version__} on Python {sys.version.split()[0]}")
