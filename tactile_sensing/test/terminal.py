"""A pseudo-terminal that a sensor writes to."""
import os
import tty


class Terminal:
    """The sensor side of a pseudo-terminal; a link names the driver's side."""

    def __init__(self, link):
        self.link = link
        self.plug_in()

    def plug_in(self):
        self.master, slave = os.openpty()
        tty.setraw(slave)
        os.set_blocking(self.master, False)
        self.link.unlink(missing_ok=True)
        self.link.symlink_to(os.ttyname(slave))
        # Keep the slave open until the driver opens it, otherwise the master reads EIO.
        self._slave = slave

    def unplug(self):
        if self.master is not None:
            os.close(self._slave)
            os.close(self.master)
            self.master = None
            self.link.unlink()

    def write(self, data):
        """Send bytes, as long as a reader takes them."""
        try:
            os.write(self.master, data)
        except BlockingIOError:
            pass
