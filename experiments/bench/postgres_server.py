"""A PostgreSQL server of one's own, in a temporary folder, from the programs that the system has."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from time import monotonic, sleep
from typing import Any

PASSWORD = "open sesame"
_PATIENCE = 30.0  # seconds


def programs() -> Path | None:
    """Folder of the server's programs; None where there are none, or nobody may run them."""
    found = [Path(path).resolve().parent for name in ("initdb", "postgres") if (path := shutil.which(name))]
    found += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    complete = [folder for folder in found if (folder / "initdb").is_file() and (folder / "postgres").is_file()]
    return complete[0] if complete and (os.geteuid() or _user()) else None


def _user() -> dict[str, Any]:
    """Who runs it: the server refuses root, for whom the user of Debian's package does."""
    with suppress(KeyError):
        if not os.geteuid():
            user = pwd.getpwnam("postgres")
            return {"user": user.pw_uid, "group": user.pw_gid, "extra_groups": []}
    return {}


class Server:
    """A running server with one database; users of the socket need no password, others do."""

    def __init__(self, folder: Path, *settings: str) -> None:
        binaries = programs()
        assert binaries is not None
        self.folder, self._binaries, self._settings = folder, binaries, settings
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.port = free.getsockname()[1]
        password = folder / "password"
        password.write_text(PASSWORD)
        if user := _user():
            for path in (folder, password):
                os.chown(path, user["user"], user["group"])
        self._run("initdb", "-D", "data", "-U", "kineme", "--auth-local=trust", "--auth-host=scram-sha-256",
                  "--pwfile=password", "--no-sync", "-E", "UTF8", "--locale=C.UTF-8")  # fmt: skip
        self.start()

    def _run(self, program: str, *arguments: str) -> None:
        command = [str(self._binaries / program), *arguments]
        subprocess.run(command, cwd=self.folder, check=True, capture_output=True, **_user())

    def start(self) -> None:
        """Start it, and wait until it answers."""
        settings = (f"port={self.port}", f"unix_socket_directories={self.folder}", "listen_addresses=127.0.0.1",
                    "max_connections=40", *self._settings)  # fmt: skip
        options = [word for setting in settings for word in ("-c", setting)]
        with (self.folder / "log").open("ab") as log:
            command = [str(self._binaries / "postgres"), "-D", "data", *options]
            self._process = subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log, **_user())
        late = monotonic() + _PATIENCE
        user = ("-h", str(self.folder), "-p", str(self.port), "-U", "kineme")
        while True:
            try:
                return self._run("psql", *user, "-c", "", "postgres")
            except subprocess.CalledProcessError:
                if monotonic() > late or self._process.poll() is not None:
                    raise
                sleep(0.05)

    def stop(self, how: int = signal.SIGINT) -> None:
        """Stop it: by SIGINT connections are cut, by SIGQUIT as by a crash."""
        self._process.send_signal(how)
        self._process.wait(_PATIENCE)

    def address(self, schema: str = "kineme") -> str:
        """Address of a library there, by the socket."""
        return f"postgresql://kineme@/postgres?host={self.folder}&port={self.port}&schema={schema}"

    def network_address(self, password: str = "", schema: str = "kineme") -> str:
        """Address of a library there, by the network."""
        return f"postgresql://kineme{password and ':'}{password}@127.0.0.1:{self.port}/postgres?schema={schema}"


@contextmanager
def running_server(*settings: str) -> Iterator[Server]:
    """A server within the context, with settings as ``fsync=off``."""
    folder = Path(tempfile.mkdtemp(prefix="kineme-postgres-"))
    try:
        server = Server(folder, *settings)
        try:
            yield server
        finally:
            server.stop(signal.SIGQUIT)  # at once: nothing of it stays
    finally:
        shutil.rmtree(folder, ignore_errors=True)
