"""URScript's text in statements and expressions, each with its place.

Only what targets can be written with is understood; what else stands in a program is kept as it is. The
syntax is that of Universal Robots' Script Manual (e-Series, 5.11 and later; CB-Series, 3.x).
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from truearm.programs.source import Source

# fmt: off
_TOKEN: Final = re.compile(
    r"(?P<space>[ \t\r\f\v]+)|(?P<comment>\#[^\n]*)|(?P<string>\"[^\"\n]*\"?)|(?P<newline>\n)"
    r"|(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?(?![\w.]))|(?P<name>[A-Za-z_]\w*)"
    r"|(?P<mark>\$[^\n]*)|(?P<operator>[<>=!]=|.)",
    re.ASCII,
)
# fmt: on
_SKIPPED: Final = frozenset({"space", "comment", "mark"})
_OPENING, _CLOSING = "([{", ")]}"
FUNCTIONS: Final = frozenset({"def", "thread", "sec"})
LOOPS: Final = frozenset({"while", "for"})
BLOCKS: Final = FUNCTIONS | LOOPS | {"if", "switch", "case", "default"}
"""First words of what an `end` closes."""
CHAINED: Final = frozenset({"elif", "else"})
HEADERS: Final = BLOCKS | CHAINED
_ALSO_BEHIND: Final = CHAINED | {"end"}
"""Words that begin a statement behind another one in the same line."""
_DEEPEST: Final = 60
_PRECEDENCE: Final = {
    "or": 1, "xor": 1, "and": 2, "==": 3, "!=": 3, "<": 3, ">": 3, "<=": 3, ">=": 3,
    "+": 4, "-": 4, "*": 5, "/": 5, "%": 5, "^": 6,
}  # fmt: skip
_BINDING_OF_SIGN: Final = 6
PARAMETERS: Final = {
    "pose_trans": ("p_from", "p_from_to"),
    "pose_add": ("p_1", "p_2"),
    "pose_sub": ("p_to", "p_from"),
    "pose_inv": ("p_from",),
    "get_forward_kin": ("q",),
    "d2r": ("d",),
    "r2d": ("r",),
    "sqrt": ("f",),
    "sin": ("f",),
    "cos": ("f",),
}
"""Names of the arguments of functions in their order (Script Manual); of get_forward_kin without the TCP."""


class Token(NamedTuple):
    """A word of the text: kind (number, name, string, operator or newline), offsets and text."""

    kind: str
    start: int
    end: int
    text: str


class Statement(NamedTuple):
    """One statement; line ends within brackets are nothing, a header ends with its colon.

    What stands in one line before an `end`, `else` or `elif` is a statement of its own.
    """

    tokens: tuple[Token, ...]

    @property
    def at(self) -> int:
        """Offset of its first character."""
        return self.tokens[0].start

    @property
    def word(self) -> str:
        """Its first word."""
        return self.tokens[0].text

    @property
    def names(self) -> list[str]:
        """All names in it."""
        return [token.text for token in self.tokens if token.kind == "name"]


@dataclass(frozen=True, slots=True)
class Node:
    """A part of an expression.

    Attributes:
        kind: "number", "name", "string", "list", "pose", "call", "index", "sign" or "operation".
        start: Offset of its first character.
        end: Offset behind its last one.
        text: The name, of a call that of the function, the operator, or the text of a number.
        parts: Elements, arguments or operands.
        keys: Names of a call's arguments; empty for those given by position.
    """

    kind: str
    start: int
    end: int
    text: str = ""
    parts: tuple["Node", ...] = ()
    keys: tuple[str, ...] = ()

    def walk(self) -> Iterator["Node"]:
        """This node and all below it, in the order of the text."""
        pending = [self]
        while pending:
            node = pending.pop()
            yield node
            pending += reversed(node.parts)


class NotReadable(Exception):  # noqa: N818 - not an error of the program: what it is in is listed
    """A statement that is no URScript as we know it.

    Attributes:
        at: Offset of what was not expected.
    """

    def __init__(self, at: int) -> None:
        super().__init__(at)
        self.at = at


def statements(source: Source, start: int, end: int) -> Iterator[Statement]:
    """The statements of a text from `start` to `end`, which are ends of lines."""
    tokens: list[Token] = []
    depth = 0
    start = max(start, source.first)
    text = source.part(start, end)
    for match in _TOKEN.finditer(text.replace("\r", "\n") if source.newline == "\r" else text):
        kind = match.lastgroup or ""
        if kind in _SKIPPED or (kind == "newline" and depth > 0):
            continue
        token = Token(kind, start + match.start(), start + match.end(), match.group())
        if kind == "newline":
            if tokens:
                yield Statement(tuple(tokens))
            tokens = []
            continue
        if tokens and depth == 0 and token.text in _ALSO_BEHIND and tokens[-1].text != ".":
            yield Statement(tuple(tokens))
            tokens = []
        tokens.append(token)
        if token.text in _OPENING:
            depth += 1
        elif token.text in _CLOSING:
            depth = max(depth - 1, 0)
        elif token.text == ":" and depth == 0 and tokens[0].text in HEADERS:
            yield Statement(tuple(tokens))
            tokens = []
    if tokens:
        yield Statement(tuple(tokens))


def expression(tokens: Sequence[Token]) -> Node:
    """The expression that `tokens` are.

    Raises:
        NotReadable: If they are none.
    """
    parser = _Parser(tokens)
    node = parser.expression(0)
    parser.finish()
    return node


def argument(call: Node, position: int, name: str) -> Node | None:
    """The argument of that name, or at that position; None if it is not given."""
    for place, (key, part) in enumerate(zip(call.keys, call.parts, strict=True)):
        if key == name or (not key and place == position):
            return part
    return None


def arguments(call: Node) -> tuple[Node, ...] | None:
    """The arguments of a call in the order of its function's parameters, whether by place or by name.

    None if they are not each given once, or others are, or for a function that is not known.
    """
    names = PARAMETERS.get(call.text, ())
    found = [argument(call, position, name) for position, name in enumerate(names)]
    given = tuple(part for part in found if part is not None)
    each_once = len({part.start for part in given}) == len(given) == len(names) == len(call.parts)
    return given if names and each_once else None


def opens_pose(tokens: Sequence[Token], place: int) -> bool:
    """Whether the token at `place` is the p of a pose written out, p[...], and no name."""
    behind = tokens[place + 1 : place + 2]
    adjacent = [token.start for token in behind if token.text == "["] == [tokens[place].end]
    return tokens[place].text == "p" and adjacent


class _Parser:
    """Precedence climbing over the tokens of one expression."""

    def __init__(self, tokens: Sequence[Token]) -> None:
        self._tokens = tokens
        self._next = 0
        self._depth = 0

    def finish(self) -> None:
        """Nothing may be left."""
        if self._next < len(self._tokens):
            raise NotReadable(self._tokens[self._next].start)

    def expression(self, least: int) -> Node:
        """Operands joined by operators that bind at least so strongly."""
        self._depth += 1
        if self._depth > _DEEPEST:
            raise NotReadable(self._tokens[min(self._next, len(self._tokens) - 1)].start)
        left = self._operand()
        while (binding := _PRECEDENCE.get(self._peek(), 0)) > least:
            operator = self._take()
            right = self.expression(binding)
            left = Node("operation", left.start, right.end, operator.text, (left, right))
        self._depth -= 1
        return left

    def _operand(self) -> Node:
        token = self._take()
        if token.text in ("-", "+", "not"):
            below = self.expression(_BINDING_OF_SIGN)
            adjacent = below.kind == "number" and below.start == token.end and token.text != "not"
            if adjacent and below.text[0] not in "+-":
                return Node("number", token.start, below.end, token.text + below.text)
            return Node("sign", token.start, below.end, token.text, (below,))
        if token.kind in ("number", "string"):
            return Node(token.kind, token.start, token.end, token.text)
        if token.text == "(":
            inner = self.expression(0)
            self._expect(")")
            return inner
        if token.text == "[":
            parts, _, end = self._items("]")
            return Node("list", token.start, end, "", parts)
        if token.kind == "name":
            return self._behind_name(token)
        raise NotReadable(token.start)

    def _behind_name(self, token: Token) -> Node:
        if opens_pose(self._tokens, self._next - 1):
            self._take()
            parts, _, end = self._items("]")
            return Node("pose", token.start, end, "", parts)
        node = Node("name", token.start, token.end, token.text)
        while self._peek() in ("(", "[", "."):
            opening = self._take()
            if opening.text == ".":
                member = self._take()
                node = Node("index", node.start, member.end, member.text, (node,))
                continue
            parts, keys, end = self._items(")" if opening.text == "(" else "]")
            if opening.text == "(":
                called = node.text if node.kind == "name" else ""
                node = Node("call", node.start, end, called, parts, keys)
            else:
                node = Node("index", node.start, end, "", (node, *parts))
        return node

    def _items(self, closing: str) -> tuple[tuple[Node, ...], tuple[str, ...], int]:
        """Elements up to the closing bracket, their names, and the offset behind the bracket."""
        parts: list[Node] = []
        keys: list[str] = []
        while self._peek() != closing:
            named = len(self._tokens) > self._next + 1 and self._tokens[self._next + 1].text == "="
            if named and self._tokens[self._next].kind == "name":
                keys.append(self._take().text)
                self._take()
            else:
                keys.append("")
            parts.append(self.expression(0))
            if self._peek() != closing:
                self._expect(",")
        return tuple(parts), tuple(keys), self._take().end

    def _peek(self) -> str:
        if self._next < len(self._tokens):
            token = self._tokens[self._next]
            return "" if token.kind == "string" else token.text
        return ""

    def _take(self) -> Token:
        if self._next >= len(self._tokens):
            raise NotReadable(self._tokens[-1].end if self._tokens else 0)
        self._next += 1
        return self._tokens[self._next - 1]

    def _expect(self, text: str) -> None:
        token = self._take()
        if token.text != text:
            raise NotReadable(token.start)
