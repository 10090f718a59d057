"""The studio starts, serves its page and every file that the page names, and stops."""

import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.request import urlopen

kineme = Path(sys.executable).with_name("kineme")
command = [kineme, "studio", "--library", "actions", "--no-open"]
with subprocess.Popen(
    command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
) as served:
    try:
        address = re.search(r"http://\S+", served.stdout.readline())[0]
        page = urlopen(address, timeout=20).read().decode()
        root = address.split("/?")[0].split("/#")[0]
        named = re.findall(r'(?:src|href)="(/?[\w./-]+)"', page)
        for name in named:
            assert urlopen(f"{root}/{name.lstrip('/')}", timeout=20).status == 200, name
    finally:
        served.terminate()
print(f"the studio serves its page and {len(named)} files that it names")
