"""Disks that are full or cannot be written: file systems of their own, which root obeys, too."""

import subprocess

import pytest

SIZE = 4 << 20  # [bytes]


class Disk:
    """A small file system at `path` while this context lasts; skips a test that may not mount."""

    def __init__(self, path):
        path.mkdir()
        self.path, self._filler = path, path / ".filler"

    def __enter__(self):
        options = ["-t", "tmpfs", "-o", f"size={SIZE}", "tmpfs", self.path]
        done = subprocess.run(["mount", *options], capture_output=True, text=True, check=False)
        if done.returncode:
            pytest.skip(f"mount: {done.stderr.strip()}")
        return self

    def __exit__(self, *error):
        subprocess.run(["umount", "--lazy", self.path], check=True)

    def fill(self, left=0):
        """Leaves about so much space [bytes]."""
        self.empty()
        with open(self._filler, "wb", buffering=0) as stream:
            written = 0
            try:
                while True:
                    written += stream.write(bytes(4096))
            except OSError:
                stream.truncate(max(0, written - left))

    def empty(self):
        """Frees that space."""
        self._filler.unlink(missing_ok=True)

    def set_writable(self, writable):
        """Mounts it for reading only, or for writing, too."""
        option = f"remount,{'rw' if writable else 'ro'}"
        subprocess.run(["mount", "-o", option, self.path], check=True)
