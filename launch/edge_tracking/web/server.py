"""Server of one read-only page and its stream of events, on a port of this machine."""
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
import secrets
import socket
import threading
from urllib.parse import parse_qs, urlsplit

from tactile_common.errors import ConfigurationError

MOST = 8  # simultaneous clients
KEEP_ALIVE = 1.0  # s, after which a disconnected client is noticed
HEADERS = {'X-Content-Type-Options': 'nosniff', 'Referrer-Policy': 'no-referrer',
           'Cache-Control': 'no-store', 'X-Frame-Options': 'DENY'}


class Feed:
    """The newest message for all clients; slow clients miss some."""

    def __init__(self) -> None:
        self.clients = 0
        self._text, self._number, self._changed = '', 0, threading.Condition()

    def put(self, text: str) -> None:
        """Send a new message to all clients."""
        with self._changed:
            self._text, self._number = text, self._number + 1
            self._changed.notify_all()

    def words(self) -> Iterator[str]:
        """Yield messages as they arrive, and an empty one after each timeout."""
        seen = self._number
        while True:
            with self._changed:
                if self._number == seen:
                    self._changed.wait(KEEP_ALIVE)
                text, seen = self._text if self._number != seen else '', self._number
            yield text

    @contextmanager
    def client(self) -> Iterator[bool]:
        """Count a client; yield True if there is room for it."""
        with self._changed:
            room = self.clients < MOST
            self.clients += room
        try:
            yield room
        finally:
            with self._changed:
                self.clients -= room


def is_local(host: str) -> bool:
    """Return True if only this machine reaches an address."""
    try:
        return host == 'localhost' or ip_address(host).is_loopback
    except ValueError:
        return False


class Server(ThreadingHTTPServer):
    """Serves a page and its `feed`; ConfigurationError if the port is not available."""

    daemon_threads = True

    def __init__(self, host: str, port: int, page: str):
        self.feed, self.page = Feed(), page.encode()
        self.token = '' if is_local(host) else secrets.token_urlsafe(16)
        self.address_family = socket.AF_INET6 if ':' in host else socket.AF_INET
        try:
            super().__init__((host, port), _Handler)
        except (OSError, OverflowError) as error:
            raise ConfigurationError(f'http://{host}:{port} cannot be served: {error}') from error
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def url(self) -> str:
        """Address of the page."""
        host, port = self.server_address[:2]
        name = f'[{host!s}]' if ':' in str(host) else host
        return f'http://{name!s}:{port}/' + (f'?token={self.token}' if self.token else '')

    def close(self) -> None:
        """Stop listening."""
        self.shutdown()
        self.server_close()


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = 10.0

    def do_GET(self) -> None:
        asked = urlsplit(self.path)
        if not self._allowed(asked.query):
            self.send_error(HTTPStatus.FORBIDDEN)
        elif asked.path == '/':
            self._begin('text/html; charset=utf-8')
            self.wfile.write(self.server.page)
        elif asked.path == '/events':
            with self.server.feed.client() as room:
                if room:
                    self._stream()
                else:
                    self.send_error(HTTPStatus.SERVICE_UNAVAILABLE)
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _allowed(self, query: str) -> bool:
        """Check the token or, on this machine, the host name, which other sites cannot forge."""
        if self.server.token:
            token = parse_qs(query).get('token', [''])[0]
            return secrets.compare_digest(token.encode(), self.server.token.encode())
        name = urlsplit(f'//{self.headers.get("Host", "")}').hostname
        return is_local(name or '')

    def _begin(self, kind: str) -> None:
        self.send_response(HTTPStatus.OK)
        for name, value in {'Content-Type': kind, **HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()

    def _stream(self) -> None:
        self._begin('text/event-stream')
        try:
            for text in self.server.feed.words():
                self.wfile.write(f'data: {text}\n\n'.encode() if text else b':\n\n')
        except OSError:
            pass  # the client is gone

    def log_message(self, *_: object) -> None:
        """Do not log requests."""
