"""Access to the page: a token that works once, then a cookie of the browser."""

from __future__ import annotations

import secrets
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie


class Access:
    """Access to one server.

    Parameters
    ----------
    port : int
        Port of the server: cookies of a host are shared by its ports, so that it is in the name.

    Attributes
    ----------
    token : str
        Token of the next browser.
    """

    def __init__(self, port: int) -> None:
        self._cookie = f"bench-{port}"
        self._keys: set[str] = set()
        self.token = secrets.token_urlsafe()

    def redeem(self, token: str) -> str | None:
        """Return the header that sets the cookie of a browser; None unless the token is the present one."""
        if not _equal(token, self.token):
            return None
        self.token, key = secrets.token_urlsafe(), secrets.token_urlsafe()
        self._keys.add(key)
        return f"{self._cookie}={key}; HttpOnly; SameSite=Strict; Path=/"

    def admits(self, cookies: Iterable[str]) -> bool:
        """True if one of the headers has the cookie of a browser that is admitted."""
        return any(_equal(self._key_in(header), key) for header in cookies for key in self._keys)

    def _key_in(self, header: str) -> str:
        try:
            cookie = SimpleCookie(header).get(self._cookie)
        except CookieError:
            return ""
        return cookie.value if cookie else ""


def _equal(text: str, secret: str) -> bool:
    return secrets.compare_digest(text.encode(), secret.encode())
