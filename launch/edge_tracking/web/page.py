"""Self-contained web page; its content security policy forbids loading anything."""
from base64 import b64encode
from hashlib import sha256
from html import escape
from importlib import resources
import json
from typing import Any

import numpy as np

# Colours from zero to the largest pressure, for levels 0 to 254; 255 is an invalid tactel.
COLOURS = ((251, 252, 191), (254, 194, 134), (251, 134, 96), (229, 80, 99), (181, 54, 121),
           (129, 37, 129), (79, 17, 123), (27, 16, 68), (0, 0, 3))
INVALID = 255


def levels(pressure: np.ndarray, top: float) -> np.ndarray:
    """Convert pressures to bytes: 0 to 254 from 0 to the top, `INVALID` for NaN."""
    shades = np.clip(pressure * (254.0 / max(top, 1e-30)), 0.0, 254.0)
    missing = np.isnan(shades)
    return np.where(missing, INVALID, np.rint(np.where(missing, 0.0, shades))).astype(np.uint8)


def packed(values: Any, dtype: str) -> str:
    """Return an array as text: base64 of little-endian values."""
    return b64encode(np.ascontiguousarray(values, dtype).tobytes()).decode('ascii')


def make_page(title: str, body: str, scripts: tuple[str, ...], *, kind: str = '',
              connect: str = "'none'") -> str:
    """
    Return the HTML of a page from a body in which all external text is escaped.

    `scripts` are names of scripts of this package, `kind` is the class of the body; `connect` is
    where the page may connect to, see `connect-src` of a content security policy.
    """
    read = [(resources.files(__package__) / name).read_text('utf-8')
            for name in ('page.css', *scripts)]
    hashes = [f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in read]
    policy = (f"default-src 'none'; img-src data:; style-src {hashes[0]}; script-src "
              f"{' '.join(hashes[1:])}; connect-src {connect}; base-uri 'none'; "
              "form-action 'none'")
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<title>{escape(title)}</title><style>{read[0]}</style></head>'
        f'<body class="{kind}" data-colours="{json.dumps(COLOURS)}">\n{body}\n'
        + ''.join(f'\n<script>{script}</script>' for script in read[1:]) + '\n</body></html>\n')
