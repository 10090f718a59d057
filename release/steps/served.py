"""The studio starts, serves its page and every file that the page names, and stops."""

import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.request import HTTPCookieProcessor, build_opener

opened = build_opener(HTTPCookieProcessor()).open  # the address carries a token, which a browser keeps as a cookie
kineme = Path(sys.executable).with_name("kineme")
command = [kineme, "studio", "--library", "actions", "--no-open"]
with subprocess.Popen(
    command, stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"}
) as served:
    try:
        address = re.search(r"http://\S+", served.stdout.readline())[0]
        page = opened(address, timeout=20).read().decode()
        root = re.match(r"http://[^/]+", address)[0]
        named = re.findall(r'(?:src|href)="(/?[\w./-]+)"', page)
        for name in named:
            assert opened(f"{root}/{name.lstrip('/')}", timeout=20).status == 200, name
    finally:
        served.terminate()
print(f"the studio serves its page and {len(named)} files that it names")
