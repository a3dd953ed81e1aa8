"""``cmpdesign studio``: the page in the browser."""

from __future__ import annotations

from typing import Annotated

import typer

from cmpdesign.cli.mode import current_mode
from cmpdesign.cli.terminal import finish, print_document

EXAMPLES = (
    "cmpdesign studio",
    "cmpdesign studio --port 0 --no-browser",
)

PortOption = Annotated[int, typer.Option(min=0, max=65535, help="Port of the page; 0: any free port.")]
HostOption = Annotated[
    str, typer.Option(help="Address to listen on; another than 127.0.0.1 lets other machines use the page.")
]
BrowserOption = Annotated[bool, typer.Option("--no-browser", help="Print the address only.")]
PORT, HOST = 8300, "127.0.0.1"


def studio(port: PortOption = PORT, host: HostOption = HOST, no_browser: BrowserOption = False) -> None:
    """Design, check, make and read a pad in the browser.

    One line on standard output is the page's address; it holds the token without which no request is answered. The
    page asks no other machine for anything. Ctrl-C ends it.
    """
    from cmpdesign.studio.serving import serve

    serve(host, port, announce, with_browser=not no_browser)


def announce(address: str) -> None:
    """Print the page's address: a line, or the document with ``--json``."""
    from cmpdesign.documents.designs import StudioDocument

    if current_mode().as_json:
        finish(lambda: StudioDocument(address=address))
    else:
        print_document(f"{address}\n")
