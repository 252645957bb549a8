"""A real Firefox for tests, spoken to in its own protocol (Marionette): JSON behind its length, over TCP."""

import json
import shutil
import socket
import subprocess
import time

import pytest


class Firefox:
    """A Firefox without windows, with a profile of its own in a folder that is given."""

    def __init__(self, folder):
        path = shutil.which("firefox") or shutil.which("firefox-esr")
        if path is None:
            pytest.skip("there is no Firefox here (apt-get install firefox-esr)")
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        (folder / "user.js").write_text(f'user_pref("marionette.port", {port});\n', encoding="utf-8")
        command = [path, "--headless", "--marionette", "--no-remote", "--profile", str(folder)]
        self.socket = self.stream = None
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            self.socket = self._connected(port)
            self.stream = self.socket.makefile("rwb")
            self._heard()
            self.count = 0
            self.ask("WebDriver:NewSession")
        except BaseException:
            self.close()
            raise

    def _connected(self, port):
        end = time.monotonic() + 60
        while True:
            try:
                return socket.create_connection(("127.0.0.1", port), timeout=60)
            except OSError:
                if time.monotonic() > end or self.process.poll() is not None:
                    raise
                time.sleep(0.1)

    def _heard(self):
        length = b""
        while (letter := self.stream.read(1)) != b":":
            length += letter
        return json.loads(self.stream.read(int(length)))

    def ask(self, name, **parameters):
        """Answer to a command."""
        self.count += 1
        message = json.dumps([0, self.count, name, parameters]).encode()
        self.stream.write(b"%d:%s" % (len(message), message))
        self.stream.flush()
        _, _, fault, answer = self._heard()
        assert fault is None, fault
        return answer

    def run(self, script, *arguments):
        """Return value of a script; that of its promise if it returns one."""
        return self.ask("WebDriver:ExecuteScript", script=script, args=arguments)["value"]

    def close(self):
        """End it."""
        for one in (self.stream, self.socket):
            if one is not None:
                one.close()
        self.process.terminate()
        self.process.wait(30)
