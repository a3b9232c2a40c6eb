"""Where the chain of an arm begins and ends in the tree of a URDF."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal

from truearm.errors import InputError, did_you_mean, list_names

Kind = Literal["revolute", "prismatic"]
MOVING: Final[Mapping[str, Kind]] = {
    "revolute": "revolute",
    "continuous": "revolute",
    "prismatic": "prismatic",
}
LINKS_NAMED: Final = 8
NAME_ONE: Final = '"FILE.urdf#TIP" or "FILE.urdf#BASE,TIP" where a robot is named'


def chain_between(
    links: Sequence[str], joints: Sequence[Any], base: str | None, tip: str | None
) -> tuple[str, str, list[Any]]:
    """Base link, tip link, and the joints between them, base to tip.

    Without `base` the chain begins at the root. Without `tip` it ends at the only leaf that moves against the
    base: frames that are fixed to it, such as a "base" beside a "base_link", are no end of an arm.

    Raises:
        InputError: If a link is unknown, several links may be meant, none is behind the other, or two joints
            lead to one on the way.
    """
    joint_to = {joint.child: joint for joint in joints}
    parents = {joint.parent for joint in joints}
    leaves = [name for name in links if name not in parents]
    for name in (base, tip):
        if name is not None and name not in links:
            hint = did_you_mean(name, links) or f"Its links end in {_named(leaves, 'and')}"
            raise InputError(f'there is no link "{name}"', rule=hint)
    first = base or _root([name for name in links if name not in joint_to], links)
    last = tip or _end(joint_to, first, leaves)
    _check_one_way(joints, first, last)
    return first, last, _path(joint_to, first, last)


def _root(roots: Sequence[str], links: Sequence[str]) -> str:
    if len(roots) == 1:
        return roots[0]
    if not links:
        raise InputError("it has no links", rule="A URDF has a <link> for every part of the arm")
    if not roots:
        raise InputError(f"its {len(links)} links form no tree")
    raise InputError(
        f"the chain may start at {_named(roots, 'or')}", way_out=f"Name one: base_link=..., or {NAME_ONE}"
    )


def _end(joint_to: Mapping[str, Any], base: str, leaves: Sequence[str]) -> str:
    """The only leaf behind a joint that moves."""
    paths = {leaf: _path(joint_to, base, leaf) for leaf in leaves if _is_behind(joint_to, base, leaf)}
    counts = {leaf: sum(joint.type in MOVING for joint in path) for leaf, path in paths.items()}
    most = max(counts.values(), default=0)
    ends = sorted((leaf for leaf in counts if counts[leaf] or not most), key=lambda leaf: -counts[leaf])
    if len(ends) == 1:
        return ends[0]
    if not most:
        raise InputError(f'no joint moves behind "{base}"')
    raise InputError(
        f"the chain may end at {_named(ends, 'or')}",
        rule=_fork([paths[leaf] for leaf in ends]),
        way_out=f"Name one, or any link before it, such as the flange: tip_link=..., or {NAME_ONE}",
    )


def _fork(paths: Sequence[Sequence[Any]]) -> str:
    """Where the ways to several ends part, as in a gripper; empty if no joint moves before."""
    shared = []
    for step in zip(*paths, strict=False):
        if any(joint is not step[0] for joint in step):
            break
        shared.append(step[0])
    if not any(joint.type in MOVING for joint in shared):
        return ""
    return f'Their ways part at "{shared[-1].child}"'


def _is_behind(joint_to: Mapping[str, Any], base: str, link: str) -> bool:
    for _ in range(len(joint_to) + 1):
        if link == base:
            return True
        if link not in joint_to:
            return False
        link = joint_to[link].parent
    return False


def _check_one_way(joints: Sequence[Any], base: str, tip: str) -> None:
    """Refuse links that two joints lead to, from the tip up to the base: the arm would be one of two."""
    link = tip
    for _ in joints:
        above = [joint for joint in joints if joint.child == link]
        if link == base or not above:
            return
        if len(above) > 1:
            raise InputError(
                f'link "{link}" is the child of {_named([joint.name for joint in above], "and")}',
                rule="One joint leads to a link",
                way_out="Leave out those that close a loop; what its rods couple can be said in a robot file",
            )
        link = above[0].parent


def _path(joint_to: Mapping[str, Any], base: str, tip: str) -> list[Any]:
    """Joints from `base` to `tip`, in this order."""
    if not _is_behind(joint_to, base, tip):
        raise InputError(f'link "{tip}" is not behind link "{base}"')
    joints: list[Any] = []
    link = tip
    while link != base:
        joints.insert(0, joint_to[link])
        link = joint_to[link].parent
    return joints


def _named(names: Iterable[str], last: str) -> str:
    """The names in words, the first eight of them."""
    known = list(names)
    if len(known) <= LINKS_NAMED + 1:
        return list_names(known, last)
    quoted = ", ".join(f'"{name}"' for name in known[:LINKS_NAMED])
    return f"{quoted} {last} {len(known) - LINKS_NAMED} others"
