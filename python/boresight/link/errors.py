"""Errors of the link."""
from __future__ import annotations

class LinkError(Exception):
    """The simulation has rejected a message, or a received message is invalid."""


class LinkTimeout(LinkError):
    """Time-out: no message was received."""
