"""Clients of the bench's page without a browser: requests and sockets."""

import contextlib
import http.client
from urllib.parse import urlsplit

import msgspec
import viser
from websockets.sync.client import connect

PROTOCOL = f"viser-v{viser.__version__}"


CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [0.0, 0.0, 1.0],
    "fov": 1.3,
    "near": 0.01,
    "far": 1000,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


def port(page):
    return urlsplit(page.address).port


def raw_get(page, path="/", **headers):
    """Status, headers and body of an answer; a header that is given takes the place of the usual."""
    connection = http.client.HTTPConnection("127.0.0.1", port(page))
    connection.putrequest("GET", path, skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    answer = connection.getresponse()
    body = answer.read()
    connection.close()
    return answer.status, answer.headers, body


def cookie(page):
    """Cookie of a browser that opens the printed address."""
    status, headers, _ = raw_get(page, urlsplit(page.address)._replace(scheme="", netloc="").geturl())
    assert (status, headers["Location"]) == (303, "/")
    return headers["Set-Cookie"].partition(";")[0]


def get(page, path="/", **headers):
    return raw_get(page, path, **{"Cookie": cookie(page), **headers})


def socket_to(page, origin=None, protocol=PROTOCOL, path="", **headers):
    at = f"ws://127.0.0.1:{port(page)}{path}"
    headers = {"Cookie": cookie(page), **headers}
    options = {"max_size": None, "max_queue": None, "proxy": None, "open_timeout": None, "ping_timeout": None}
    return connect(at, origin=origin, subprotocols=[protocol], additional_headers=headers, **options)


@contextlib.contextmanager
def page_socket(page):
    """Socket that has become a page, as the messages of its camera make it."""
    with socket_to(page) as visitor:
        visitor.send(msgspec.msgpack.encode(CAMERA))
        yield visitor


def is_alive(page):
    """True if a page that comes now is served, and heard."""
    with page_socket(page) as visitor:
        return len(visitor.recv()) > 0


def handle_of(page, label):
    """Name of what has a label, as the server has it."""
    known = page._server.gui._gui_input_handle_from_uuid.items()
    return next(uuid for uuid, handle in known if handle.label == label)


def changed(name, **updates):
    return msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": name, "updates": updates})
