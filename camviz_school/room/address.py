"""Under which addresses a room can be reached, and as what a telephone's camera reads one of them."""

from __future__ import annotations

import io
import ipaddress
import socket
from contextlib import suppress
from importlib.util import find_spec

LOOPBACK = "127.0.0.1"
PORT = 8787
ANYWHERE = ("0.0.0.0", "::")


def own_addresses() -> list[str]:
    """The addresses of this machine's interfaces, IPv4, without loopback, as far as the system tells without asking."""
    found = []
    for somewhere in ("192.168.255.255", "10.255.255.255", "172.31.255.255", "192.0.2.255"):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:  # chooses a route, and sends nothing
            try:
                probe.connect((somewhere, 9))
                found.append(str(probe.getsockname()[0]))
            except OSError:
                continue
    with suppress(OSError):
        found += socket.gethostbyname_ex(socket.gethostname())[2]
    return [one for one in dict.fromkeys(found) if not ipaddress.ip_address(one).is_loopback]


def shown_host(host: str) -> str:
    """What stands for a host in an address that others type: for all interfaces, the first of them."""
    if host in ANYWHERE:
        return (own_addresses() or [LOOPBACK])[0]
    return f"[{host}]" if ":" in host else host


def is_named_safely(host: str) -> bool:
    """Whether a request's Host is an address, or a name of this machine.

    Any other name may be an attacker's that was made to lead here (DNS rebinding).
    """
    name = host.rsplit(":", 1)[0] if host.count(":") == 1 or "]:" in host else host
    try:
        ipaddress.ip_address(name.strip("[]"))
    except ValueError:
        own = socket.gethostname().lower()
        return name.lower() in {"localhost", own, own.partition(".")[0] + ".local"}
    return True


def qr_svg(text: str) -> str:
    """A QR code as a data: address of an SVG; "" without the library segno."""
    if find_spec("segno") is None:
        return ""
    import segno

    return str(segno.make(text, error="m", micro=False).svg_data_uri(scale=8, border=4, light="#fff", dark="#000"))


def qr_terminal(text: str) -> str:
    """A QR code for a terminal, of half blocks; "" without the library segno."""
    if find_spec("segno") is None:
        return ""
    import segno

    drawn = io.StringIO()
    segno.make(text, error="m", micro=False).terminal(out=drawn, border=2, compact=True)
    return drawn.getvalue()
