"""A small server that corrects set-points for what cannot link the C library."""

from truearm.serving.protocol import PROTOCOL, MalformedError
from truearm.serving.server import Bounds, Server

__all__ = ["PROTOCOL", "Bounds", "MalformedError", "Server"]
