"""Sending end of a simulated serial port."""
import os
from pathlib import Path
import select
import tty

from tactile_common.errors import ConfigurationError

_TERMINALS = '/dev/pts/'


class PseudoTerminal:
    """
    Sending end of a pseudo-terminal with a link to its other end; it never blocks.

    Only the listener opens the other end. So the sender can see if somebody listens, and the
    listener sees a hang-up as soon as the sender closes or dies. A link left behind by an earlier
    pseudo-terminal is replaced.

    Raises
    ------
    ConfigurationError
        The link cannot be made, or its path is in use by something else.
    """

    def __init__(self, link: str):
        if not link:
            raise ConfigurationError("parameter 'port' is '', must be the path of a link to make")
        self._link = Path(link)
        left_behind = self._link.is_symlink() and os.readlink(link).startswith(_TERMINALS)
        if os.path.lexists(link) and not left_behind:
            raise ConfigurationError(
                f"parameter 'port': {link} exists and is not a mock sensor's, must be free")
        self._master, slave = os.openpty()
        self._target = os.ttyname(slave)
        tty.setraw(slave)
        os.close(slave)
        os.set_blocking(self._master, False)
        self._poll = select.poll()
        self._poll.register(self._master, 0)
        self._unsent = b''
        fresh = self._link.with_name(f'{self._link.name}.{os.getpid()}')
        try:
            os.symlink(self._target, fresh)
            os.replace(fresh, self._link)
        except OSError as error:
            fresh.unlink(missing_ok=True)
            os.close(self._master)
            raise ConfigurationError(
                f"parameter 'port': {link} cannot be made: {error.strerror}") from error

    @property
    def listened(self) -> bool:
        """True if somebody has opened the other end."""
        return not any(event & select.POLLHUP for _, event in self._poll.poll(0))

    def write(self, data: bytes) -> bool:
        """Send all of `data`, now or before the next write; False if nothing could be sent."""
        if self._unsent:
            self._unsent = self._unsent[self._put(self._unsent):]
            if self._unsent:
                return False
        sent = self._put(data)
        self._unsent = data[sent:] if sent else b''
        return sent > 0

    def _put(self, data: bytes) -> int:
        try:
            return os.write(self._master, data)
        except BlockingIOError:
            return 0

    def read(self) -> bytes:
        """Return the data sent by the listener; empty if there are none."""
        try:
            return os.read(self._master, 4096)
        except OSError:  # no data, or nobody listens
            return b''

    def forget(self) -> None:
        """Drop the rest of an incomplete write before the next listener connects."""
        self._unsent = b''

    def close(self) -> None:
        """Remove the link, unless it now belongs to another terminal, and hang up."""
        if self._link.is_symlink() and os.readlink(self._link) == self._target:
            self._link.unlink(missing_ok=True)
        os.close(self._master)
