"""A large file that is only ever replaced whole, at the cost of what is added to it.

HDF5 files are changed in place: a process killed during a change may leave a file that cannot be
read. Changing a copy and putting the copy in the file's place is safe, but copying the file for
each change takes time that grows with the square of the recorded length. So there are two files
that alternate: the file, which is never changed, and its spare beside it, which is one change
behind. The spare is brought up to date, changed, and swapped with the file. Each change is then
written twice, and while a `Spare` exists the disk holds the file twice. The file itself is complete
at any time, for readers and for copies.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import weakref
from pathlib import Path

from ._lock import MAX_WAIT_S, locked

#: Identifies a file's state: its inode, its size (bytes), the time of its last change (ns).
Mark = tuple[int, int, int]


class Spare:
    """The spare of the file `path`. Writers lock its folder.

    `discard`, or the end of this object or of the program, removes it.
    """

    def __init__(self, path: Path):
        # A link stays a link: its target is replaced.
        self.file = path.resolve()
        self.path = self.file.with_name(self.file.name + ".spare.partial")
        self._older = self.file.with_name(self.file.name + ".older.partial")
        self._marks: tuple[Mark, Mark] | None = None
        weakref.finalize(self, _discard, os.getpid(), self.path, self._older)

    def locked(self, max_wait_s: float = MAX_WAIT_S) -> contextlib.AbstractContextManager[None]:
        """Locks the file and its spare. All methods below need the lock, except `discard`."""
        return locked(self.file.parent, max_wait_s)

    def take(self) -> Path:
        """Returns the spare: equal to the file, or one change behind it.

        If another writer has changed either, the spare is copied from the file.
        """
        known = self._marks
        # Its content is unknown until it is swapped with the file.
        self._marks = None
        if known is None or not self.path.exists() or known != (_mark(self.file), _mark(self.path)):
            self.copy()
        return self.path

    def copy(self) -> Path:
        """Copies the file to the spare."""
        self.drop()
        shutil.copy(self.file, self.path)
        return self.path

    def swap(self) -> None:
        """Swaps the spare with the file. The file has one state or the other at any time."""
        # Windows needs a file that is open for writing here.
        _to_disk(self.path, os.O_RDWR)
        self._older.unlink(missing_ok=True)
        # A second name keeps the old state. On a file system without hard links it is lost, and the
        # next `take` copies.
        with contextlib.suppress(OSError):
            os.link(self.file, self._older)
        os.replace(self.path, self.file)
        # The change is done. A failure from here on costs a copy at most.
        with contextlib.suppress(OSError):
            _to_disk(self.file.parent, os.O_RDONLY)
        with contextlib.suppress(OSError):
            os.replace(self._older, self.path)
            self._marks = _mark(self.file), _mark(self.path)

    def drop(self) -> None:
        """Removes the spare, and files of a killed writer."""
        self._marks = None
        _remove(self.path, self._older)

    def discard(self) -> None:
        """Removes the spare, unless another writer holds the lock."""
        self._marks = None
        _discard(os.getpid(), self.path, self._older)


def _discard(process: int, spare: Path, older: Path) -> None:
    # The end of a forked child is not the end of its parent's writer.
    if process == os.getpid():
        with contextlib.suppress(OSError, RuntimeError), locked(spare.parent, 0.0):
            _remove(spare, older)


def _mark(path: Path) -> Mark:
    now = path.stat()
    return now.st_ino, now.st_size, now.st_mtime_ns


def _remove(*paths: Path) -> None:
    for path in paths:
        path.unlink(missing_ok=True)


def _to_disk(path: Path, flags: int) -> None:
    """Waits until a file's content, or a folder's names, are on the disk."""
    opened = os.open(path, flags)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)
