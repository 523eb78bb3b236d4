"""Message definitions that a bag may lack: bags of ROS 2 Humble and older store none."""

from functools import cache

from vftcli.readers.bags.container import Channel
from vftcli.readers.bags.franka_interface import DEFINITIONS
from vftcli.readers.bags.layout import Field, LayoutError, fields_of, short, types_of
from vftcli.signals.errors import LogError

STATE = "franka_msgs/msg/FrankaRobotState"
"""The one type outside ROS's own packages that is known without the bag's help."""


def with_parts(name: str) -> str:
    """A definition followed by those of the types of its own package, as bags embed them."""
    parts = [
        f"{'=' * 80}\nMSG: {short(other)}\n{text.rstrip()}"
        for other, text in DEFINITIONS.items()
        if other != name
    ]
    return "\n".join([DEFINITIONS[name].rstrip(), *parts]) + "\n"


EMBEDDED = {short(STATE): with_parts(STATE)}
"""Message type outside ROS's own packages → its definition."""


def types_for(channel: Channel) -> dict[str, tuple[Field, ...]]:
    """All types that a channel's messages are made of: the container's own first.

    Raises:
        LogError: If neither the container nor this package knows the type.
        LayoutError: If the container's definition cannot be parsed.
    """
    known = dict(_humble())
    if channel.definition:
        known |= types_of(channel.definition, _long(channel.type), idl=channel.idl)
    elif channel.type in EMBEDDED:
        known |= types_of(EMBEDDED[channel.type], _long(channel.type), idl=False)
    if channel.encoding == "ros1":
        known["builtin_interfaces/Time"] = TIME
        known["builtin_interfaces/Duration"] = TIME
    if channel.type not in known:
        raise LogError(
            f"topic {channel.topic}: the bag holds no definition of {channel.type}. Convert it "
            "with ros2 bag convert on a machine that has the package."
        )
    return known


TIME = (Field("sec", "int32", None), Field("nanosec", "uint32", None))


@cache
def _humble() -> dict[str, tuple[Field, ...]]:
    """The messages of ROS 2 Humble, from rosbags' store."""
    from rosbags.typesys import Stores, get_typestore

    found = {}
    for name, (_, fields) in get_typestore(Stores.ROS2_HUMBLE).fielddefs.items():
        try:
            found[short(name)] = fields_of(fields)
        except LayoutError:
            continue
    return found


def _long(name: str) -> str:
    package, _, kind = name.partition("/")
    return f"{package}/msg/{kind}"
