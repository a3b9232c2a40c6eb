"""Numbered lines with a check sum, the outer layer of the cell's own protocol: "#17 WHERE*5A3C".

See docs/reference/cell-protocols.md. The number tells an answer from a late or repeated one, and a request
that is sent again from a new one; the check sum (CRC-16, polynomial 0x1021, initial value 0) tells a line
that was damaged.
"""

import binascii
import re
from typing import Final

FRAME: Final = re.compile(r"#(\d{1,9}) ([ -)+-~]+)\*([0-9A-F]{4})")


def framed(number: int, text: str) -> str:
    """The line for a text; `text` has no asterisk."""
    body = f"#{number} {text}"
    return f"{body}*{_sum(body):04X}"


def unframed(line: str) -> tuple[int, str] | None:
    """Number and text of a line, None where it is damaged."""
    text = line.strip()
    match = FRAME.fullmatch(text)
    if match is None or int(match[3], 16) != _sum(text[:-5]):
        return None
    return int(match[1]), match[2]


def _sum(body: str) -> int:
    return binascii.crc_hqx(body.encode("ascii", "replace"), 0)
