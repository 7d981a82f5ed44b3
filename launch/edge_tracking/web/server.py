"""Server of one read-only page and of the newest message for it, on a port of this machine."""
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from ipaddress import ip_address
import math
import secrets
import socket
import threading
import time
from urllib.parse import parse_qs, urlsplit

from tactile_common.errors import ConfigurationError

LEFT = 2.0  # s without a request, after which nobody looks at the page
NOTHING = b'null'
HEADERS = {'X-Content-Type-Options': 'nosniff', 'Referrer-Policy': 'no-referrer',
           'Cache-Control': 'no-store', 'X-Frame-Options': 'DENY'}


def is_local(host: str) -> bool:
    """Return True if only this machine reaches an address."""
    try:
        return host == 'localhost' or ip_address(host).is_loopback
    except ValueError:
        return False


class Server(ThreadingHTTPServer):
    """
    Serves a page, and the bytes of `newest`, which the page asks for again and again.

    Raises a ConfigurationError if the port is not available.
    """

    daemon_threads = True

    def __init__(self, host: str, port: int, page: str):
        self.page, self.newest, self.asked = page.encode(), NOTHING, -math.inf
        self.token = '' if is_local(host) else secrets.token_urlsafe(16)
        self.address_family = socket.AF_INET6 if ':' in host else socket.AF_INET
        try:
            super().__init__((host, port), _Handler)
        except (OSError, OverflowError) as error:
            raise ConfigurationError(f'http://{host}:{port} cannot be served: {error}') from error
        threading.Thread(target=self.serve_forever, daemon=True).start()

    @property
    def watched(self) -> bool:
        """True if somebody looks at the page."""
        return time.monotonic() - self.asked < LEFT

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
    protocol_version = 'HTTP/1.1'  # one connection for all requests of a page
    timeout = 10.0

    def do_GET(self) -> None:
        asked = urlsplit(self.path)
        if not self._allowed(asked.query):
            self.send_error(HTTPStatus.FORBIDDEN)
        elif asked.path == '/':
            self._answer('text/html; charset=utf-8', self.server.page)
        elif asked.path == '/newest':
            self.server.asked = time.monotonic()
            self._answer('application/json', self.server.newest)
        else:
            self.send_error(HTTPStatus.NOT_FOUND)

    def _allowed(self, query: str) -> bool:
        """Check the token or, on this machine, the host name, which other sites cannot forge."""
        if self.server.token:
            token = parse_qs(query).get('token', [''])[0]
            return secrets.compare_digest(token.encode(), self.server.token.encode())
        try:
            name = urlsplit(f'//{self.headers.get("Host", "")}').hostname
        except ValueError:  # brackets without an address of IPv6
            return False
        return is_local(name or '')

    def _answer(self, kind: str, body: bytes) -> None:
        self.send_response(HTTPStatus.OK)
        for name, value in {'Content-Type': kind, 'Content-Length': str(len(body)),
                            **HEADERS}.items():
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Do not log requests."""
