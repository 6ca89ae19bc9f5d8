"""A large file that is only ever replaced whole, at the cost of what is added to it.

HDF5 files are changed in place: who is killed amid a change may leave a file that cannot be read. Changing a copy and putting that in
the file's place is safe, but copying all for each change takes time that grows with the square of what is recorded. So there are two
files that take turns: the file, which is never touched, and its spare beside it, which is one change behind. The spare is brought up
to the file, changed, and changes places with it. Each change is then written twice, and while a `Spare` is kept the disk holds the
file twice; the file itself is always one file and whole, for readers and for whoever copies it.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import weakref
from pathlib import Path

from ._turns import SAVING_SECONDS, alone

#: What a file's state is known again by: its inode, its size [bytes], when it was written [ns].
Mark = tuple[int, int, int]


class Spare:
    """The spare of the file `path`, in whose folder writers take turns. `discard` removes it, or the end of this object or of the program."""

    def __init__(self, path: Path):
        # A link stays a link: what it points at is replaced.
        self.file = path.resolve()
        self.path = self.file.with_name(self.file.name + ".spare.partial")
        self._older = self.file.with_name(self.file.name + ".older.partial")
        self._marks: tuple[Mark, Mark] | None = None
        weakref.finalize(self, _discard, os.getpid(), self.path, self._older)

    def alone(self, seconds: float = SAVING_SECONDS) -> contextlib.AbstractContextManager[None]:
        """Has the file and its spare to itself: all that follows wants that, but `discard`."""
        return alone(self.file.parent, seconds)

    def take(self) -> Path:
        """The spare: equal to the file, or one change behind it. Where another has changed either, it is made anew by copying."""
        known = self._marks
        # From here on what it holds is not known, until it is put in the file's place.
        self._marks = None
        if known is None or not self.path.exists() or known != (_mark(self.file), _mark(self.path)):
            self.copy()
        return self.path

    def copy(self) -> Path:
        """Makes the spare anew as a copy of the file."""
        self.drop()
        shutil.copy(self.file, self.path)
        return self.path

    def swap(self) -> None:
        """Puts the spare in the file's place, and what was there in the spare's. The file has one state or the other at any time."""
        # Windows wants a file that is open for writing here.
        _to_disk(self.path, os.O_RDWR)
        self._older.unlink(missing_ok=True)
        # A second name keeps the old state. Where the file system has no such thing it is lost, and the next `take` copies.
        with contextlib.suppress(OSError):
            os.link(self.file, self._older)
        os.replace(self.path, self.file)
        # The change is made; what fails from here on costs a copy at most.
        with contextlib.suppress(OSError):
            _to_disk(self.file.parent, os.O_RDONLY)
        with contextlib.suppress(OSError):
            os.replace(self._older, self.path)
            self._marks = _mark(self.file), _mark(self.path)

    def drop(self) -> None:
        """Removes the spare, and what one who was killed has left of his."""
        self._marks = None
        _remove(self.path, self._older)

    def discard(self) -> None:
        """`drop`, unless another writer is at work: then it is that one's."""
        self._marks = None
        _discard(os.getpid(), self.path, self._older)


def _discard(process: int, spare: Path, older: Path) -> None:
    # A fork's end is not the end of the writer it is a copy of.
    if process == os.getpid():
        with contextlib.suppress(OSError, RuntimeError), alone(spare.parent, 0.0):
            _remove(spare, older)


def _mark(path: Path) -> Mark:
    now = path.stat()
    return now.st_ino, now.st_size, now.st_mtime_ns


def _remove(*paths: Path) -> None:
    for path in paths:
        path.unlink(missing_ok=True)


def _to_disk(path: Path, flags: int) -> None:
    """Waits until a file's contents, or a folder's names, are on the disk."""
    opened = os.open(path, flags)
    try:
        os.fsync(opened)
    finally:
        os.close(opened)
