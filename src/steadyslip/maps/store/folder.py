"""Zarr store for the folder of a map, restricted to regular files of declared sizes within the folder.

The folder of a map may come from an untrusted source. No link is followed, no read can block, and no chunk may unpack
to more bytes than its array has.
"""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

from zarr.storage import LocalStore

from steadyslip.files.inputs import UnreadableFile, check_kind, check_room, inside
from steadyslip.maps.plan.axes import COMPLETE

METADATA = 2**26
"""Largest size of a metadata file, bytes; chosen by trial, far above the metadata of any map."""
_HEAD, _OVERHEAD = 16, 64  # bytes: length of Blosc's header, and upper bound of what codecs add to a chunk


class MapFolder(LocalStore):  # type: ignore[misc]  # Zarr's types are not checked
    """Zarr's store of local files, with checks before each access.

    `sizes` has the unpacked size (bytes) of a chunk by name of the array.
    """

    def __init__(self, root: Path | str, *, read_only: bool = False) -> None:
        super().__init__(root, read_only=read_only)
        self.sizes: dict[str, int] = {}

    def with_read_only(self, read_only: bool = False) -> MapFolder:
        found = MapFolder(self.root, read_only=read_only)
        found.sizes = self.sizes
        return found

    def _check_file(self, key: str) -> None:
        """Raise an error if the file of a key is not a regular file or too large."""
        path = inside(self.root, key)
        try:
            found = path.lstat()
        except (FileNotFoundError, NotADirectoryError):
            return
        if stat.S_ISDIR(found.st_mode):
            return  # Zarr treats the file as missing
        check_kind(str(path), found)
        most = METADATA
        if "/c/" in key:
            most = self.sizes.get(key.split("/")[0], 0) + _OVERHEAD  # limit of a chunk's file; unknown arrays: 64 bytes
        if found.st_size > most:
            raise UnreadableFile(str(path), f"it has {found.st_size} bytes; allowed: {most}")

    def _checked_chunk(self, key: str, found: Any) -> Any:
        """Content of a chunk, after a check that its header declares the size that its array needs."""
        name = key.split("/")[0]
        if found is None or "/c/" not in key or not self.sizes.get(name):
            return found
        content = found.to_bytes()
        if name == COMPLETE:  # the marks of finished chunks are not compressed
            if len(content) != self.sizes[name]:
                raise UnreadableFile(str(self.root / key), "it is damaged, a mark has another size")
            return found
        unpacked, packed = (int.from_bytes(content[at : at + 4], "little") for at in (4, 12))
        if len(content) < _HEAD or unpacked != self.sizes[name] or packed + 4 != len(content):
            raise UnreadableFile(str(self.root / key), "it is damaged, its sizes are not those of its array")
        return found

    async def get(self, key: str, prototype: Any = None, byte_range: Any = None) -> Any:
        self._check_file(key)
        if prototype is None:  # older versions of Zarr have no default
            from zarr.core.buffer import default_buffer_prototype

            prototype = default_buffer_prototype()
        found = await super().get(key, prototype, byte_range)
        return self._checked_chunk(key, found) if byte_range is None else found

    def get_sync(self, key: str, *, prototype: Any = None, byte_range: Any = None) -> Any:
        self._check_file(key)
        found = super().get_sync(key, prototype=prototype, byte_range=byte_range)
        return self._checked_chunk(key, found) if byte_range is None else found

    async def get_partial_values(self, prototype: Any, key_ranges: Any) -> Any:
        wanted = list(key_ranges)
        for key, _ in wanted:
            self._check_file(key)
        return await super().get_partial_values(prototype, wanted)

    async def exists(self, key: str) -> bool:
        self._check_file(key)
        return bool(await super().exists(key))

    async def set(self, key: str, value: Any) -> None:
        check_room(inside(self.root, key))
        await super().set(key, value)

    def set_sync(self, key: str, value: Any) -> None:
        check_room(inside(self.root, key))
        super().set_sync(key, value)

    async def set_if_not_exists(self, key: str, value: Any) -> None:
        check_room(inside(self.root, key))
        await super().set_if_not_exists(key, value)

    async def delete(self, key: str) -> None:
        inside(self.root, key)
        await super().delete(key)

    def delete_sync(self, key: str) -> None:
        inside(self.root, key)
        super().delete_sync(key)
